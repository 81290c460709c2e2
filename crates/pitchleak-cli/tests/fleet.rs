//! `pitchleak fleet` from outside.

#![allow(clippy::unwrap_used)]

use pitchleak::core::PerLeak;
use pitchleak_testkit::Motion;
use pitchleak_testkit::rig::PAPER;
use pitchleak_testkit::trace_text::file;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

fn farm() -> TempDir {
    let farm = TempDir::new().unwrap();
    for (blade, internal) in [("B1", 0.0), ("B2", 1.2e-11)] {
        let folder = farm.path().join(blade);
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("rig.toml"), PAPER).unwrap();
        let motion = Motion::sines(PerLeak { internal, external_a: 0.0, external_b: 0.0 });
        fs::write(folder.join("2026-05-01.csv"), file(&motion.rows(3000))).unwrap();
    }
    farm
}

fn fleet(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pitchleak"));
    command.current_dir(folder).arg("fleet").args(arguments).output().unwrap()
}

#[test]
fn a_fleet_is_judged_as_replay_judges_each() {
    let farm = farm();
    let done = fleet(farm.path(), &["*/*.csv", "--json", "--out", "fleet.csv"]);
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(report["schema"], "pitchleak.fleet/1");
    assert_eq!((&report["counts"]["leak"], &report["counts"]["sound"]), (&1.into(), &1.into()));
    for row in report["rows"].as_array().unwrap() {
        let path = row["path"].as_str().unwrap();
        let mut replay = Command::new(env!("CARGO_BIN_EXE_pitchleak"));
        let replay = replay.current_dir(farm.path()).args(["replay", path, "--json"]).output().unwrap();
        let replay: Value = serde_json::from_slice(&replay.stdout).unwrap();
        assert_eq!(row["status"], replay["verdict"]["status"]);
        assert_eq!(row["faults"], replay["verdict"]["faults"]);
        assert_eq!(row["rig"], replay["rig"]);
        assert_eq!(row["samples"], replay["trace"]["samples"]);
        for leak in ["internal", "external_a", "external_b"] {
            assert_eq!(row["leaks"][leak]["mean_lpm"], replay["leakage"][leak]["mean_lpm"]);
            assert_eq!(row["leaks"][leak]["trend"], replay["trend"][leak]);
        }
    }
    let table = fs::read_to_string(farm.path().join("fleet.csv")).unwrap();
    let lines: Vec<_> = table.lines().collect();
    assert!(lines[0].starts_with("cylinder,path,begins,rig,status,faults,reasons,internal_lpm"));
    assert!(
        lines[1].starts_with("B1,B1/2026-05-01.csv,2026-05-01T00:00:00Z,B1/rig.toml,sound,,,"),
        "{}",
        lines[1]
    );
    assert!(lines[2].contains(",leak,internal,,1."), "{}", lines[2]);
}

#[test]
fn the_odds_that_a_fleet_teaches_go_into_a_rig_file() {
    let farm = farm();
    let odds = |arguments: &[&str]| {
        let done = fleet(farm.path(), &[&["*/*.csv", "--odds"], arguments].concat());
        assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8(done.stdout).unwrap()
    };
    let text = odds(&[]);
    let (_, lines) = text.split_once("odds learnt from 2 cylinders, for the rig files\n").unwrap();
    let json: Value = serde_json::from_str(&odds(&["--json"])).unwrap();
    let constant = json["odds"]["shares"].as_array().unwrap().iter().find(|one| one["id"] == "constant");
    assert!(constant.unwrap()["cylinders"].as_f64().unwrap() > 0.5, "one cylinder leaks: {json}");
    for blade in ["B1", "B2"] {
        fs::write(farm.path().join(blade).join("rig.toml"), PAPER.to_owned() + lines).unwrap();
    }
    let again: Value = serde_json::from_str(&odds(&["--json"])).unwrap();
    assert!(again["rows"][0]["odds"]["zeros_usual"].as_f64().unwrap() > 0.7, "{again}");
    assert_eq!(again["counts"], json["counts"]);
}

#[test]
fn a_bad_file_is_told_and_the_others_are_judged() {
    let farm = farm();
    fs::write(farm.path().join("B1/broken.csv"), "a,b\n1,2\n").unwrap();
    let done = fleet(farm.path(), &["*/*.csv", "--out", "fleet.parquet"]);
    assert_eq!(done.status.code(), Some(2));
    let complaints = String::from_utf8(done.stderr).unwrap();
    assert!(complaints.starts_with("error: B1/broken.csv: no column for"), "{complaints}");
    assert!(complaints.ends_with("error: 1 of 3 traces could not be judged\n"), "{complaints}");
    let text = String::from_utf8(done.stdout).unwrap();
    let counts =
        "3 cylinders: 1 leak, 1 sound, 0 doubtful, 0 not sure, 1 not judged (3 traces, 1 not judged)\n";
    assert!(text.starts_with(counts), "{text}");
    assert!(fs::read(farm.path().join("fleet.parquet")).unwrap().starts_with(b"PAR1"));
}

#[test]
fn many_days_of_a_cylinder_are_one_line_and_one_fault() {
    let farm = farm();
    for day in 2..5 {
        let motion = Motion::sines(PerLeak { internal: 1.2e-11, external_a: 0.0, external_b: 0.0 });
        let path = farm.path().join(format!("B2/2026-05-0{day}.csv"));
        fs::write(path, file(&motion.rows(2900 + day))).unwrap();
    }
    let done = fleet(farm.path(), &["*/*.csv", "--fail-on-fault"]);
    let text = String::from_utf8(done.stdout).unwrap();
    assert_eq!(done.status.code(), Some(1), "{text}");
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(lines[0], "2 cylinders: 1 leak, 1 sound, 0 doubtful, 0 not sure (5 traces)");
    assert!(
        lines[2].starts_with("LEAK      B2  internal 1.") && lines[2].ends_with("since 2026-05-01 or before")
    );
    assert_eq!(lines.iter().filter(|line| line.contains("LEAK")).count(), 1, "{text}");
    let done = fleet(farm.path(), &["*/*.csv", "--json"]);
    assert_eq!(done.status.code(), Some(0));
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    let worst = &report["by_cylinder"][0];
    assert_eq!((&worst["cylinder"], &worst["since"]), (&"B2".into(), &"2026-05-01T00:00:00Z".into()));
    assert_eq!((&report["cylinders"], &report["cylinder_counts"]["leak"]), (&2.into(), &1.into()));
    assert_eq!((&report["traces"], &report["counts"]["leak"]), (&5.into(), &4.into()));
    // The leak is gone: nobody has to go there any more.
    fs::write(farm.path().join("B2/2026-05-06.csv"), file(&Motion::sines(PerLeak::default()).rows(2999)))
        .unwrap();
    assert_eq!(fleet(farm.path(), &["*/*.csv", "--fail-on-fault"]).status.code(), Some(0));
    fs::write(farm.path().join("B1/broken.csv"), "a,b\n1,2\n").unwrap();
    assert_eq!(fleet(farm.path(), &["*/*.csv", "--fail-on-fault"]).status.code(), Some(2));
}

#[test]
fn a_second_night_reads_what_is_new_and_reports_all() {
    let farm = farm();
    let night = || {
        let done = fleet(farm.path(), &["*/*.csv", "--table", "nights", "--json"]);
        assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
        serde_json::from_slice::<Value>(&done.stdout).unwrap()
    };
    let parts =
        |day: &str| fs::read_dir(farm.path().join(format!("nights/day={day}"))).map_or(0, Iterator::count);
    let first = night();
    assert_eq!(parts("2026-05-01"), 1);
    // Nothing is new: nothing is read, although a file is no trace any more, and nothing is written.
    let leaking = farm.path().join("B2/2026-05-01.csv");
    let (text, time) = (fs::read(&leaking).unwrap(), fs::metadata(&leaking).unwrap().modified().unwrap());
    fs::write(&leaking, vec![b'x'; text.len()]).unwrap();
    fs::File::options().write(true).open(&leaking).unwrap().set_modified(time).unwrap();
    let second = night();
    assert_eq!((&second["by_cylinder"], parts("2026-05-01")), (&first["by_cylinder"], 1));
    // A new day and a changed file are read; a file that is gone stays in the table.
    fs::write(farm.path().join("B1/2026-05-02.csv"), &text).unwrap();
    fs::remove_file(&leaking).unwrap();
    let sound = fs::read_to_string(farm.path().join("B1/2026-05-01.csv")).unwrap();
    fs::write(farm.path().join("B1/2026-05-01.csv"), sound + "\n").unwrap();
    let third = night();
    assert_eq!((parts("2026-05-01"), parts("2026-05-02")), (2, 1));
    assert_eq!((&third["traces"], &third["cylinder_counts"]["leak"]), (&3.into(), &2.into()));
    let of_gone = |report: &Value| {
        let rows = report["rows"].as_array().unwrap();
        rows.iter().find(|row| row["path"] == "B2/2026-05-01.csv").unwrap().clone()
    };
    assert_eq!(of_gone(&third)["leaks"], of_gone(&second)["leaks"]);
    // A changed rig changes what its traces say.
    fs::write(farm.path().join("B1/rig.toml"), format!("{PAPER}\n[decision]\nalpha = 0.04\n")).unwrap();
    night();
    assert_eq!((parts("2026-05-01"), parts("2026-05-02")), (3, 2));
}

#[test]
fn a_damaged_night_is_named_and_a_trace_that_failed_is_tried_again() {
    let farm = farm();
    fs::write(farm.path().join("B1/broken.csv"), "a,b\n1,2\n").unwrap();
    for _ in 0..2 {
        let done = fleet(farm.path(), &["*/*.csv", "--table", "nights"]);
        assert_eq!(done.status.code(), Some(2));
        assert!(String::from_utf8(done.stderr).unwrap().starts_with("error: B1/broken.csv: no column for"));
    }
    fs::write(farm.path().join("nights/day=2026-05-01/night-0001.parquet"), "PAR1").unwrap();
    let done = fleet(farm.path(), &["*/*.csv", "--table", "nights"]);
    let complaint = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(2));
    assert!(complaint.starts_with("error: nights/day=2026-05-01/night-0001.parquet: "), "{complaint}");
}

#[test]
fn links_and_copies_are_told_and_judged_once() {
    let farm = farm();
    let name = |name: &str| farm.path().join(name);
    fs::hard_link(name("B2/2026-05-01.csv"), name("B2/linked.csv")).unwrap();
    fs::copy(name("B2/2026-05-01.csv"), name("B2/copied.csv")).unwrap();
    let done = fleet(farm.path(), &["*/*.csv", "--out", "fleet.csv"]);
    assert_eq!(done.status.code(), Some(0));
    let told = String::from_utf8(done.stderr).unwrap();
    let expected = [
        "warning: B2/linked.csv is the same file as B2/2026-05-01.csv: judged once, as a trace of B2",
        "warning: B2/copied.csv is a copy of B2/2026-05-01.csv: judged once, as a trace of B2",
    ];
    assert_eq!(told.lines().collect::<Vec<_>>(), expected);
    assert_eq!(fs::read_to_string(name("fleet.csv")).unwrap().lines().count(), 3);
}

#[test]
fn wrong_usage_is_told_before_any_work() {
    let farm = farm();
    let wrong: [(&[&str], &str); 6] = [
        (&["*/*.txt"], "*/*.txt: no such trace"),
        (&["B1"], "B1 is a folder"),
        (
            &["*/*.csv", "--out", "fleet.xlsx"],
            "fleet.xlsx: the table of a fleet is written as .parquet, .csv or .csv.gz",
        ),
        (&["*/*.csv", "--out", "B1/2026-05-01.csv"], "not written over the run's own input"),
        (&["*/*.csv", "--out", "B1/rig.csv", "--rig", "none.toml"], "none.toml"),
        (&["*/*.csv", "--rig", "none.csv"], "none.csv"),
    ];
    for (arguments, message) in wrong {
        let done = fleet(farm.path(), arguments);
        let complaint = String::from_utf8(done.stderr).unwrap();
        assert_eq!(
            (done.status.code(), complaint.lines().count()),
            (Some(2), 1),
            "{arguments:?}: {complaint}"
        );
        assert!(complaint.contains(message), "{complaint}");
        assert!(done.stdout.is_empty());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_ends_it_and_leaves_nothing() {
    use std::io::Write;
    use std::process::Stdio;
    use std::time::{Duration, Instant};
    let farm = farm();
    let endless = farm.path().join("endless.csv");
    assert!(Command::new("mkfifo").arg(&endless).status().unwrap().success());
    // Whoever runs the tests may have it ignored; then the program leaves that so.
    let mut command = Command::new("env");
    command.args(["--default-signal=INT,TERM,HUP", env!("CARGO_BIN_EXE_pitchleak")]);
    command.current_dir(farm.path()).args(["fleet", "endless.csv", "--out", "fleet.csv"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    // Opened once the program reads it, and written to until it does no more.
    let mut pipe = fs::OpenOptions::new().write(true).open(&endless).unwrap();
    let text = file(&Motion::sines(PerLeak::default()).rows(1000));
    pipe.write_all(text.as_bytes()).unwrap();
    let writer = std::thread::spawn(move || {
        let rows = text.split_once('\n').unwrap().1;
        while pipe.write_all(rows.as_bytes()).is_ok() {}
    });
    let temporary = || {
        let hidden = |entry: fs::DirEntry| entry.file_name().to_string_lossy().starts_with(".pitchleak-");
        fs::read_dir(farm.path()).unwrap().any(|entry| hidden(entry.unwrap()))
    };
    assert!(temporary());
    let asked = Instant::now();
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let status = child.wait().unwrap();
    writer.join().unwrap();
    assert!(asked.elapsed() < Duration::from_secs(10));
    assert_eq!(status.code(), Some(130));
    assert!(!temporary() && !farm.path().join("fleet.csv").exists());
}
