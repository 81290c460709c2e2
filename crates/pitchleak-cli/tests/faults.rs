//! Every command that writes, on a disk that fails: the old file or the new one is there after, never another.
//!
//! `faults/disk.c` stands between the program and the disk: each operation fails in its turn, for good or once, or the
//! program is killed within it, until none is left (SQLite's habit).

#![cfg(all(target_os = "linux", target_env = "gnu"))]
#![allow(clippy::unwrap_used)]

use pitchleak::core::PerLeak;
use pitchleak_testkit::Motion;
use pitchleak_testkit::rig::PAPER;
use pitchleak_testkit::trace_text::file;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use tempfile::TempDir;

/// Command lines, and what they write.
const WRITING: [(&str, &[&str]); 10] = [
    ("replay t.csv --out out.csv", &["out.csv"]),
    ("replay t.csv --out out.csv.gz", &["out.csv.gz"]),
    ("replay t.csv --out out.parquet --report out.html", &["out.parquet", "out.html"]),
    ("check t.csv --report out.html", &["out.html"]),
    ("diagnose t.csv --rig r.toml --save-rig out.toml --report out.html", &["out.toml", "out.html"]),
    ("simulate --position x.csv --load 0 --duration 2 --out out.csv", &["out.csv", "out.json"]),
    ("simulate --position x.csv --load 0 --duration 2 --out out.csv.gz", &["out.csv.gz", "out.json"]),
    ("fleet t.csv u.csv --out out.csv --report out.html", &["out.csv", "out.html"]),
    ("fleet t.csv u.csv --out out.parquet", &["out.parquet"]),
    ("replay t.csv --out link.csv", &["out.csv"]),
];

struct Disk {
    folder: TempDir,
    library: PathBuf,
}

impl Disk {
    /// Traces of a leaking cylinder, its rig, and the faulty disk's library.
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let at = folder.path();
        let motion = Motion::sines(PerLeak { internal: 1.2e-11, external_a: 0.0, external_b: 0.0 });
        for name in ["t.csv", "u.csv"] {
            fs::write(at.join(name), file(&motion.rows(400))).unwrap();
        }
        fs::write(at.join("r.toml"), PAPER).unwrap();
        fs::write(at.join("x.csv"), "t_s,x_mm\n0,50\n5,60\n9,55\n").unwrap();
        std::os::unix::fs::symlink(at.join("out.csv"), at.join("link.csv")).unwrap();
        let library = at.join("disk.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/disk.c");
        let compiled = Command::new("cc")
            .args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"])
            .args([&library, &source])
            .arg("-ldl")
            .status();
        assert!(compiled.unwrap().success());
        Self { folder, library }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, arguments: &str, fault: &str) -> ExitStatus {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pitchleak"));
        command.current_dir(self.folder.path()).args(arguments.split(' '));
        command.env("LD_PRELOAD", &self.library).env("DISK_FAULT", fault);
        command.env("DISK_COUNT", self.path("count")).stdout(Stdio::null()).stderr(Stdio::null());
        command.stdin(File::open(self.path("t.csv")).unwrap()).status().unwrap()
    }

    /// Operations of the run before, up to its end.
    fn operations(&self) -> u32 {
        fs::read_to_string(self.path("count")).unwrap().parse().unwrap()
    }

    fn temporaries(&self) -> Vec<PathBuf> {
        let paths = fs::read_dir(self.folder.path()).unwrap().map(|entry| entry.unwrap().path());
        paths.filter(|path| path.to_string_lossy().ends_with(".tmp")).collect()
    }
}

#[test]
fn whatever_fails_every_command_leaves_the_old_file_or_the_new_one() {
    let disk = Disk::new();
    for (arguments, names) in WRITING {
        let paths: Vec<_> = names.iter().map(|name| disk.path(name)).collect();
        let write_old = || paths.iter().for_each(|path| fs::write(path, "old").unwrap());
        let read = || paths.iter().map(|path| fs::read(path).unwrap()).collect::<Vec<_>>();
        write_old();
        assert!(disk.run(arguments, "").success(), "{arguments}");
        let (new, operations) = (read(), disk.operations());
        assert!(operations >= 5 * names.len() as u32, "{arguments}: {operations} operations are seen");
        write_old();
        assert!(disk.run(arguments, "hampers").success(), "{arguments}, hampered");
        assert!(read() == new, "{arguments}, hampered");
        for at in 0..operations {
            // No space left, for good; an error of the device, once.
            for fault in [format!("fails 28 {at}"), format!("once 5 {at}"), format!("kills {at}")] {
                write_old();
                let status = disk.run(arguments, &fault);
                let old_or_new = read().iter().zip(&new).all(|(found, new)| found == b"old" || found == new);
                assert!(old_or_new, "{arguments}, {fault} of {operations}");
                let left = disk.temporaries();
                if fault.starts_with("kills") {
                    assert_eq!(status.code(), None, "{arguments}, {fault}");
                } else {
                    assert_eq!(status.code(), Some(2), "{arguments}, {fault} of {operations}");
                    assert!(left.is_empty(), "{arguments}, {fault}: {left:?}");
                }
                left.iter().for_each(|path| fs::remove_file(path).unwrap());
            }
        }
    }
}

/// One of its two generations is whole, whatever fails: it goes on.
#[test]
fn whatever_fails_a_watch_goes_on_from_a_state_that_it_had() {
    let disk = Disk::new();
    let arguments = "watch --state state";
    assert!(disk.run(arguments, "").success());
    let operations = disk.operations();
    for at in 0..operations {
        for fault in [format!("fails 28 {at}"), format!("once 5 {at}"), format!("kills {at}")] {
            assert!(!disk.run(arguments, &fault).success(), "{fault} of {operations}");
            assert!(disk.run(arguments, "").success(), "after {fault} of {operations}");
        }
    }
}
