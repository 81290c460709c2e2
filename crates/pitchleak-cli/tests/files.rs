//! Files as loggers write them, many at once, and what the program says of them.

#![allow(clippy::unwrap_used)]

use pitchleak::core::PerLeak;
use pitchleak_testkit::Motion;
use pitchleak_testkit::trace_text::file;
use std::path::Path;
use std::process::{Command, Output};

fn pitchleak(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pitchleak")).args(arguments).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// 200 rows of `cells`, under `header`.
fn write(folder: &Path, name: &str, header: &str, cells: impl Fn(f64) -> String) {
    let rows: Vec<String> = (0..200).map(|i| cells(f64::from(i))).collect();
    std::fs::write(folder.join(name), format!("{header}\n{}\n", rows.join("\n"))).unwrap();
}

fn plain(i: f64) -> String {
    format!("{:.2},{:.4},{:.3},40.5,1.2,-0.9", 0.01 * i, 100.0 + i.sin(), 50.0 + i.cos())
}

fn european(i: f64) -> String {
    plain(i).replace(',', ";").replace('.', ",")
}

#[test]
fn a_european_file_is_read_and_said() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    let header =
        "sep=;\nTime [s];Position [mm];Pressure A [bar];Pressure B [bar];Flow A [L/min];Flow B [L/min]";
    write(folder.path(), "b.csv", header, european);
    let outputs = ["a.csv", "b.csv"].map(|name| pitchleak(&["replay", name, "--json"], folder.path()));
    let estimates = |output: &Output| {
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        (report["estimates"].clone(), report["verdict"]["status"].clone())
    };
    assert_eq!(estimates(&outputs[0]), estimates(&outputs[1]));
    assert_eq!(text(&outputs[0].stderr), "");
    let said = text(&outputs[1].stderr);
    assert!(
        said.starts_with("note: b.csv read with semicolon between cells, decimal comma, header in line 2"),
        "{said}"
    );
}

#[test]
fn many_traces_are_many_reports() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    write(folder.path(), "b.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    for command in ["replay", "check"] {
        let output = pitchleak(&[command, "a.csv", "b.csv", "--json"], folder.path());
        assert_eq!((output.status.code(), text(&output.stdout).lines().count()), (Some(0), 2), "{command}");
        let output = pitchleak(&[command, "a.csv", "none.csv", "b.csv"], folder.path());
        let said = text(&output.stderr);
        assert_eq!(
            (output.status.code(), text(&output.stdout).matches("a.csv").count()),
            (Some(2), 1),
            "{said}"
        );
        assert!(
            text(&output.stdout).contains("b.csv") && said.contains("1 of 3 traces could not be judged"),
            "{said}"
        );
    }
    let output = pitchleak(&["replay", "a.csv", "b.csv", "--out", "e.csv"], folder.path());
    assert!(
        output.status.code() == Some(2)
            && text(&output.stderr).contains("--out is of one trace: 2 are given")
    );
}

#[test]
fn columns_proposes_what_replay_then_reads() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "x.csv",
        "Counter,Stroke [mm],Head pressure [bar],Rod pressure [bar],Flow head [l/min],Flow rod [l/min]",
        plain,
    );
    let refused = pitchleak(&["replay", "x.csv"], folder.path());
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        text(&refused.stderr).contains("t = { name = \"Counter\", unit = \"s\" }"),
        "{}",
        text(&refused.stderr)
    );
    let shown = pitchleak(&["columns", "x.csv"], folder.path());
    assert!(
        text(&shown.stdout).contains("pa = { name = \"Head pressure [bar]\", unit = \"bar\" }"),
        "{}",
        text(&shown.stdout)
    );
    let json: serde_json::Value =
        serde_json::from_slice(&pitchleak(&["columns", "x.csv", "--json"], folder.path()).stdout).unwrap();
    let lines =
        json["proposals"].as_array().unwrap().iter().map(|line| line["line"].as_str().unwrap().to_owned());
    let rig =
        pitchleak::Rig::paper().to_toml() + "[columns]\n" + &lines.collect::<Vec<_>>().join("\n") + "\n";
    std::fs::write(folder.path().join("rig.toml"), rig).unwrap();
    let read = pitchleak(&["replay", "x.csv"], folder.path());
    assert_eq!(read.status.code(), Some(0), "{}", text(&read.stderr));
    assert!(text(&pitchleak(&["columns", "x.csv"], folder.path()).stdout).contains("It is read as it is."));
}

#[test]
fn estimates_are_written_as_parquet() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    let output = pitchleak(&["replay", "a.csv", "--out", "e.parquet"], folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let bytes = std::fs::read(folder.path().join("e.parquet")).unwrap();
    assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
    let columns = pitchleak(&["columns", "e.parquet"], folder.path());
    assert!(
        text(&columns.stderr).contains("estimates that `replay --out` wrote"),
        "{}",
        text(&columns.stderr)
    );
}

#[test]
fn manual_pages_are_of_the_program_and_its_commands() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, name) in [(vec!["man"], "pitchleak"), (vec!["man", "replay"], "pitchleak-replay")] {
        let page = text(&pitchleak(&arguments, folder.path()).stdout);
        assert!(page.contains(".TH") && page.contains(&name.replace('-', "\\-")), "{page}");
    }
    assert_eq!(pitchleak(&["man", "fly"], folder.path()).status.code(), Some(2));
}

/// What is given in a trace's place by mistake: as the program itself writes it.
#[test]
fn what_is_no_trace_says_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let run = |arguments: &str| {
        let output = pitchleak(&arguments.split(' ').collect::<Vec<_>>(), folder.path());
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", text(&output.stderr));
        output.stdout
    };
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/traces/rig.toml"), path("rig.toml"))
        .unwrap();
    run("simulate --wind 13 --duration 5s --out t.csv");
    run("replay t.csv --out estimates.csv --report report.html");
    run("replay t.csv --out estimates.parquet");
    run("fleet t.csv --out fleet.csv");
    run("fleet t.csv --out fleet.parquet");
    for (name, arguments) in [
        ("replay.json", "replay t.csv --json"),
        ("check.json", "check t.csv --json"),
        ("fleet.json", "fleet t.csv --json"),
        ("columns.json", "columns t.csv --json"),
    ] {
        std::fs::write(path(name), run(arguments)).unwrap();
    }
    std::fs::write(path("rigs.csv"), "trace,rig,cylinder\n*.csv,rig.toml,\n").unwrap();
    std::fs::write(path("samples.json"), "{\"t_s\": 0, \"x_mm\": 1}\n{\"t_s\": 0.01, \"x_mm\": 1}\n")
        .unwrap();
    std::fs::write(path("watch.json"), "{\"type\":\"estimate\",\"cylinder\":\"1\"}\n").unwrap();
    std::fs::write(path("page.html"), "<!DOCTYPE html>\n<HTML><body>a,b,c,d\n1,2,3,4\n").unwrap();
    std::fs::write(path("m.mf4"), [b"MDF     4.10    pitch\0\0".as_slice(), &[0; 200]].concat()).unwrap();
    let kinds = [
        ("m.mf4", "MDF, a measurement file"),
        ("rig.toml", "a rig file, not a trace: give it by `--rig FILE`"),
        ("t.json", "what is true of a simulated trace"),
        ("replay.json", "a result of pitchleak"),
        ("check.json", "a result of pitchleak"),
        ("fleet.json", "a result of pitchleak"),
        ("columns.json", "a result of pitchleak"),
        ("report.html", "a report of pitchleak for a browser"),
        ("estimates.csv", "estimates that `replay --out` wrote"),
        ("estimates.parquet", "estimates that `replay --out` wrote"),
        ("fleet.csv", "a table that `fleet --out` wrote"),
        ("fleet.parquet", "a table that `fleet --out` wrote"),
        ("rigs.csv", "a table of rig files"),
        ("watch.json", "what `pitchleak watch` wrote"),
        ("samples.json", "JSON, not a table"),
        ("page.html", "a page for a browser (HTML)"),
    ];
    for (name, said) in kinds {
        for command in ["replay", "columns"] {
            let output = pitchleak(&[command, name], folder.path());
            let error = text(&output.stderr);
            assert_eq!((output.status.code(), error.lines().count()), (Some(2), 1), "{command}: {error}");
            assert!(error.starts_with(&format!("error: {name}: {said}")), "{command}: {error}");
        }
    }
}

/// A logger may have any words above its table.
#[test]
fn a_trace_is_read_whatever_stands_above_it() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.csv", "[cylinder]\n7\nt_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    let output = pitchleak(&["replay", "a.csv"], folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

/// From an unknown logger's file to a verdict: `init`, then the number that `replay` names, until none is left.
#[test]
fn init_names_the_columns_and_replay_the_first_blank() {
    let folder = tempfile::tempdir().unwrap();
    let header =
        "Elapsed (s),Stroke [mm],Head pressure [bar],Rod pressure [bar],Flow head [l/min],Flow rod [l/min]";
    write(folder.path(), "x.csv", header, plain);
    let begun = pitchleak(&["init", "x.csv"], folder.path());
    assert_eq!(begun.status.code(), Some(0), "{}", text(&begun.stderr));
    assert!(text(&begun.stdout).starts_with("rig.toml written: 6 columns named."), "{}", text(&begun.stdout));
    let again = pitchleak(&["init", "x.csv"], folder.path());
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again.stderr).contains("rig.toml is there already"), "{}", text(&again.stderr));
    let path = folder.path().join("rig.toml");
    for key in [
        "cylinder.area_a",
        "cylinder.area_b",
        "cylinder.stroke",
        "cylinder.moving_mass",
        "fluid.bulk_modulus",
    ] {
        let refused = pitchleak(&["replay", "x.csv"], folder.path());
        let said = text(&refused.stderr);
        let rig = std::fs::read_to_string(&path).unwrap();
        let name = key.rsplit('.').next().unwrap();
        let (index, line) =
            rig.lines().enumerate().find(|(_, line)| line.starts_with(&format!("# {name} ="))).unwrap();
        assert!(
            said.starts_with(&format!("error: rig.toml:{}: `{key}` is still blank", index + 1)),
            "{said}"
        );
        assert_eq!((refused.status.code(), said.lines().count()), (Some(2), 1), "{said}");
        std::fs::write(&path, rig.replace(line, &line[2..])).unwrap();
    }
    let read = pitchleak(&["replay", "x.csv", "--json"], folder.path());
    assert_eq!(read.status.code(), Some(0), "{}", text(&read.stderr));
    // Every other blank is one that a rig file may have.
    let rig = std::fs::read_to_string(&path).unwrap().replace("\n# ", "\n");
    let rig = rig.split_once("[cylinder]").unwrap().1;
    assert!(rig.contains("\nforce = {"), "{rig}");
    std::fs::write(&path, format!("[cylinder]{rig}")).unwrap();
    let read = pitchleak(&["replay", "x.csv", "--json"], folder.path());
    assert_eq!(read.status.code(), Some(0), "{}", text(&read.stderr));
}

/// Parquet files have names that nobody of the program chose, too.
#[test]
fn init_looks_at_parquet() {
    let folder = tempfile::tempdir().unwrap();
    let parquet = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds/parquet/polars.parquet");
    let out = folder.path().join("new.toml");
    let begun = pitchleak(&["init", parquet.to_str().unwrap(), "-o", out.to_str().unwrap()], folder.path());
    assert_eq!(begun.status.code(), Some(0), "{}", text(&begun.stderr));
    let rig = std::fs::read_to_string(out).unwrap();
    assert!(rig.contains("pb = { name = \"Pressure B [bar]\", unit = \"bar\" }   # by its name"), "{rig}");
    assert!(rig.contains("# qb = {") && !rig.contains("# pa = {"), "{rig}");
}

/// `pitchleak logger.csv` is what a new user types first.
#[test]
fn a_trace_alone_is_replayed_and_quiet_says_results_only() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm,other", |i| plain(i) + ",1");
    let alone = pitchleak(&["a.csv", "--json"], folder.path());
    let named = pitchleak(&["replay", "a.csv", "--json"], folder.path());
    assert_eq!((alone.status.code(), &alone.stdout), (Some(0), &named.stdout));
    assert!(text(&alone.stderr).contains("columns ignored: other"), "{}", text(&alone.stderr));
    let quiet = pitchleak(&["a.csv", "--json", "-q"], folder.path());
    assert_eq!((&quiet.stdout, text(&quiet.stderr).as_str()), (&named.stdout, ""));
    // What is neither a command nor a file is a mistake of usage.
    assert_eq!(pitchleak(&["reply"], folder.path()).status.code(), Some(2));
    let missing = pitchleak(&["b.csv"], folder.path());
    assert_eq!(missing.status.code(), Some(2));
    assert!(text(&missing.stderr).starts_with("error: b.csv: "), "{}", text(&missing.stderr));
}

/// What stands in the way of a verdict is told first, with the one remedy, by `replay` and `check` alike.
#[test]
fn the_true_obstacle_is_told_first() {
    let folder = tempfile::tempdir().unwrap();
    let header = "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm";
    let row = |t_s: f64, i: f64| format!("{t_s:.2},{}", plain(i).split_once(',').unwrap().1);
    let seconds: Vec<String> =
        Motion::sines(PerLeak::default()).rows(20_000).into_iter().step_by(100).collect();
    std::fs::write(folder.path().join("once_a_second.csv"), file(&seconds)).unwrap();
    write(folder.path(), "shuffled.csv", header, |i| row((7919.0 * i) % 200.0 * 0.01, i));
    let cases = [
        ("once_a_second.csv", "not_sure", "Readings come every 1 s"),
        ("shuffled.csv", "doubtful", "They are not in the order of time: sort them by time"),
    ];
    for (name, status, words) in cases {
        for command in ["replay", "check"] {
            let output = pitchleak(&[command, name, "--json"], folder.path());
            let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!(report["verdict"]["status"], status, "{command} {name}");
            assert!(
                report["verdict"]["text"].as_str().unwrap().contains(words),
                "{command} {name}: {report}"
            );
        }
    }
}

/// `12:34,5`, as a spreadsheet writes it.
#[test]
fn minutes_and_tenths_of_seconds_are_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let time = |i: f64| format!("{:02}:{:04.1}", (i / 600.0).floor() + 58.0, (0.1 * i) % 60.0);
    let row = |i: f64| format!("{};{}", time(i), european(i).split_once(';').unwrap().1).replace('.', ",");
    write(folder.path(), "a.csv", "Time;x_mm;pa_bar;pb_bar;qa_lpm;qb_lpm", row);
    let output = pitchleak(&["replay", "a.csv", "--json"], folder.path());
    let report: serde_json::Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", text(&output.stderr)));
    assert_eq!(
        (report["trace"]["skipped"].as_u64(), report["trace"]["sample_rate_hz"].as_f64()),
        (Some(0), Some(10.0))
    );
}

#[test]
fn files_of_one_recording_are_one_trace() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "whole.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    let columns = |from: usize, to: usize| {
        move |i: f64| {
            let row = plain(i);
            let cells: Vec<_> = row.split(',').collect();
            format!("{},{}", cells[0], cells[from..to].join(","))
        }
    };
    write(folder.path(), "x_mm.csv", "t_s,value", columns(1, 2));
    write(folder.path(), "pressures.csv", "t_s,pa_bar,pb_bar", columns(2, 4));
    write(folder.path(), "flows.csv", "t_s,qa_lpm,qb_lpm", columns(4, 6));
    let report = |arguments: &[&str]| -> serde_json::Value {
        serde_json::from_slice(&pitchleak(arguments, folder.path()).stdout).unwrap()
    };
    let joined = report(&["replay", "--join", "x_mm.csv", "pressures.csv", "flows.csv", "--json"]);
    let whole = report(&["replay", "whole.csv", "--json"]);
    assert_eq!(joined["estimates"], whole["estimates"]);
    assert_eq!(joined["trace"]["path"], "x_mm.csv + pressures.csv + flows.csv");
    let apart = pitchleak(&["replay", "--join", "x_mm.csv", "flows.csv"], folder.path());
    let said = text(&apart.stderr);
    assert!(
        said.starts_with("error: the files together: no column for pressure A") && said.lines().count() == 1,
        "{said}"
    );
}

/// Each mistake is one line that says what is allowed.
#[test]
fn a_leak_is_put_into_a_file_with_flows() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    let without = |i: f64| plain(i).rsplitn(3, ',').last().unwrap().to_owned();
    write(folder.path(), "no_flows.csv", "t_s,x_mm,pa_bar,pb_bar", without);
    let cases: [(&[&str], &str); 5] = [
        (&["prove", "-"], "standard input is read once"),
        (&["prove", "no_flows.csv"], "no flow is measured"),
        (&["prove", "a.csv", "--leak-internal", "0.3"], "a flow needs its unit, e.g. \"0.3 L/min\""),
        (&["prove", "a.csv", "--leak-external-a", "0 L/min"], "more than none"),
        (&["prove", "a.csv", "--report", "a.csv"], "a report is written as .html"),
    ];
    for (arguments, words) in cases {
        let output = pitchleak(arguments, folder.path());
        let said = text(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains(words), "{arguments:?}: {said}");
    }
    let output = pitchleak(
        &["prove", "a.csv", "--leak-internal", "0.5 L/min", "--json", "--report", "p.html"],
        folder.path(),
    );
    let proof: serde_json::Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", text(&output.stderr)));
    assert_eq!(
        (proof["schema"].as_str(), proof["cases"].as_array().unwrap().len()),
        (Some("pitchleak.prove/1"), 1)
    );
    let page = std::fs::read_to_string(folder.path().join("p.html")).unwrap();
    assert!(page.contains("Internal leak, 0.5 L/min put in"));
}

/// Who gives no rig file is judged on the paper's cylinder where the trace is one of it, and told to give one where it isn't. Who
/// gives no sensors is told whose are supposed.
#[test]
fn what_nobody_declared_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("own.csv");
    let own = ["simulate", "--wind", "13", "--noise", "rig", "--out", out.to_str().unwrap()];
    assert!(pitchleak(&own, folder.path()).status.success());
    let verdict = |arguments: &[&str]| -> serde_json::Value {
        let output = pitchleak(arguments, folder.path());
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()["verdict"].clone()
    };
    assert_eq!(verdict(&["replay", "own.csv", "--json"])["status"], "sound");
    // A cylinder of twice the area: twice the flow for the same travel.
    let text = std::fs::read_to_string(&out).unwrap();
    let doubled = text.lines().enumerate().map(|(at, line)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        for cell in cells[4..6].iter_mut().filter(|_| at > 0) {
            *cell = format!("{:.6}", 2.0 * cell.parse::<f64>().unwrap());
        }
        cells.join(",") + "\n"
    });
    std::fs::write(folder.path().join("other.csv"), doubled.collect::<String>()).unwrap();
    for command in ["replay", "check"] {
        let told = verdict(&[command, "other.csv", "--json"]);
        assert!(!["leak", "sound"].contains(&told["status"].as_str().unwrap()), "{told}");
    }
    let rig = include_str!("../../../data/traces/rig.toml").split("[sensors]").next().unwrap();
    std::fs::write(folder.path().join("bare.toml"), rig).unwrap();
    let told = verdict(&["replay", "own.csv", "--rig", "bare.toml", "--json"]);
    assert!(
        told["text"].as_str().unwrap().ends_with("has no [sensors]: meters as the paper's are supposed."),
        "{told}"
    );
}
