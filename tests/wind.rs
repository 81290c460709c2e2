//! From wind to the rig's references: built-in cases, OpenFAST files, and what goes wrong.

use pitchleak::openfast;
use pitchleak::wind::{Emulation, History, HistoryError, HistoryFault, Wind, WindCase};
use std::path::{Path, PathBuf};

const STROKE_M: f64 = 0.2;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

#[test]
fn every_built_in_case_fits_the_rig() {
    for case in WindCase::ALL {
        let history = History::of(&Wind::BuiltIn(case)).expect("is built in");
        assert!(history.t_s.len() >= 7500, "300 s at 25 Hz");
        let wind = history.wind_mps.as_ref().expect("has wind");
        let mean = wind.iter().sum::<f64>() / wind.len() as f64;
        assert!((mean - f64::from(case.mean_mps())).abs() < 1.5, "{mean} m/s for {case:?}");
        let reference = Emulation::paper().reference(&history, STROKE_M).expect("fits");
        assert!(reference.clipped_share.abs() < 1e-12);
        for k in 0..3000 {
            let (x, load) =
                (reference.position_m.at(0.1 * f64::from(k)), reference.load_n.at(0.1 * f64::from(k)));
            assert!((1e-3..0.19).contains(&x), "{x} m");
            assert!(load.abs() < 10e3, "{load} N within the load cell");
        }
    }
}

#[test]
fn wind_is_named_by_speed_or_file() {
    let parse = |text: &str| text.parse::<Wind>().expect("never fails");
    assert_eq!(parse("13"), Wind::BuiltIn(WindCase::Mps13));
    assert_eq!(parse("5mps"), Wind::BuiltIn(WindCase::Mps5));
    assert_eq!(parse("12"), Wind::File("12".into()));
    assert_eq!(parse("run.outb"), Wind::File("run.outb".into()));
}

#[test]
fn a_missing_channel_and_a_strange_unit_are_named() {
    let channel = |name: &str, unit: &str| openfast::Channel {
        name: name.into(),
        unit: unit.into(),
        values: (0..9).map(f64::from).collect(),
    };
    let run = |channels| openfast::Run {
        description: String::new(),
        time_s: (0..9).map(|k| 0.05 * f64::from(k)).collect(),
        channels,
    };
    let read = |channels| History::from_run(&run(channels), Path::new("run.outb"));
    let missing = read(vec![channel("BldPitch1", "deg"), channel("RootMzb2", "kN-m")]);
    assert!(
        matches!(missing, Err(HistoryError::File { fault: HistoryFault::Missing(_), .. })),
        "blades must match"
    );
    let unit = read(vec![channel("BldPitch2", "deg"), channel("RootMzb2", "lbf-ft")]).expect_err("bad unit");
    assert_eq!(unit.to_string(), "run.outb: RootMzb2 is in \"lbf-ft\"; kN-m or N-m is needed");
    let good = read(vec![channel("BldPitch2", "deg"), channel("RootMzb2", "kN-m")]).expect("reads");
    assert!((good.moment_nm[3] - 3000.0).abs() < 1e-9);
    assert!((good.pitch_rad[3] - 3.0_f64.to_radians()).abs() < 1e-12);
}

#[test]
fn a_bad_csv_cell_is_named_by_line_and_column() {
    let path = std::env::temp_dir().join(format!("pitchleak-wind-{}.csv", std::process::id()));
    std::fs::write(&path, "t_s,pitch_deg,pitch_moment_Nm\n0,1,2\n0.1,x,2\n").expect("writes");
    let error = History::of(&Wind::File(path.clone())).expect_err("bad cell");
    std::fs::remove_file(&path).expect("removes");
    assert!(error.to_string().ends_with("line 3, column pitch_deg: not a finite number"), "{error}");
}

#[test]
fn pitch_beyond_the_stroke_is_held_at_the_guard() {
    let t_s: Vec<f64> = (0..200).map(|k| 0.05 * f64::from(k)).collect();
    let history = History {
        pitch_rad: t_s.iter().map(|t| (10.0 * t).to_radians()).collect(),
        moment_nm: vec![5e3; 200],
        wind_mps: None,
        t_s,
    };
    let reference = Emulation::paper().reference(&history, STROKE_M).expect("is held");
    assert!((reference.position_m.at(0.0) - 1e-3).abs() < 1e-12);
    assert!((reference.position_m.at(9.9) - 0.199).abs() < 1e-12);
    assert!(reference.clipped_share > 0.4 && reference.clipped_share < 0.6);
}

/// The linkage, the sign of the moment and the inertia against independently made columns.
#[test]
fn val_rig_position_and_force() {
    for name in ["wind/rig_13mps.csv.gz", "wind/rig_30mps.csv.gz"] {
        let path = data(name);
        let history = History::of(&Wind::File(path.clone())).expect("reads");
        let reference = Emulation::paper().reference(&history, STROKE_M).expect("fits");
        let file = std::fs::File::open(&path).expect("opens");
        let mut rows = csv::Reader::from_reader(flate2::read::GzDecoder::new(file));
        let rows: Vec<[f64; 5]> = rows.deserialize().map(|row| row.expect("a row")).collect();
        assert_eq!(rows.len(), 3001);
        // The first and the last window of a derivative are each program's own.
        for &[t, _, _, x, force] in &rows[20..2980] {
            assert!((reference.position_m.at(t) - x).abs() < 1e-6, "x at {t} s of {name}");
            let turbine = reference.load_n.at(t) * Emulation::paper().load_scale;
            assert!((turbine / 1000.0 - force).abs() < 0.02, "{turbine} N for {force} kN at {t} s of {name}");
        }
    }
}

#[test]
fn val_all_forms_of_one_openfast_run_give_one_reference() {
    let reference = |name: &str| {
        let history = History::of(&Wind::File(data("openfast").join(name))).expect("reads");
        Emulation::paper().reference(&history, STROKE_M).expect("fits")
    };
    let text = reference("wp15_13mps.out");
    let full = reference("wp15_13mps_uncompressed.outb");
    let packed = reference("wp15_13mps.outb");
    for k in 0..50 {
        let t = 60.0 + 0.1 * f64::from(k);
        assert!((text.position_m.at(t) - full.position_m.at(t)).abs() < 1e-8);
        assert!((packed.position_m.at(t) - full.position_m.at(t)).abs() < 2e-6);
        assert!(
            (packed.load_n.at(t) - full.load_n.at(t)).abs() < 5.0,
            "{}",
            packed.load_n.at(t) - full.load_n.at(t)
        );
    }
}
