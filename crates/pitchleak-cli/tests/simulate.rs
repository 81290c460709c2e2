//! `simulate` and `reproduce` from outside.

#![allow(clippy::unwrap_used)]

use pitchleak_testkit::rig::with_valve;
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

/// The rig of a valve without pressure in its tank, as the simulated one.
fn untanked(valve: &str) -> String {
    with_valve(valve).replace("tank = \"2 bar\"\n", "")
}

/// What a replay says of a trace.
fn replayed(trace: &Path, settings: &[&str]) -> serde_json::Value {
    let path = trace.display().to_string();
    let report = pitchleak(&[&["replay", &path, "--json"], settings].concat());
    serde_json::from_slice(&report.stdout).unwrap()
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

    let report = replayed(&trace, &[]);
    assert_eq!(report["verdict"]["faults"], serde_json::json!(["external_a"]));
    let found = report["leakage"]["external_a"]["mean_lpm"].as_f64().unwrap();
    assert!((found - 0.8).abs() < 0.03, "{found} L/min");
}

/// Simulated, judged and checked as a hold, with neither flow meter.
#[test]
fn a_simulated_hold_is_judged_without_meters() {
    let folder = TempDir::new().unwrap();
    let trace = folder.path().join("hold.csv");
    let arguments = ["--position", "100 mm", "--load", "4 kN", "--shut", "1 s..", "--duration", "11 s"];
    let rest = ["--leak-external-b", "0.0003 L/min/bar", "--noise", "rig", "--fault", "qa missing"];
    let output = simulate(&trace, &[&arguments[..], &rest, &["--fault", "qb missing"]].concat());
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");

    let path = trace.display().to_string();
    let report = replayed(&trace, &[]);
    assert_eq!((&report["verdict"]["status"], &report["hold"]["holds"]), (&"leak".into(), &1.into()));
    assert_eq!(report["verdict"]["faults"], serde_json::json!(["external_b"]));
    assert_eq!(report["hold"]["ended_by"], "pressure");

    let text = String::from_utf8(pitchleak(&["check", &path]).stdout).unwrap();
    assert!(text.contains("This is a hold test: ") && text.contains("external B leaks from 0.00"), "{text}");
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
fn leaks_oil_and_sensors_change_as_told_and_the_truth_says_so() {
    let folder = TempDir::new().unwrap();
    let trace = folder.path().join("t.csv");
    let arguments = ["--position", "90 mm", "--load", "2 kN", "--duration", "4 s", "--sample-rate", "10"];
    let leaks = ["--leak-external-a", "0.1 L/min -> 0.5 L/min @ 1 s..3 s", "--leak-internal", "0.2 L/min"];
    let world =
        ["--onset", "2 s", "--oil-temp", "50 °C", "--fault", "swap qa qb", "--fault", "pa dead 2 s..3 s"];
    let refused = simulate(&trace, &[&arguments[..], &leaks, &world].concat());
    assert_eq!(refused.status.code(), Some(2), "a leak that grows has its own times");
    let output = simulate(&trace, &[&arguments[..], &leaks, &world[2..]].concat());
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    let truth = json(&folder.path().join("t.json"));
    assert_eq!(truth["sensor_faults"], serde_json::json!(["swap qa qb", "pa dead 2 s..3 s"]));
    let course = &truth["leaks"]["external_a"]["course"];
    assert_eq!(
        (&course["kind"], &course["from_s"], &course["to_share"]),
        (&"ramp".into(), &1.0.into(), &1.0.into())
    );
    assert_eq!(truth["leaks"]["internal"]["course"]["kind"], "steady");
    let text = std::fs::read_to_string(&trace).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|row| row.split(',').map(|c| c.parse().unwrap()).collect()).collect();
    assert_eq!(
        text.lines().next(),
        Some("t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm,force_n,temp_c,q_int_lpm,q_ext_a_lpm,q_ext_b_lpm")
    );
    assert!(rows.iter().all(|row| (row[7] - 50.0).abs() < 1e-9));
    assert!(rows.iter().all(|row| (row[2] == 0.0) == (20..30).contains(&((10.0 * row[0]).round() as i64))));
    let coefficient = |row: &[f64]| row[9] / row[2];
    let grown = coefficient(&rows[35]) / coefficient(&rows[5]);
    assert!((grown - 5.0).abs() < 1e-3, "{grown}");
}

#[test]
fn a_trace_longer_than_its_wind_says_how_it_goes_on() {
    let folder = TempDir::new().unwrap();
    let wind = folder.path().join("w.csv");
    let rows: String =
        (0..60).map(|k| format!("{},{},1000\n", 0.1 * f64::from(k), 20.0 + 0.1 * f64::from(k))).collect();
    std::fs::write(&wind, format!("t_s,pitch_deg,pitch_moment_Nm\n{rows}")).unwrap();
    let (wind, trace) = (wind.display().to_string(), folder.path().join("t.csv"));
    let output =
        simulate(&trace, &["--wind", &wind, "--start", "0 s", "--duration", "12 s", "--sample-rate", "10"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && message.lines().count() == 1 && message.contains("back and forth"),
        "{message}"
    );
    let truth = json(&folder.path().join("t.json"));
    assert_eq!(truth["reference_end"]["after"], "mirrored");
    assert!((truth["reference_end"]["time_s"].as_f64().unwrap() - 5.9).abs() < 1e-9);
    let text = std::fs::read_to_string(&trace).unwrap();
    let x: Vec<f64> =
        text.lines().skip(1).map(|row| row.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert!(x.windows(2).all(|pair| (pair[0] - pair[1]).abs() < 0.5), "no jump");
    assert!((x[59] - x[0]).abs() > 5.0 && (x[118] - x[0]).abs() < 0.05 * (x[59] - x[0]), "{x:?}");
}

#[cfg(unix)]
#[test]
fn a_reader_that_has_had_enough_ends_it_quietly_and_at_once() {
    let program = env!("CARGO_BIN_EXE_pitchleak");
    let begun = std::time::Instant::now();
    let line = format!(
        "'{program}' simulate --position '90 mm' --load '2 kN' --duration '20000 s' --out - | head -1"
    );
    let output = Command::new("sh").args(["-c", &line]).output().unwrap();
    assert!(output.stdout.starts_with(b"t_s,") && output.stderr.is_empty(), "{output:?}");
    assert!(begun.elapsed().as_secs() < 60, "it went on for nobody");
}

#[test]
fn bad_usage_is_one_clear_message() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("t.csv");
    let cases: [(&[&str], &str); 19] = [
        (&[], "--position"),
        (&["--wind", "nowhere.outb"], "nowhere.outb"),
        (&["--wind", "13", "--leak-internal", "1 bar"], "L/min"),
        (&["--wind", "13", "--leak-internal", "900 L/min", "--duration", "2 s"], "no leak coefficient"),
        (&["--wind", "13", "--effect", "gremlins=1"], "gremlins"),
        (&["--wind", "13", "--duration", "0 s"], "the duration"),
        (&["--wind", "13", "--rig", "nowhere.toml"], "nowhere.toml"),
        (&["--position", "90 mm", "--load", "heavy"], "heavy"),
        (&["--wind", "14"], "14: no such file; built in are the winds 5, 13, 21 and 30 (m/s)"),
        (&["--wind", "13", "--noise", "1"], "did you mean `1 %`?"),
        (&["--wind", "13", "--noise", "1e308"], "times full scale"),
        (&["--wind", "13", "--bias", "2"], "did you mean `2 %`?"),
        (&["--wind", "13", "--effect", "drag_leak=0.01", "--effect", "drag_leak=0.02"], "given twice"),
        (&["--wind", "13", "--leak-internal", "1 L/min @ 9 s..", "--onset", "5 s"], "takes no onset"),
        (&["--wind", "13", "--leak-internal", "1 L/min every 5 s"], "for 10 s"),
        (&["--wind", "13", "--oil-temp", "warm"], "warm"),
        (&["--wind", "13", "--fault", "qa asleep"], "clipped"),
        (&["--wind", "13", "--fault", "swap qa pa"], "one kind"),
        (&["--wind", "/dev/zero"], "/dev/zero"),
    ];
    for (arguments, part) in cases {
        let output = simulate(&out, arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(part) && !message.contains("panicked"), "{arguments:?}: {message}");
    }
    assert!(!out.exists(), "nothing is written where nothing was simulated");
    let other = simulate(&folder.path().join("t.parquet"), &["--wind", "13"]);
    let message = String::from_utf8_lossy(&other.stderr);
    assert!(other.status.code() == Some(2) && message.contains(".csv.gz"), "{message}");
    assert_eq!(pitchleak(&["reproduce", "--seeds", "0"]).status.code(), Some(2));
}

/// Without flow meters, where pressures hardly change but by their noise, no oil is told, and none contradicts the rig file.
#[test]
fn in_calm_wind_a_valve_tells_no_oil() {
    let folder = TempDir::new().unwrap();
    let rig = folder.path().join("rig.toml");
    // The paper's mass, and a tank without pressure.
    let text = with_valve("supply = \"100 bar\"").replace("60 kg", "20 kg").replace("tank = \"2 bar\"\n", "");
    std::fs::write(&rig, text).unwrap();
    let (rig, trace) = (rig.display().to_string(), folder.path().join("trace.csv"));
    for seed in ["1", "2", "3"] {
        let arguments = ["--rig", &rig, "--wind", "5", "--noise", "rig", "--seed", seed];
        let output = simulate(&trace, &arguments);
        assert!(output.status.success(), "{output:?}");
        let report = replayed(&trace, &["--rig", &rig]);
        assert_ne!(report["verdict"]["status"], "doubtful", "{}", report["verdict"]["text"]);
        assert_eq!(report["estimates"]["bulk_modulus"]["identifiable"], false, "{seed}");
    }
}

/// A leak to the outside that has emptied a chamber is not ruled out by the little that still flows.
#[test]
fn beside_an_empty_chamber_a_valve_calls_nothing_sound() {
    let folder = TempDir::new().unwrap();
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, untanked("")).unwrap();
    let (rig, trace) = (rig.display().to_string(), folder.path().join("trace.csv"));
    let mut empty = 0;
    for seed in ["1", "2", "3", "4"] {
        let leak = ["--leak-external-a", "0.15 L/min", "--valve", "hysteresis=0.7 %", "--duration", "60 s"];
        let arguments = ["--rig", &rig, "--wind", "5", "--noise", "rig", "--seed", seed];
        let output = simulate(&trace, &[&arguments[..], &leak].concat());
        assert!(output.status.success(), "{output:?}");
        let report = replayed(&trace, &["--rig", &rig]);
        let text = report["verdict"]["text"].as_str().unwrap();
        assert_ne!(report["verdict"]["status"], "sound", "{seed}: {text}");
        empty += usize::from(text.contains("nearly empty"));
    }
    assert!(empty > 0);
}

/// A valve as noisy as its rig says, with a clearance.
const OPEN_VALVE: &[&str] = &["--noise", "rig", "--valve", "clearance=0.02 L/min"];

/// A rig in this folder whose valve was calibrated while nothing leaked.
fn calibrated(folder: &Path) -> String {
    let [rig, trace, calibration] = ["rig.toml", "then.csv", "valve.toml"].map(|name| folder.join(name));
    std::fs::write(&rig, untanked("")).unwrap();
    let [name, path, out] = [&rig, &trace, &calibration].map(|path| path.display().to_string());
    let then = ["--rig", &name, "--wind", "13", "--seed", "3", "--duration", "280 s"];
    assert!(simulate(&trace, &[OPEN_VALVE, &then].concat()).status.success());
    let made = pitchleak(&["calibrate", &path, "--rig", &name, "--leaks", "zero", "--out", &out]);
    assert!(made.status.success(), "{made:?}");
    // The line to paste is true where the rig file lies.
    let advised = "calibration = \"valve.toml\"";
    assert!(String::from_utf8_lossy(&made.stdout).contains(&format!("[valve] {advised}\n")), "{made:?}");
    std::fs::write(&rig, untanked(&format!("{advised}\n"))).unwrap();
    name
}

#[test]
fn a_calibration_reads_a_trace_once_and_takes_evidence_for_leaks_that_are_zero() {
    let folder = TempDir::new().unwrap();
    let name = calibrated(folder.path());
    let [trace, hold, out] =
        ["then.csv", "hold.csv", "again.toml"].map(|file| folder.path().join(file).display().to_string());
    let rest = ["--rig", &name, "--leaks", "zero", "--out", &out];
    let made = pitchleak(&[&["calibrate", &trace, &trace], &rest[..]].concat());
    let (told, warned) = (String::from_utf8_lossy(&made.stdout), String::from_utf8_lossy(&made.stderr));
    assert!(told.starts_with("5 min of 1 trace:"), "{told}");
    assert!(warned.contains("then.csv is given twice: it is read once"), "{warned}");

    let still = ["--position", "100 mm", "--load", "4 kN", "--shut", "2 s..", "--duration", "12 s"];
    let output = simulate(Path::new(&hold), &[&still[..], &["--rig", &name, "--noise", "rig"]].concat());
    assert!(output.status.success(), "{output:?}");
    for leaks in ["zero", "unknown"] {
        let with = ["--rig", &name, "--leaks", leaks, "--evidence", &hold, "--out", &out];
        let made = pitchleak(&[&["calibrate", &trace], &with[..]].concat());
        assert!(made.status.success(), "{made:?}");
        let left_aside = String::from_utf8_lossy(&made.stderr).contains("with it they are `zero`");
        assert_eq!(left_aside, leaks == "unknown", "{made:?}");
    }
}

/// A search over many minutes comes to its end, and the seconds of a window that has just begun take nothing back.
#[test]
fn a_calibrated_valve_names_a_steady_leak_in_minutes() {
    let folder = TempDir::new().unwrap();
    let (name, trace) = (calibrated(folder.path()), folder.path().join("trace.csv"));
    for seconds in ["200 s", "400 s", "600.2 s"] {
        let leak = ["--rig", &name, "--wind", "13", "--seed", "71", "--duration", seconds];
        let output = simulate(&trace, &[OPEN_VALVE, &leak, &["--leak-external-a", "0.1 L/min"]].concat());
        assert!(output.status.success(), "{output:?}");
        let report = replayed(&trace, &["--rig", &name]);
        assert_eq!(report["verdict"]["status"], "leak", "{seconds}: {}", report["verdict"]["text"]);
    }
}

/// In calm wind the spool opens one way as a leak grows, and an edge that is thought shut would hide it: no valve loses an edge.
#[test]
fn no_edge_of_a_calibrated_valve_hides_a_leak_that_grows() {
    let folder = TempDir::new().unwrap();
    let (name, trace) = (calibrated(folder.path()), folder.path().join("trace.csv"));
    let settings = [&["--rig", &name], OPEN_VALVE].concat();
    for leak in ["--leak-external-a", "--leak-external-b"] {
        for seed in ["1", "2", "3"] {
            let grows = [
                "--wind",
                "5",
                "--seed",
                seed,
                "--duration",
                "60 s",
                leak,
                "0.02 L/min -> 0.2 L/min @ 0 s..60 s",
            ];
            assert!(simulate(&trace, &[&settings[..], &grows].concat()).status.success());
            let report = replayed(&trace, &["--rig", &name]);
            assert_ne!(report["verdict"]["status"], "sound", "{leak} {seed}: {}", report["verdict"]["text"]);
        }
    }
}

/// What docs/valve.md says of a stream: a leak that grows for minutes is in doubt and apparent, and nothing is alarmed.
#[test]
fn a_leak_that_grows_is_apparent_in_a_calibrated_valves_stream() {
    let folder = TempDir::new().unwrap();
    let (name, trace) = (calibrated(folder.path()), folder.path().join("trace.csv"));
    for (option, leak) in [("--leak-external-a", "external_a"), ("--leak-external-b", "external_b")] {
        for seed in ["1", "2", "3"] {
            let settings = [&["--rig", &name, "--wind", "13", "--seed", seed], OPEN_VALVE].concat();
            let grows = ["--duration", "600 s", option, "0 L/min -> 0.3 L/min @ 0 s..600 s"];
            assert!(simulate(&trace, &[&settings[..], &grows].concat()).status.success());
            let mut watch = Command::new(env!("CARGO_BIN_EXE_pitchleak"));
            let rows = std::fs::File::open(&trace).unwrap();
            let told = watch.args(["watch", "--rig", &name]).stdin(rows).output().unwrap();
            let events = String::from_utf8(told.stdout).unwrap();
            let last = events.lines().rev().find(|line| line.contains("\"type\":\"estimate\"")).unwrap();
            let last: serde_json::Value = serde_json::from_str(last).unwrap();
            assert_eq!(
                (&last["status"], &last["faults"]),
                (&"doubtful".into(), &[leak].into()),
                "{seed}: {last}"
            );
            assert!(!events.contains("\"type\":\"alarm\""), "{leak} {seed}");
        }
    }
}

/// A chamber that a leak has emptied takes up what flows in at no pressure: what is read then is left out, and said.
#[test]
fn while_a_chamber_is_void_a_valve_tells_nothing() {
    let folder = TempDir::new().unwrap();
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, untanked("")).unwrap();
    let (rig, trace) = (rig.display().to_string(), folder.path().join("trace.csv"));
    for seed in ["1", "2", "3", "4"] {
        let arguments = ["--rig", &rig, "--wind", "13", "--noise", "rig", "--seed", seed];
        let leak = ["--leak-external-a", "0.15 L/min", "--duration", "60 s"];
        let output = simulate(&trace, &[&arguments[..], &leak].concat());
        assert!(output.status.success(), "{output:?}");
        let report = replayed(&trace, &["--rig", &rig]);
        let text = report["verdict"]["text"].as_str().unwrap();
        assert_ne!(report["verdict"]["status"], "doubtful", "{text}");
        assert!(text.contains("A chamber is below the atmosphere for "), "{text}");
        assert!(report["valve"]["void_s"].as_f64() > Some(5.0), "{text}");
    }
}

/// By its data sheet alone, in calm wind: the search for what is not known of the valve goes astray easily there, and then it names
/// nothing; until it was held back it called half a litre SOUND.
#[test]
fn in_calm_wind_a_valve_hides_no_leak() {
    let folder = TempDir::new().unwrap();
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, untanked("")).unwrap();
    let (rig, trace) = (rig.display().to_string(), folder.path().join("trace.csv"));
    let mut named = 0;
    for (leak, lpm) in [("external-a", 0.5), ("external-b", 0.3), ("internal", 0.1)] {
        for seed in ["1", "2", "3", "4"] {
            let (option, size) = (format!("--leak-{leak}"), format!("{lpm} L/min"));
            let arguments = ["--rig", &rig, "--wind", "5", "--noise", "rig", "--seed", seed, &option, &size];
            let flaws = ["--duration", "60 s", "--valve", "clearance=0.02 L/min"];
            let output = simulate(&trace, &[&arguments[..], &flaws].concat());
            assert!(output.status.success(), "{output:?}");
            let report = replayed(&trace, &["--rig", &rig]);
            let (verdict, kind) = (&report["verdict"], leak.replace('-', "_"));
            let case = format!("{leak} {seed}: {}", verdict["text"]);
            match verdict["status"].as_str() {
                Some("leak") => {
                    named += 1;
                    assert_eq!(verdict["faults"], serde_json::json!([kind]), "{case}");
                    let of = |key: &str| report["leakage"][&kind][key].as_f64().unwrap();
                    // At one of the ends of twelve intervals of 95 % it may be.
                    assert!((of("mean_lpm") - lpm).abs() < 2.6 * of("std_lpm"), "{case}");
                }
                status => assert_eq!(status, Some("not_sure"), "{case}"),
            }
        }
    }
    assert!(named >= 8, "{named} of 12");
}
