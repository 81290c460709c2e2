//! The program from outside: exit status, standard output, standard error.

#![allow(clippy::unwrap_used)]

use pitchleak::core::PerLeak;
use pitchleak_testkit::Motion;
use pitchleak_testkit::rig::PAPER;
use pitchleak_testkit::trace_text::{HEADER, file};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

const INTERNAL: f64 = 1.2e-11;

/// The first `count` rows of a trace of the paper's cylinder with an internal leak.
fn rows(count: u32) -> Vec<String> {
    Motion::sines(PerLeak { internal: INTERNAL, external_a: 0.0, external_b: 0.0 }).rows(count)
}

struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Self {
        Self { folder: TempDir::new().unwrap() }
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.folder.path().join(name);
        fs::write(&path, content).unwrap();
        path
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

fn pitchleak() -> Command {
    Command::new(env!("CARGO_BIN_EXE_pitchleak"))
}

fn replay(trace: &Path, more: &[&str]) -> Output {
    pitchleak().arg("replay").arg(trace).args(more).output().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// The report of a run that must succeed, with every number in it finite.
fn json(output: &Output) -> serde_json::Value {
    assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
    assert!(!stdout(output).contains("NaN") && !stdout(output).contains("inf"));
    serde_json::from_str(&stdout(output)).unwrap()
}

/// Exit status 2, nothing on standard output, and one line that has all of `words`.
fn assert_refused(output: &Output, words: &[&str]) {
    let error = stderr(output);
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(output.stdout.is_empty());
    assert_eq!(error.lines().count(), 1, "{error}");
    for word in words {
        assert!(error.contains(word), "{error} lacks {word}");
    }
}

#[test]
fn replay_finds_the_leak_and_says_so() {
    let place = Place::new();
    let trace = place.write("trace.csv", file(&rows(3000)));
    let text = replay(&trace, &[]);
    assert_eq!(text.status.code(), Some(0), "{}", stderr(&text));
    assert!(stdout(&text).starts_with("LEAK  Internal leak of "), "{}", stdout(&text));
    assert!(stdout(&text).contains("wu2011, built in"));
    assert!(!stdout(&text).contains('\x1b'), "no colours off a terminal");
    assert!(text.stderr.is_empty(), "{}", stderr(&text));

    let report = json(&replay(&trace, &["--json"]));
    let found = report["estimates"]["internal_leak_coefficient"]["value"].as_f64().unwrap();
    assert!((found / INTERNAL - 1.0).abs() < 3e-3, "{found}");
    assert_eq!(report["verdict"]["faults"], serde_json::json!(["internal"]));
    assert_eq!(report["trace"]["samples"], 3000);

    assert_eq!(replay(&trace, &["--fail-on-fault"]).status.code(), Some(1));
}

/// Flows exchanged in the header: nothing is believed, the wires are named, and those who ask learn it by the status.
#[test]
fn doubt_is_said_and_ends_with_a_status_for_those_who_ask() {
    let place = Place::new();
    let honest = file(&rows(3000));
    let right = place.write("right.csv", &honest);
    assert_eq!(replay(&right, &["--fail-on-doubt"]).status.code(), Some(0));
    let exchanged = honest.replacen("qa_", "q?_", 1).replacen("qb_", "qa_", 1).replacen("q?_", "qb_", 1);
    let wrong = place.write("wrong.csv", exchanged);
    let output = replay(&wrong, &["--fail-on-doubt"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stdout(&output).starts_with("DOUBTFUL  "), "{}", stdout(&output));
    let report = json(&replay(&wrong, &["--json"]));
    assert_eq!(report["verdict"]["status"], "doubtful");
    assert_eq!(report["verdict"]["reasons"][0]["id"], "wiring");
}

/// README shows the report that its first command prints.
#[test]
fn the_readme_shows_what_is_printed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let readme = fs::read_to_string(root.join("README.md")).unwrap();
    let shown = readme.split("```text output\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let command = ["replay", "data/traces/external_a.csv.gz"];
    assert!(readme.contains(&command.join(" ")));
    assert_eq!(stdout(&pitchleak().current_dir(&root).args(command).output().unwrap()), shown);
}

#[test]
fn the_paper_law_runs_too() {
    let place = Place::new();
    let trace = place.write("trace.csv", file(&rows(2000)));
    let report = json(&replay(&trace, &["--json", "--estimator", "paper"]));
    assert_eq!(report["estimator"], "paper");
    assert_eq!(report["estimates"]["internal_leak_coefficient"]["std"], serde_json::Value::Null);
}

#[test]
fn standard_input_and_gzip_give_the_same_report() {
    let place = Place::new();
    let text = file(&rows(500));
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(text.as_bytes()).unwrap();
    let packed = place.write("trace.csv.gz", encoder.finish().unwrap());
    let from_file = json(&replay(&packed, &["--json"]));

    let mut child = pitchleak()
        .args(["replay", "-", "--json"])
        .current_dir(place.folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    let from_stdin = json(&child.wait_with_output().unwrap());
    assert_eq!(from_stdin["trace"]["path"], "standard input");
    assert_eq!(from_stdin["estimates"], from_file["estimates"]);
}

#[test]
fn unusable_traces_are_refused_in_one_line() {
    let place = Place::new();
    let good = file(&rows(50));
    let cases: [(&str, String, &[&str]); 9] = [
        ("empty", String::new(), &["the trace is empty"]),
        ("header only", format!("{HEADER}\n"), &["no usable row", "only a header"]),
        ("missing column", good.replace("pb_pa", "other"), &["no column for pressure B", "pb_pa or pb_kpa"]),
        ("doubled column", good.replace("v_mps", "x_mm"), &["`x_m` and `x_mm`", "keep one"]),
        ("unknown unit", good.replace("pa_pa", "pa_atm"), &["unknown unit `atm`", "pa, kpa, mpa, bar, psi"]),
        ("all words", good.replace("0.", "o."), &["no usable row", "line 2", "is not a number"]),
        ("all outside", good.replace(",0.1", ",7.1"), &["no usable row", "outside the stroke"]),
        ("binary", "\u{0}\u{1}\u{2}".to_owned(), &["not a CSV file"]),
        ("parquet", "PAR1....".to_owned(), &["Parquet"]),
    ];
    for (name, content, words) in cases {
        let trace = place.write(&format!("{name}.csv"), content);
        assert_refused(&replay(&trace, &[]), words);
        assert_refused(&replay(&trace, &["--json"]), words);
        let checked = pitchleak().arg("check").arg(&trace).output().unwrap();
        assert_refused(&checked, words);
    }
    assert_refused(&replay(&place.path("nothing.csv"), &[]), &["nothing.csv", "No such file"]);
    // Not the place itself: beside it may lie a rig file of somebody else.
    let folder = place.path("folder");
    fs::create_dir(&folder).unwrap();
    assert_refused(&replay(&folder, &[]), &["a folder, not a trace"]);
}

#[test]
fn bad_rows_are_skipped_counted_and_said_and_fatal_when_strict() {
    let place = Place::new();
    type Spoil<'a> = (&'a str, &'a dyn Fn(&mut Vec<String>), &'a str);
    let spoil: [Spoil; 8] = [
        ("word", &|rows| rows[700] = rows[700].replacen("7.00", "seven", 1), "line 702, column `t_s`"),
        ("nan", &|rows| rows[700] = "7.00,NaN,0,5e6,3e6,0,0".to_owned(), "column `x_m`: not a finite number"),
        ("no time", &|rows| rows[700] = ",0.1,0,5e6,3e6,0,0".to_owned(), "column `t_s`: empty"),
        ("short", &|rows| rows[700] = "7.00,0.1".to_owned(), "2 cells, 7 expected"),
        ("long", &|rows| rows[700].push_str(",1,2"), "9 cells, 7 expected"),
        ("outside", &|rows| rows[700] = "7.00,0.35,0,5e6,3e6,0,0".to_owned(), "0.35 m is outside the stroke"),
        ("back", &|rows| rows.swap(700, 701), "is not after"),
        ("again", &|rows| rows[700] = rows[699].clone(), "6.99 s is not after 6.99 s"),
    ];
    for (name, spoil, words) in spoil {
        let mut rows = rows(3000);
        spoil(&mut rows);
        let trace = place.write("trace.csv", file(&rows));
        let output = replay(&trace, &["--json"]);
        let report = json(&output);
        assert_eq!(
            (&report["trace"]["skipped"], &report["trace"]["samples"]),
            (&1.into(), &2999.into()),
            "{name}"
        );
        assert!(stderr(&output).contains(words), "{name}: {}", stderr(&output));
        let found = report["estimates"]["internal_leak_coefficient"]["value"].as_f64().unwrap();
        assert!((found / INTERNAL - 1.0).abs() < 3e-3, "{name}: {found}");
        assert_refused(&replay(&trace, &["--strict"]), &["trace.csv: line 70"]);
    }
}

#[test]
fn gaps_are_said_and_do_no_harm() {
    let place = Place::new();
    let mut rows = rows(4000);
    rows.drain(1500..2000);
    let trace = place.write("trace.csv", file(&rows));
    let output = replay(&trace, &["--json"]);
    let report = json(&output);
    assert_eq!(report["trace"]["gaps"], 1);
    assert!(stderr(&output).contains("1 gap in time, 5.010 s"), "{}", stderr(&output));
    let found = report["estimates"]["internal_leak_coefficient"]["value"].as_f64().unwrap();
    assert!((found / INTERNAL - 1.0).abs() < 3e-3, "{found}");
}

#[test]
fn a_constant_trace_gives_no_leak_that_it_cannot_show() {
    let place = Place::new();
    let rows: Vec<_> = (0..2000).map(|i| format!("{:.2},0.1,0,0,0,0,0", f64::from(i) * 0.01)).collect();
    let trace = place.write("trace.csv", file(&rows));
    let report = json(&replay(&trace, &["--json"]));
    assert_eq!(report["verdict"]["faults"], serde_json::json!([]));
    for parameter in ["internal_leak_coefficient", "external_leak_a_coefficient", "bulk_modulus"] {
        assert_eq!(report["estimates"][parameter]["identifiable"], false, "{parameter}");
    }
    let text = stdout(&replay(&trace, &[]));
    assert!(text.starts_with("NOT SURE"), "{text}");
}

#[test]
fn a_truncated_gzip_is_used_as_far_as_it_goes() {
    let place = Place::new();
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(file(&rows(6000)).as_bytes()).unwrap();
    let whole = encoder.finish().unwrap();
    let trace = place.write("trace.csv.gz", &whole[..whole.len() / 2]);
    let output = replay(&trace, &["--json"]);
    assert!(json(&output)["trace"]["samples"].as_u64().unwrap() > 1000);
    assert!(stderr(&output).contains("the gzip stream breaks off in line"), "{}", stderr(&output));
    assert_refused(&replay(&trace, &["--strict"]), &["breaks off"]);
    assert_refused(&replay(&place.write("stub.csv.gz", &whole[..12]), &[]), &["stub.csv.gz"]);
}

#[test]
fn bom_and_crlf_change_nothing() {
    let place = Place::new();
    let text = file(&rows(500));
    let plain = json(&replay(&place.write("a.csv", &text), &["--json"]));
    let windows = format!("\u{feff}{}", text.replace('\n', "\r\n"));
    let windows = json(&replay(&place.write("b.csv", windows), &["--json"]));
    assert_eq!(plain["estimates"], windows["estimates"]);
}

#[test]
fn the_rig_beside_the_trace_is_used_and_named() {
    let place = Place::new();
    let trace = place.write("trace.csv", file(&rows(500)));
    let rig = place.write("rig.toml", PAPER);
    let beside = json(&replay(&trace, &["--json"]));
    assert_eq!(beside["rig"], rig.display().to_string());
    let named = place.write("other.toml", PAPER);
    let named = named.display().to_string();
    assert_eq!(json(&replay(&trace, &["--json", "--rig", &named]))["rig"], named);
}

#[test]
fn bad_rig_files_are_refused_in_one_line() {
    let place = Place::new();
    let trace = place.write("trace.csv", file(&rows(50)));
    let cases: [(&str, String, &[&str]); 6] = [
        (
            "unknown key",
            PAPER.replace("stroke", "strok"),
            &["rig.toml:4", "`cylinder.strok`", "allowed here: area_a"],
        ),
        ("wrong unit", PAPER.replace("9.4 cm^2", "9.4 bar"), &["rig.toml:3", "`bar`", "m^2, cm^2, mm^2"]),
        (
            "impossible",
            PAPER.replace("0.2 m", "-0.2 m"),
            &["rig.toml:4", "cylinder.stroke", "from 0.001 to 100 m"],
        ),
        ("missing", PAPER.split("[fluid]").next().unwrap().to_owned(), &["missing key `fluid.bulk_modulus`"]),
        ("no TOML", "area: 3".to_owned(), &["rig.toml:1", "not a TOML file"]),
        ("no text", "\u{0}".to_owned(), &["rig.toml"]),
    ];
    for (name, content, words) in cases {
        place.write("rig.toml", content);
        assert_refused(&replay(&trace, &[]), words);
        let _ = name;
    }
    assert_refused(&replay(&trace, &["--rig", "nothing.toml"]), &["nothing.toml", "No such file"]);
}

#[test]
fn estimates_are_written_over_time() {
    let place = Place::new();
    let trace = place.write("trace.csv", file(&rows(1000)));
    let out = place.path("estimates.csv");
    let output = replay(&trace, &["--out", &out.display().to_string()]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let written = fs::read_to_string(&out).unwrap();
    assert_eq!(written.lines().count(), 1001);
    let width = written.lines().next().unwrap().split(',').count();
    let last: Vec<f64> =
        written.lines().last().unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert_eq!(last.len(), width);
    assert!((last[1] / INTERNAL - 1.0).abs() < 3e-3);
    let refused = place.path("estimates.xlsx").display().to_string();
    assert_refused(&replay(&trace, &["--out", &refused]), &["estimates.xlsx", ".csv, .csv.gz or .parquet"]);
}

#[test]
fn check_says_what_the_trace_can_show() {
    let place = Place::new();
    let trace = place.write("trace.csv", file(&rows(3000)));
    let output = pitchleak().arg("check").arg(&trace).output().unwrap();
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(text.contains("3000 samples over 30.0 s at 100 Hz, 0 rows skipped, 0 gaps"), "{text}");
    let checked = pitchleak().arg("check").arg(&trace).arg("--json").output().unwrap();
    let report = json(&checked);
    assert_eq!(report["schema"], "pitchleak.check/1");
    assert_eq!(report["leaks"]["internal"]["identifiable"], true);
}

#[test]
fn usage_errors_and_help_have_their_status() {
    for arguments in [&["replay"][..], &["nonsense"], &["replay", "a", "--estimator", "magic"], &[]] {
        assert_eq!(pitchleak().args(arguments).output().unwrap().status.code(), Some(2), "{arguments:?}");
    }
    for arguments in [&["--help"][..], &["replay", "--help"], &["--version"], &["completions", "bash"]] {
        let output = pitchleak().args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
        assert!(!output.stdout.is_empty());
    }
}

#[test]
fn examples_in_help_have_the_options_that_help_lists() {
    let help = |command: &str| stdout(&pitchleak().args([command, "--help"]).output().unwrap());
    let mut examples = 0;
    for command in ["replay", "diagnose", "check", "prove", "calibrate", "fleet", "watch", "simulate"] {
        for part in help(command).lines().flat_map(|line| line.split(['|', '#'])) {
            let Some((_, example)) = part.split_once("pitchleak ") else { continue };
            let mut words = example.split_whitespace();
            let told = help(words.next().unwrap_or_default());
            let listed = told.lines().take_while(|line| !line.starts_with("Example"));
            let listed: Vec<_> = listed.filter(|line| line.trim_start().starts_with('-')).collect();
            for option in words.filter(|word| word.starts_with("--")) {
                let is_listed = listed.iter().any(|line| line.split_whitespace().any(|word| word == option));
                assert!(is_listed, "{command}: {option}");
                examples += 1;
            }
        }
    }
    assert!(examples > 10, "{examples}");
}

#[test]
fn a_reader_that_leaves_early_is_no_error() {
    let mut child = pitchleak()
        .args(["completions", "zsh"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.stderr.is_empty(), "{}", stderr(&output));
    assert_eq!(output.status.code(), Some(0));
}

/// However rare an explanation is, its share is not none.
#[test]
fn shares_of_explanations_are_told_with_digits_that_count() {
    let told = Command::new(env!("CARGO_BIN_EXE_pitchleak")).arg("explanations").output().unwrap();
    let told = String::from_utf8(told.stdout).unwrap();
    let shares =
        told.lines().skip(1).map(|line| line.split_whitespace().nth(2).unwrap().parse::<f64>().unwrap());
    assert!(shares.clone().count() > 50);
    assert!(shares.clone().all(|share| share > 0.0), "{told}");
}
