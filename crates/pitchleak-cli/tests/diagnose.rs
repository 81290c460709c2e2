//! `pitchleak diagnose` from outside.

#![allow(clippy::unwrap_used)]

use pitchleak::core::PerLeak;
use pitchleak_testkit::Motion;
use pitchleak_testkit::rig::with_sensors_of;
use pitchleak_testkit::trace_text::{HEADER, file, row};
use std::fs;
use std::process::{Command, Output};
use tempfile::TempDir;

const INTERNAL: f64 = 1.2e-11;

/// 40 s of the paper's cylinder, flow meter A reading `gain` too much.
fn trace(gain: f64) -> String {
    let motion = Motion::sines(PerLeak { internal: INTERNAL, external_a: 0.0, external_b: 0.0 });
    let row = |k: u32| {
        let t = f64::from(k) * 0.01;
        let mut sample = motion.sample(t);
        sample.qa_m3s = sample.qa_m3s.map(|flow| flow * (1.0 + gain));
        row(t, motion.position_m.slope(t), &sample)
    };
    file(&(0..4000).map(row).collect::<Vec<_>>())
}

fn pitchleak(folder: &TempDir, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pitchleak")).current_dir(folder).args(arguments).output().unwrap()
}

fn folder(gain: f64) -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("rig.toml"), with_sensors_of("0.1 %")).unwrap();
    fs::write(folder.path().join("trace.csv"), trace(gain)).unwrap();
    folder
}

fn json(output: &Output) -> serde_json::Value {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn it_names_the_effect_and_saves_a_rig_that_replay_uses() {
    let folder = folder(0.02);
    let found = json(&pitchleak(&folder, &["diagnose", "trace.csv", "--json", "--save-rig", "new.toml"]));
    assert_eq!(found["verdict"], "explained");
    assert_eq!(found["effects"][0]["id"], "flow_meter_gain_a");
    assert!((found["effects"][0]["value"].as_f64().unwrap() - 0.02).abs() < 1e-3);
    assert!(folder.path().join("new.toml").is_file());
    let replayed = json(&pitchleak(&folder, &["replay", "trace.csv", "--json", "--rig", "new.toml"]));
    let leak = replayed["estimates"]["internal_leak_coefficient"]["value"].as_f64().unwrap();
    assert!((leak / INTERNAL - 1.0).abs() < 0.02, "{leak}");
    let again = json(&pitchleak(&folder, &["diagnose", "trace.csv", "--json", "--rig", "new.toml"]));
    assert_eq!(again["verdict"], "no_missing_effect");
}

/// The residual is white and normal once the effect is in, and follows the flow before.
#[test]
fn residuals_are_tested_and_drawn() {
    let folder = folder(0.02);
    let found = json(&pitchleak(&folder, &["diagnose", "trace.csv", "--json", "--out", "figures/here"]));
    let of = |side: &str| found["residuals"][side]["chamber_a"].clone();
    let sigma = of("before")["correlations"]["qa_m3s"]["sigma"].as_f64().unwrap();
    assert!(sigma.abs() > 4.0, "{sigma}");
    assert!(of("after")["count"].as_u64().unwrap() > 300);
    assert!(found["residuals"]["after"]["force"].is_null());
    assert!(found["remainder"][0]["std_error"][0].is_number());
    for name in ["residual_chamber_a.svg", "residual_chamber_b.svg"] {
        let figure = fs::read_to_string(folder.path().join("figures/here").join(name)).unwrap();
        assert!(figure.contains("autocorrelation") && figure.contains("against P_L"), "{name}");
    }
}

#[test]
fn several_traces_are_fitted_together_and_others_judged() {
    let folder = folder(0.0);
    for copy in ["copy.csv", "test.csv"] {
        fs::copy(folder.path().join("trace.csv"), folder.path().join(copy)).unwrap();
    }
    let arguments = ["diagnose", "trace.csv", "copy.csv", "--test", "test.csv", "--json"];
    let found = json(&pitchleak(&folder, &arguments));
    assert_eq!(
        (found["samples"]["read"].as_u64(), found["samples"]["fitted"].as_u64()),
        (Some(8000), Some(8000))
    );
    assert!(found["wiring"].is_null());
    assert_eq!(found["verdict"], "no_missing_effect");
    assert!(found["after"]["rmse"]["force_n"].is_null());
    let text = pitchleak(&folder, &["diagnose", "trace.csv"]);
    assert!(String::from_utf8_lossy(&text.stdout).contains("no missing effect"));
}

#[test]
fn a_file_is_fitted_once_and_never_judged_on_too() {
    let folder = folder(0.0);
    let output = pitchleak(&folder, &["diagnose", "trace.csv", "--test", "./trace.csv"]);
    assert_eq!(output.status.code(), Some(2));
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(error.contains("./trace.csv is both fitted and judged on (as trace.csv)"), "{error}");
    let twice = pitchleak(&folder, &["diagnose", "trace.csv", "./trace.csv", "--json"]);
    assert!(String::from_utf8_lossy(&twice.stderr).contains("./trace.csv is given twice"));
    assert_eq!(json(&twice), json(&pitchleak(&folder, &["diagnose", "trace.csv", "--json"])));
}

#[test]
fn a_mistake_of_wiring_is_named_before_any_effect() {
    let folder = folder(0.0);
    let trace = fs::read_to_string(folder.path().join("trace.csv")).unwrap();
    fs::write(
        folder.path().join("crossed.csv"),
        trace.replace("qa_", "q_").replace("qb_", "qa_").replace("q_m", "qb_m"),
    )
    .unwrap();
    let found = json(&pitchleak(&folder, &["diagnose", "crossed.csv", "--json"]));
    assert!(
        found["wiring"]["suggestion"].as_str().unwrap().contains("qa and qb exchanged"),
        "{}",
        found["wiring"]
    );
    assert!(found["wiring"]["residual_before"].as_f64() > found["wiring"]["residual_after"].as_f64());
    assert_eq!((found["effects"].as_array().unwrap().len(), &found["verdict"]), (0, &"unexplained".into()));
    let text = pitchleak(&folder, &["diagnose", "crossed.csv"]);
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(
        text.contains("wiring: with qa and qb exchanged") && text.contains("qa = { name = \"qb_"),
        "{text}"
    );
}

/// A fit is not judged by traces whose columns are exchanged.
#[test]
fn a_mistake_of_wiring_in_the_traces_it_is_judged_on_is_told() {
    let folder = folder(0.0);
    let exchanged = HEADER.replace("qa_m3s,qb_m3s", "qb_m3s,qa_m3s");
    assert_ne!(exchanged, HEADER);
    fs::write(folder.path().join("test.csv"), trace(0.0).replace(HEADER, &exchanged)).unwrap();
    let found = json(&pitchleak(&folder, &["diagnose", "trace.csv", "--test", "test.csv", "--json"]));
    assert_eq!(found["verdict"], "unexplained");
    let told = found["wiring"]["suggestion"].as_str().unwrap();
    assert!(told.contains("only judged on") && told.contains("qa and qb exchanged"), "{told}");
}

#[test]
fn bad_input_is_one_clear_line() {
    let folder = folder(0.0);
    fs::write(folder.path().join("header.csv"), format!("{HEADER}\n")).unwrap();
    for arguments in [
        vec!["diagnose", "absent.csv"],
        vec!["diagnose", "header.csv"],
        vec!["diagnose", "trace.csv", "--rig", "absent.toml"],
        vec!["diagnose", "trace.csv", "--save-rig", "no/such/folder/rig.toml"],
    ] {
        let output = pitchleak(&folder, &arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert_eq!(String::from_utf8_lossy(&output.stderr).lines().count(), 1, "{arguments:?}");
    }
}
