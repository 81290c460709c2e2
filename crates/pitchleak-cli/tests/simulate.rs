//! `simulate` and `reproduce` from outside.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

fn pitchleak(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pitchleak")).args(arguments).output().unwrap()
}

fn simulate(out: &Path, arguments: &[&str]) -> Output {
    let out = out.display().to_string();
    pitchleak(&[&["simulate", "--out", &out], arguments].concat())
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_simulated_leak_is_found_again() {
    let folder = TempDir::new().unwrap();
    let trace = folder.path().join("trace.csv.gz");
    let arguments =
        ["--wind", "21", "--leak-external-a", "0.8 L/min", "--noise", "1 %", "--duration", "20 s"];
    let output = simulate(&trace, &arguments);
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    let truth = json(&folder.path().join("trace.json"));
    assert_eq!(truth["schema"], "pitchleak.simulate/1");
    assert_eq!(truth["samples"], 2000);
    assert!((truth["leaks"]["external_a"]["mean_flow_lpm"].as_f64().unwrap() - 0.8).abs() < 0.01);

    let report = pitchleak(&["replay", &trace.display().to_string(), "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&report.stdout).unwrap();
    assert_eq!(report["verdict"]["faults"], serde_json::json!(["external_a"]));
    let found = report["leakage"]["external_a"]["mean_lpm"].as_f64().unwrap();
    assert!((found - 0.8).abs() < 0.03, "{found} L/min");
}

#[test]
fn the_same_seed_gives_the_same_trace_and_another_does_not() {
    let folder = TempDir::new().unwrap();
    let make = |name: &str, seed: &str| {
        let path: PathBuf = folder.path().join(name);
        let arguments = ["--position", "90 mm", "--load", "2 kN", "--noise", "rig", "--duration", "1 s"];
        assert!(simulate(&path, &[&arguments[..], &["--seed", seed]].concat()).status.success());
        std::fs::read(path).unwrap()
    };
    let first = make("a.csv", "1");
    assert_eq!(first, make("b.csv", "1"));
    assert_ne!(first, make("c.csv", "2"));
}

#[test]
fn references_come_from_files_and_standard_output_is_a_trace() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("x.csv");
    std::fs::write(&file, "t_s,x_mm\n0,50\n1,55\n2,60\n").unwrap();
    let file = file.display().to_string();
    let output = simulate(Path::new("-"), &["--position", &file, "--load", "2 kN", "--start", "0 s"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let last: Vec<&str> = text.lines().last().unwrap().split(',').collect();
    assert_eq!(text.lines().count(), 201);
    assert!((last[1].parse::<f64>().unwrap() - 60.0).abs() < 0.5, "{last:?}");
}

#[test]
fn bad_usage_is_one_clear_message() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("t.csv");
    let cases: [(&[&str], &str); 8] = [
        (&[], "--position"),
        (&["--wind", "nowhere.outb"], "nowhere.outb"),
        (&["--wind", "13", "--leak-internal", "1 bar"], "L/min"),
        (&["--wind", "13", "--leak-internal", "900 L/min", "--duration", "2 s"], "no leak coefficient"),
        (&["--wind", "13", "--effect", "gremlins=1"], "gremlins"),
        (&["--wind", "13", "--duration", "0 s"], "the duration"),
        (&["--wind", "13", "--rig", "nowhere.toml"], "nowhere.toml"),
        (&["--position", "90 mm", "--load", "heavy"], "heavy"),
    ];
    for (arguments, part) in cases {
        let output = simulate(&out, arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(part) && !message.contains("panicked"), "{arguments:?}: {message}");
    }
    assert!(!out.exists(), "nothing is written where nothing was simulated");
    assert_eq!(pitchleak(&["reproduce", "--seeds", "0"]).status.code(), Some(2));
}
