//! What the program writes, from outside: whole or not at all, and never over what it reads.

#![allow(clippy::unwrap_used)]

use pitchleak::core::PerLeak;
use pitchleak_testkit::Motion;
use pitchleak_testkit::rig::PAPER;
use pitchleak_testkit::trace_text::file;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// A trace of a leaking cylinder and its rig, in a folder of their own.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let motion = Motion::sines(PerLeak { internal: 1.2e-11, external_a: 0.0, external_b: 0.0 });
    fs::write(folder.path().join("t.csv"), file(&motion.rows(3000))).unwrap();
    fs::write(folder.path().join("r.toml"), PAPER).unwrap();
    fs::write(folder.path().join("x.csv"), "t_s,x_mm\n0,50\n5,60\n9,55\n").unwrap();
    folder
}

fn program(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pitchleak"));
    command.current_dir(folder).args(arguments.split(' '));
    command
}

fn run(folder: &Path, arguments: &str) -> Output {
    program(folder, arguments).output().unwrap()
}

/// The names in a folder, and what is in the files.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let read = |entry: std::io::Result<fs::DirEntry>| {
        let entry = entry.unwrap();
        let bytes = if entry.path().is_file() { fs::read(entry.path()).unwrap() } else { Vec::new() };
        (entry.file_name().to_string_lossy().into_owned(), bytes)
    };
    let mut all: Vec<_> = fs::read_dir(folder).unwrap().map(read).collect();
    all.sort();
    all
}

#[cfg(unix)]
#[test]
fn no_command_writes_over_what_it_reads() {
    use std::os::unix::fs::symlink;
    let folder = folder();
    let at = folder.path();
    symlink(at.join("t.csv"), at.join("link.csv")).unwrap();
    fs::hard_link(at.join("t.csv"), at.join("hard.csv")).unwrap();
    fs::copy(at.join("t.csv"), at.join("other.csv")).unwrap();
    symlink(at.join("other.csv"), at.join("other-link.csv")).unwrap();
    fs::copy(at.join("t.csv"), at.join("gz.csv.gz")).unwrap();
    fs::copy(at.join("t.csv"), at.join("truth.json")).unwrap();
    fs::copy(at.join("r.toml"), at.join("rig.csv")).unwrap();
    fs::copy(at.join("t.csv"), at.join("t.html")).unwrap();
    let before = contents(at);
    for arguments in [
        "replay t.csv --out t.csv",
        "replay t.csv --out ./link.csv",
        "replay link.csv --out t.csv",
        "replay t.csv --out hard.csv",
        "replay gz.csv.gz --out gz.csv.gz",
        "replay t.csv --rig rig.csv --out rig.csv",
        "replay t.html --report t.html",
        "check t.html --report ./t.html",
        "diagnose t.csv --save-rig t.csv",
        "diagnose t.csv --rig r.toml --save-rig r.toml",
        "diagnose t.csv --test other.csv --save-rig other-link.csv",
        "diagnose other.csv --test hard.csv --save-rig link.csv",
        "simulate --position x.csv --load 0 --out x.csv",
        "simulate --position 0.1 --load 0 --rig rig.csv --out rig.csv",
        "simulate --position 0.1 --load 0 --oil-temp t.csv --out t.csv",
        "simulate --position 0.1 --load 0 --rig truth.json --out truth.csv",
        "simulate --wind t.csv --out link.csv",
        "fleet other.csv t.csv --out link.csv",
        "fleet other.csv t.html --report ./t.html",
        "diagnose other.csv --test t.html --report t.html",
    ] {
        let refused = run(at, arguments);
        let error = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{arguments}: {error}");
        assert!(contents(at) == before, "{arguments} changed a file");
        let other_reason =
            ["t.csv --out t.csv", "--wind t.csv", "--oil-temp", "--rig truth.json", "--rig rig.csv"];
        if !other_reason.iter().any(|part| arguments.contains(part)) {
            assert!(error.contains("input"), "{arguments}: {error}");
        }
    }
    let piped = program(at, "replay - --out t.csv").stdin(fs::File::open(at.join("t.csv")).unwrap()).output();
    assert_eq!(piped.unwrap().status.code(), Some(2));
    assert!(contents(at) == before);
}

/// Every command that writes, with the name of what it writes.
const WRITING: [(&str, &str); 6] = [
    ("replay t.csv --out out.csv", "out.csv"),
    ("replay t.csv --out out.csv.gz", "out.csv.gz"),
    ("diagnose t.csv --rig r.toml --save-rig out.toml", "out.toml"),
    ("simulate --position x.csv --load 0 --duration 20 --out out.csv", "out.csv"),
    ("simulate --wind 13 --duration 20 --noise rig --out out.csv.gz", "out.json"),
    ("simulate --wind 13 --duration 20 --noise rig --out out.csv.gz", "out.csv.gz"),
];

/// A disk that is full after so many bytes, by the system's limit on the size of a file.
#[cfg(unix)]
#[test]
fn on_a_full_disk_the_old_file_stays() {
    let folder = folder();
    let at = folder.path();
    for (arguments, name) in WRITING {
        fs::write(at.join(name), "old").unwrap();
        let mut refused = 0;
        for blocks in [0, 1, 2, 8, 32] {
            let limited = format!(
                "trap '' XFSZ; ulimit -f {blocks}; exec {} {arguments}",
                env!("CARGO_BIN_EXE_pitchleak")
            );
            let done = Command::new("sh").current_dir(at).args(["-c", &limited]).output().unwrap();
            if done.status.success() {
                break;
            }
            refused += 1;
            assert_eq!(done.status.code(), Some(2), "{arguments}");
            assert_eq!(fs::read(at.join(name)).unwrap(), b"old", "{arguments} with {blocks} blocks");
            let left = contents(at).into_iter().filter(|(name, _)| name.ends_with(".tmp")).count();
            assert_eq!(left, 0, "{arguments} leaves a temporary");
        }
        assert!(refused > 0, "{arguments} needs less than a block");
        fs::remove_file(at.join(name)).unwrap();
    }
}

#[test]
fn what_fails_half_way_leaves_the_old_file() {
    let folder = folder();
    let at = folder.path();
    let mut text = fs::read_to_string(at.join("t.csv")).unwrap();
    text.push_str("not,a,row\n");
    fs::write(at.join("bad.csv"), text).unwrap();
    fs::write(at.join("out.csv"), "old").unwrap();
    assert_eq!(run(at, "replay bad.csv --strict --out out.csv").status.code(), Some(2));
    assert_eq!(fs::read(at.join("out.csv")).unwrap(), b"old");
    assert!(run(at, "replay bad.csv --out out.csv").status.success());
    assert!(fs::read(at.join("out.csv")).unwrap().len() > 100_000);
}

#[test]
fn outputs_that_cannot_be_written_are_found_before_the_work() {
    let folder = folder();
    let at = folder.path();
    for arguments in [
        "replay - --out absent/out.csv",
        "diagnose - --save-rig absent/out.toml",
        "diagnose - --out t.csv/figures",
        "reproduce --out t.csv/figures",
        "simulate --wind 13 --duration 100000 --out absent/out.csv",
    ] {
        // Standard input never ends: who reads it first waits.
        let mut child = program(at, arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let status = (0..100).find_map(|_| {
            std::thread::sleep(Duration::from_millis(50));
            child.try_wait().unwrap()
        });
        let _ = child.kill();
        child.wait().unwrap();
        let mut error = String::new();
        child.stderr.take().unwrap().read_to_string(&mut error).unwrap();
        assert_eq!(status.and_then(|status| status.code()), Some(2), "{arguments}: {error}");
        assert!(error.contains("cannot write"), "{arguments}: {error}");
    }
}

/// As a terminal does it, and as a service manager does it, to every command that takes its time.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_ends_every_command_with_the_old_file_there_and_nothing_beside_it() {
    let folder = folder();
    let at = folder.path();
    for (number, (arguments, name)) in [
        ("replay - --out out.csv", "out.csv"),
        ("replay - --report out.html", "out.html"),
        ("check - --report out.html", "out.html"),
        ("diagnose - --save-rig out.toml", "out.toml"),
        ("simulate --wind 13 --duration 100000 --out out.csv", "out.csv"),
        ("reproduce --report out.html", "out.html"),
    ]
    .into_iter()
    .enumerate()
    {
        fs::write(at.join(name), "old").unwrap();
        let before = contents(at);
        // Whoever runs the tests may have them ignored; then the program leaves that so.
        let mut child = Command::new("env")
            .args(["--default-signal=INT,TERM,HUP", env!("CARGO_BIN_EXE_pitchleak")])
            .current_dir(at)
            .args(arguments.split(' '))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Held open: its end would be the command's.
        let _stdin = child.stdin.take();
        let began = (0..1000).any(|_| {
            std::thread::sleep(Duration::from_millis(10));
            contents(at).len() > before.len()
        });
        assert!(began, "{arguments} writes nothing");
        let (signal, told) = [("-INT", 130), ("-TERM", 143), ("-HUP", 129)][number % 3];
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let status = child.wait().unwrap();
        let mut error = String::new();
        child.stderr.take().unwrap().read_to_string(&mut error).unwrap();
        assert_eq!(status.code(), Some(told), "{arguments}: {error}");
        assert!(error.contains("interrupted"), "{arguments}: {error}");
        assert!(contents(at) == before, "{arguments}");
        fs::remove_file(at.join(name)).unwrap();
    }
}

/// As a shell starts a job in the background: what else ends it has to leave nothing behind, too.
#[test]
fn where_one_signal_is_ignored_the_others_leave_nothing_half_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut child = Command::new("sh")
        .args(["-c", "trap '' INT; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_pitchleak")])
        .args("simulate --wind 13 --duration 100000 --out out.csv".split(' '))
        .current_dir(at)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let hidden = || contents(at).iter().any(|(name, _)| name.ends_with(".tmp"));
    assert!((0..1000).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        hidden()
    }));
    let id = child.id().to_string();
    let kill = |signal: &str| Command::new("kill").args([signal, id.as_str()]).status().unwrap();
    kill("-INT");
    std::thread::sleep(Duration::from_millis(200));
    assert!(hidden(), "it was ignored");
    kill("-TERM");
    assert_eq!(child.wait().unwrap().code(), Some(143));
    assert!(contents(at).is_empty());
}

#[test]
fn help_that_nobody_gets_is_no_success() {
    for arguments in [&["--help"][..], &["--version"], &["replay", "--help"]] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_pitchleak"));
        let output = command.args(arguments).stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("standard output"), "{arguments:?}");
    }
}
