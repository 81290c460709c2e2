//! `pitchleak watch` from outside: the numbers of `replay`, in every format, interrupted or not.

#![allow(clippy::unwrap_used)]

use flate2::read::GzDecoder;
use serde_json::Value;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_pitchleak");

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data")
}

/// Every trace of `data` with its rig, if it has one.
fn traces() -> Vec<(PathBuf, Option<PathBuf>)> {
    let rig = data().join("traces/rig.toml");
    let folder = |name: &str, rig: Option<PathBuf>| {
        let files = std::fs::read_dir(data().join(name)).unwrap().map(|entry| entry.unwrap().path());
        let traces = files.filter(|path| path.to_string_lossy().ends_with(".csv.gz"));
        traces.map(|path| (path, rig.clone())).collect::<Vec<_>>()
    };
    let found = [folder("traces", Some(rig)), folder("hopsan", None)].concat();
    assert!(found.len() >= 8);
    found
}

fn text(trace: &Path) -> String {
    let mut text = String::new();
    GzDecoder::new(std::fs::File::open(trace).unwrap()).read_to_string(&mut text).unwrap();
    text
}

fn watch(arguments: &[&str], rig: Option<&Path>) -> Command {
    let mut command = Command::new(PROGRAM);
    command.arg("watch").args(arguments);
    if let Some(rig) = rig {
        command.arg("--rig").arg(rig);
    }
    command
}

fn spawn(command: &mut Command) -> Child {
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::inherit()).spawn().unwrap()
}

/// Feeds `input`; gives what comes out.
fn feed(command: &mut Command, input: String) -> Vec<Value> {
    let mut child = spawn(command);
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stdout)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

fn of_kind<'a>(events: &'a [Value], kind: &'a str) -> impl Iterator<Item = &'a Value> {
    events.iter().filter(move |event| event["type"] == kind)
}

/// The rows as JSON, each for the cylinders named.
fn ndjson(csv: &str, cylinders: &[&str]) -> String {
    let mut lines = csv.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').collect();
    let mut text = String::new();
    for line in lines {
        let cells = names.iter().zip(line.split(',')).filter(|(_, cell)| !cell.is_empty());
        let members: Vec<_> = cells.map(|(name, cell)| format!("\"{name}\": {cell}")).collect();
        for cylinder in cylinders {
            writeln!(text, "{{\"cylinder\": \"{cylinder}\", {}}}", members.join(", ")).unwrap();
        }
    }
    text
}

fn influx(csv: &str) -> String {
    let mut lines = csv.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').collect();
    let mut text = String::new();
    for line in lines {
        let cells = names.iter().zip(line.split(',')).filter(|(_, cell)| !cell.is_empty());
        let fields: Vec<_> = cells.map(|(name, cell)| format!("{name}={cell}")).collect();
        writeln!(text, "pitch,cylinder=T7/B2 {}", fields.join(",")).unwrap();
    }
    text
}

fn replayed(trace: &Path, rig: Option<&Path>) -> Value {
    let mut command = Command::new(PROGRAM);
    command.args(["replay", "--json"]).arg(trace);
    if let Some(rig) = rig {
        command.arg("--rig").arg(rig);
    }
    let output = command.output().unwrap();
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Every number of the last estimate, and the alarms, are those of the replay.
fn assert_replayed(events: &[Value], replay: &Value) {
    let last = of_kind(events, "estimate").last().unwrap();
    for leak in ["internal", "external_a", "external_b"] {
        for key in ["mean_lpm", "std_lpm"] {
            assert_eq!(last["leakage"][leak][key], replay["leakage"][leak][key], "{leak} {key}");
        }
    }
    assert_eq!(last["status"], replay["verdict"]["status"]);
    assert_eq!(last["faults"], replay["verdict"]["faults"]);
    assert_eq!(last["trend"], replay["trend"]);
    let alarms: Vec<_> =
        of_kind(events, "alarm").map(|alarm| [&alarm["t_s"], &alarm["fault"], &alarm["state"]]).collect();
    let expected = replay["alarms"].as_array().unwrap();
    let expected: Vec<_> =
        expected.iter().map(|alarm| [&alarm["time_s"], &alarm["fault"], &alarm["state"]]).collect();
    assert_eq!(alarms, expected);
}

#[test]
fn the_numbers_are_those_of_replay_on_every_trace() {
    for (trace, rig) in traces() {
        let csv = text(&trace);
        // Beside the trace there is no rig for a replay of its own choice.
        let rig = rig.unwrap_or_else(|| data().join("traces/rig.toml"));
        let replay = replayed(&trace, Some(&rig));
        assert_replayed(&feed(&mut watch(&[], Some(&rig)), csv.clone()), &replay);
        assert_replayed(&feed(&mut watch(&[], Some(&rig)), ndjson(&csv, &["T7/B2"])), &replay);
        assert_replayed(&feed(&mut watch(&[], Some(&rig)), influx(&csv)), &replay);
    }
}

#[test]
fn cylinders_do_not_mix() {
    let (trace, rig) = (data().join("traces/both.csv.gz"), data().join("traces/rig.toml"));
    let events = feed(&mut watch(&[], Some(&rig)), ndjson(&text(&trace), &["T7/B1", "T7/B2"]));
    let replay = replayed(&trace, Some(&rig));
    for name in ["T7/B1", "T7/B2"] {
        let own: Vec<_> = events.iter().filter(|event| event["cylinder"] == name).cloned().collect();
        assert_replayed(&own, &replay);
        // One estimate a second, and the last.
        assert_eq!(of_kind(&own, "estimate").count(), 40);
    }
}

#[test]
fn an_interrupted_run_says_what_one_run_says() {
    let rig = data().join("traces/rig.toml");
    let input = ndjson(&text(&data().join("traces/both.csv.gz")), &["T7/B2"]);
    let whole = feed(&mut watch(&[], Some(&rig)), input.clone());
    let lines: Vec<_> = input.split_inclusive('\n').collect();
    for at in [1, 777, 2049, 3999] {
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("state");
        let arguments = ["--state", state.to_str().unwrap()];
        let mut parts = Vec::new();
        for part in [&lines[..at], &lines[at..]] {
            let events = feed(&mut watch(&arguments, Some(&rig)), part.concat());
            // The last estimate of a run tells of its end; in the one run nothing is said then.
            parts.extend(events.into_iter().filter(|event| is_said(event, &whole)));
        }
        assert_eq!(parts, whole, "interrupted after {at}");
    }
}

fn is_said(event: &Value, whole: &[Value]) -> bool {
    whole.iter().any(|other| other["type"] == event["type"] && other["t_s"] == event["t_s"])
}

#[test]
fn a_signal_ends_it_with_its_state_saved() {
    let rig = data().join("traces/rig.toml");
    let input = ndjson(&text(&data().join("traces/both.csv.gz")), &["T7/B2"]);
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--state", folder.path().to_str().unwrap()];
    let mut child = spawn(&mut watch(&arguments, Some(&rig)));
    let mut stdin = child.stdin.take().unwrap();
    let mut stdout = BufReader::new(child.stdout.take().unwrap()).lines();
    let (first, rest) = input.split_at(input.match_indices('\n').nth(1999).unwrap().0 + 1);
    stdin.write_all(first.as_bytes()).unwrap();
    // An estimate is there while the input stays open: nothing waits for its end.
    let mut last = String::new();
    while !last.contains("\"t_s\":19.0,") {
        last = stdout.next().unwrap().unwrap();
    }
    Command::new("kill").arg(child.id().to_string()).status().unwrap();
    assert!(child.wait().unwrap().success());
    drop(stdin);
    let events = feed(&mut watch(&arguments, Some(&rig)), rest.to_owned());
    let whole = feed(&mut watch(&[], Some(&rig)), input);
    assert_eq!(of_kind(&events, "estimate").last(), of_kind(&whole, "estimate").last());
}

/// A source that says much and then nothing.
#[test]
fn what_came_before_a_silence_is_in_a_checkpoint_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = spawn(&mut watch(&["--state", folder.path().to_str().unwrap()], None));
    let mut stdin = child.stdin.take().unwrap();
    let input = ndjson(&text(&data().join("traces/both.csv.gz")), &["T7/B2"]);
    stdin.write_all(input.as_bytes()).unwrap();
    let begun = Instant::now();
    while !folder.path().join("cylinders/T7%2FB2.state").exists() {
        assert!(begun.elapsed() < Duration::from_secs(30), "no checkpoint");
        std::thread::sleep(Duration::from_millis(100));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn what_is_of_no_use_is_counted() {
    let good = r#"{"t_s": T, "x_mm": 100, "pa_bar": 50, "pb_bar": 40, "qa_lpm": 0, "qb_lpm": 0}"#;
    let mut input = String::new();
    for k in 0..200 {
        writeln!(input, "{}", good.replace('T', &format!("{}", f64::from(k) * 0.01))).unwrap();
        writeln!(input, "{}", good.replace('T', &format!("{}", f64::from(k) * 0.01))).unwrap();
        input.push_str("{\"t_s\": 1, \n[[[[\n{\"cylinder\": \"n\", \"t_s\": 1}\n");
        writeln!(input, "{}", good.replace("50", "5e9").replace('T', "99")).unwrap();
    }
    let events = feed(&mut watch(&[], None), input);
    let count = |kind: &str| -> u64 {
        of_kind(&events, "notice")
            .filter(|event| event["kind"] == kind)
            .map(|event| event["count"].as_u64().unwrap())
            .sum()
    };
    assert_eq!(
        [count("late"), count("unreadable"), count("columns"), count("out_of_range")],
        [200, 400, 200, 200]
    );
    assert!(events.len() < 20, "{events:?}");
}

#[test]
fn a_damaged_state_is_told_and_the_one_before_is_used() {
    let rig = data().join("traces/rig.toml");
    let csv = text(&data().join("traces/both.csv.gz"));
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--state", folder.path().to_str().unwrap()];
    let (first, second) = csv.split_at(csv.match_indices('\n').nth(2000).unwrap().0 + 1);
    let header = csv.split_inclusive('\n').next().unwrap();
    let first = feed(&mut watch(&arguments, Some(&rig)), first.to_owned());
    feed(&mut watch(&arguments, Some(&rig)), header.to_owned() + second);
    // Of a cylinder without a name.
    let newest = folder.path().join("cylinders/.state");
    let mut bytes = std::fs::read(&newest).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&newest, &bytes).unwrap();
    let output = watch(&arguments, Some(&rig)).stdin(Stdio::null()).output().unwrap();
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("damaged"));
    let notice: Value =
        serde_json::from_slice(output.stdout.split(|byte| *byte == b'\n').next().unwrap()).unwrap();
    assert_eq!([&notice["type"], &notice["kind"]], ["notice", "checkpoint"]);
    assert!(first.len() > 20);
    // It did not take the place of the good one.
    let before = folder.path().join("cylinders/.state.before");
    let output = watch(&arguments, Some(&rig)).stdin(Stdio::null()).output().unwrap();
    assert!(String::from_utf8_lossy(&output.stdout).contains("missing: the one before is used"));
    // Of the other rig it begins anew; what there was is put aside.
    let state = std::fs::read(&before).unwrap();
    let output = watch(&arguments, None).stdin(Stdio::null()).output().unwrap();
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stdout).contains("begins anew"));
    assert_eq!(std::fs::read(folder.path().join("cylinders/.state.aside")).unwrap(), state);
}

/// Ten seconds that are sent again, as by a feed that does not know what came.
#[test]
fn what_is_sent_again_after_a_restart_changes_nothing() {
    let rig = data().join("traces/rig.toml");
    let input = ndjson(&text(&data().join("traces/both.csv.gz")), &["T7/B2"]);
    let lines: Vec<_> = input.split_inclusive('\n').collect();
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--state", folder.path().to_str().unwrap()];
    feed(&mut watch(&arguments, Some(&rig)), lines[..2000].concat());
    let events = feed(&mut watch(&arguments, Some(&rig)), lines[1000..].concat());
    let late = of_kind(&events, "notice").filter(|notice| notice["kind"] == "late");
    assert_eq!(late.map(|notice| notice["count"].as_u64().unwrap()).sum::<u64>(), 1000);
    let whole = feed(&mut watch(&[], Some(&rig)), input.clone());
    assert_eq!(of_kind(&events, "estimate").last(), of_kind(&whole, "estimate").last());
}

/// Both would spoil the state, and the older one would win.
#[test]
fn a_state_has_one_watch() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--state", folder.path().to_str().unwrap()];
    let mut first = spawn(&mut watch(&arguments, None));
    while !folder.path().join("cylinders").exists() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let second = watch(&arguments, None).stdin(Stdio::null()).output().unwrap();
    assert_eq!(second.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&second.stderr).contains("another process"));
    drop(first.stdin.take());
    assert!(first.wait().unwrap().success());
}

/// Puts what a configuration names under a folder of the test.
fn placed(text: &str, folder: &Path) -> String {
    let packaging = data().join("../packaging");
    std::fs::copy(packaging.join("watch.toml"), folder.join("watch.toml")).unwrap();
    std::fs::copy(data().join("traces/rig.toml"), folder.join("rig.toml")).unwrap();
    let folder = folder.to_str().unwrap();
    let program = Path::new(PROGRAM).parent().unwrap().to_str().unwrap();
    text.replace("/etc/pitchleak", folder)
        .replace("/var/lib/pitchleak", &format!("{folder}/state"))
        .replace("/run/pitchleak", folder)
        .replace("pitchleak watch", &format!("{program}/pitchleak watch"))
}

#[test]
fn the_shell_pipe_takes_samples_in_and_gives_events_out() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let script = std::fs::read_to_string(data().join("../packaging/watch.sh")).unwrap();
    std::fs::write(at("watch.sh"), placed(&script, folder.path())).unwrap();
    let input = ndjson(&text(&data().join("traces/both.csv.gz")), &["T7/B2"]);
    std::fs::write(at("samples"), input).unwrap();
    let mut pipe = Command::new("sh");
    pipe.arg(at("watch.sh")).env("SOURCE", format!("cat {}", at("samples"))).env("SINK", "cat");
    let replay = replayed(&data().join("traces/both.csv.gz"), Some(&data().join("traces/rig.toml")));
    let output = pipe.output().unwrap();
    assert!(output.status.success());
    let output = String::from_utf8(output.stdout).unwrap();
    let events: Vec<Value> = output.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_replayed(&events, &replay);
    assert!(Path::new(&at("state/cylinders/T7%2FB2.state")).exists());
}

/// Redpanda Connect itself is not here: its two commands are run as it runs them, one fed on standard input, the other
/// read.
#[test]
fn the_commands_of_redpanda_connect_speak_to_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let command = |file: &str| {
        let text = std::fs::read_to_string(data().join("../packaging/redpanda-connect").join(file)).unwrap();
        let text = placed(&text, folder.path());
        let value =
            |key: &str| text.lines().find_map(|line| line.trim().strip_prefix(key)).unwrap().to_owned();
        let mut command = Command::new(value("name: "));
        command.args(serde_json::from_str::<Vec<String>>(&value("args: ")).unwrap());
        command
    };
    let made = Command::new("mkfifo").arg(folder.path().join("events")).status().unwrap();
    assert!(made.success());
    let reader = spawn(command("events.yaml").stdin(Stdio::null()));
    let input = ndjson(&text(&data().join("traces/both.csv.gz")), &["T7/B2"]);
    assert!(feed(&mut command("samples.yaml"), input).is_empty());
    let output = String::from_utf8(reader.wait_with_output().unwrap().stdout).unwrap();
    let events: Vec<Value> = output.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let replay = replayed(&data().join("traces/both.csv.gz"), Some(&data().join("traces/rig.toml")));
    assert_replayed(&events, &replay);
}

/// Telegraf's configuration runs a command that takes Telegraf's lines and gives lines that it reads.
#[test]
fn the_command_of_telegraf_speaks_its_protocol() {
    let folder = tempfile::tempdir().unwrap();
    let telegraf = std::fs::read_to_string(data().join("../packaging/telegraf.conf")).unwrap();
    let telegraf = placed(&telegraf, folder.path());
    let command = telegraf.lines().find_map(|line| line.trim().strip_prefix("command = ")).unwrap();
    let words: Vec<String> = serde_json::from_str(command).unwrap();
    let mut child = spawn(Command::new(PROGRAM).args(&words[1..]));
    let mut input = String::new();
    for (k, line) in text(&data().join("traces/both.csv.gz")).lines().skip(1).take(500).enumerate() {
        let cells: Vec<_> = line.split(',').collect();
        let names = ["x_mm", "pa_bar", "pb_bar", "qa_lpm", "qb_lpm"];
        let fields: Vec<_> =
            names.iter().zip(&cells[1..]).map(|(name, cell)| format!("{name}={cell}")).collect();
        let time_ns = 1_700_000_000_000_000_000_u64 + 10_000_000 * k as u64;
        writeln!(input, "pitch,cylinder=T7\\ B2,host=gw {} {time_ns}", fields.join(",")).unwrap();
    }
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap();
    writer.join().unwrap().unwrap();
    let estimates: Vec<_> =
        output.lines().filter(|line| line.starts_with("pitchleak,cylinder=T7\\ B2 ")).collect();
    assert_eq!(estimates.len(), 5);
    assert!(estimates[0].ends_with(" 1700000001000000000"), "{}", estimates[0]);
    assert!(output.contains("pitchleak_alarm,cylinder=T7\\ B2,fault=internal id=\"T7 B2:internal:raised:17"));
}

#[test]
fn lines_of_which_none_is_a_sample_are_no_success() {
    for lines in ["hello\nworld\n", "{\"a\": 1}\n", "t_s,speed\n0,1\n"] {
        let mut child = watch(&[], None)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        child.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{lines}");
        assert!(said.starts_with("error: none of ") && said.lines().count() == 1, "{lines}: {said}");
    }
}
