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
fn a_bad_file_is_told_and_the_others_are_judged() {
    let farm = farm();
    fs::write(farm.path().join("B1/broken.csv"), "a,b\n1,2\n").unwrap();
    let done = fleet(farm.path(), &["*/*.csv", "--out", "fleet.parquet"]);
    assert_eq!(done.status.code(), Some(2));
    let complaints = String::from_utf8(done.stderr).unwrap();
    assert!(complaints.starts_with("error: B1/broken.csv: no column for"), "{complaints}");
    assert!(complaints.ends_with("error: 1 of 3 traces could not be judged\n"), "{complaints}");
    let text = String::from_utf8(done.stdout).unwrap();
    assert!(text.starts_with("3 traces of 3 cylinders: 1 leak, 1 sound,"), "{text}");
    assert!(fs::read(farm.path().join("fleet.parquet")).unwrap().starts_with(b"PAR1"));
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
