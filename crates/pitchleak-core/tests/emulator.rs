//! The rig of Section III follows its references and stays within numbers.
#![allow(clippy::unwrap_used)] // helpers of tests are no tests to clippy

use pitchleak_core::plant::PlantError;
use pitchleak_core::{Emulator, EmulatorParams, Model, PerLeak};
use proptest::prelude::*;

fn rig(leaks: PerLeak<f64>) -> EmulatorParams<f64> {
    EmulatorParams::for_model(Model { leaks_m3spa: leaks, ..Model::paper() }).unwrap()
}

/// Root-mean-square tracking errors over the second half of 20 s: position as a share of the
/// stroke, load as a share of the load's largest value; and the range of pressures seen.
fn tracking(leaks: PerLeak<f64>, amplitude_m: f64, hertz: f64) -> (f64, f64, [f64; 2]) {
    let position = |t: f64| {
        let w = std::f64::consts::TAU * hertz * t;
        0.08 + amplitude_m * (0.7 * w.sin() + 0.3 * (2.3 * w).sin())
    };
    let load = |t: f64| 1500.0 + 900.0 * (1.9 * t).sin() + 300.0 * (7.0 * t + 1.0).sin();
    let mut rig = Emulator::new(rig(leaks), position(0.0), load(0.0)).unwrap();
    let (mut position_square, mut load_square, mut range) = (0.0, 0.0, [f64::MAX, f64::MIN]);
    for i in 1..=2000 {
        let t = f64::from(i) * 0.01;
        rig.step(0.01, position(t), load(t)).unwrap();
        let now = rig.reading().signals;
        if i > 1000 {
            position_square += (now.x_m - position(t)).powi(2) / 1000.0;
            load_square += (now.force_n - load(t)).powi(2) / 1000.0;
            range = [range[0].min(now.pa_pa).min(now.pb_pa), range[1].max(now.pa_pa).max(now.pb_pa)];
        }
    }
    (position_square.sqrt() / 0.2, load_square.sqrt() / 2700.0, range)
}

#[test]
fn follows_wind_like_references_healthy_and_leaking() {
    let large = PerLeak { internal: 2e-11, external_a: 8e-12, external_b: 0.0 };
    for (leaks, amplitude, hertz) in [
        (PerLeak::default(), 0.02, 0.2),
        (large, 0.02, 0.2),
        (PerLeak::default(), 0.05, 0.35),
        (large, 0.05, 0.35),
        (PerLeak::default(), 0.0, 0.2),
    ] {
        let (position, load, range) = tracking(leaks, amplitude, hertz);
        println!("{leaks:?} {amplitude} m {hertz} Hz: position {position:.4}, load {load:.4}, {range:?} Pa");
        assert!(position < 0.01, "position error {position}");
        assert!(load < 0.1, "load error {load}");
        assert!(range[0] > 0.0 && range[1] < 10.4e6, "pressures {range:?}");
    }
}

/// The signals of the rig obey eq. (1)–(2) of its own model.
#[test]
fn readings_obey_the_declared_model() {
    let leaks = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 1e-12 };
    let mut rig = Emulator::new(rig(leaks), 0.05, 1000.0).unwrap();
    for i in 0..300 {
        let t = f64::from(i) * 0.01;
        rig.step(0.01, 0.05 + 0.01 * t, 1000.0 + 200.0 * t).unwrap();
        let now = rig.reading();
        let residual = rig.params().pitch.plant.model.residual(&now.signals);
        assert!(residual.chamber_a_m3s.abs() < 1e-12 && residual.chamber_b_m3s.abs() < 1e-12, "{residual:?}");
        assert!(residual.force_n.abs() < 1e-6, "{residual:?}");
        let expected = 1e-11 * (now.signals.pa_pa - now.signals.pb_pa);
        assert!((now.leaks_m3s.internal - expected).abs() < 1e-15);
    }
}

/// Fine pitch at 5 m/s puts the piston 1.4 mm from the A end, with no dead volume there.
#[test]
fn holds_fine_pitch_next_to_the_end() {
    let mut rig = Emulator::new(rig(PerLeak::default()), 0.0014, 500.0).unwrap();
    for i in 1..=500 {
        let t = f64::from(i) * 0.01;
        rig.step(0.01, 0.0014, 500.0 + 300.0 * (2.0 * t).sin()).unwrap();
        let now = rig.reading().signals;
        assert!((now.x_m - 0.0014).abs() < 1e-4 && now.v_mps.abs() < 0.01, "at {t} s: {now:?}");
    }
}

/// On a microcontroller's numbers the same rig shows the same signals.
#[test]
fn f32_follows_f64() {
    let mut wide = Emulator::new(rig(PerLeak::default()), 0.08, 1000.0).unwrap();
    let narrow_rig = EmulatorParams::for_model(Model::<f32>::paper()).unwrap();
    let mut narrow = Emulator::new(narrow_rig, 0.08, 1000.0).unwrap();
    for i in 1..=1000_u16 {
        let t = f32::from(i) * 0.01;
        let (x, f) = (0.08 + 0.01 * (1.5 * t).sin(), 1000.0 + 500.0 * t.sin());
        wide.step(0.01, f64::from(x), f64::from(f)).unwrap();
        narrow.step(0.01, x, f).unwrap();
        let (a, b) = (wide.reading().signals, narrow.reading().signals);
        assert!((a.x_m - f64::from(b.x_m)).abs() < 1e-4, "x at {t} s: {} {}", a.x_m, b.x_m);
        assert!((a.pa_pa - f64::from(b.pa_pa)).abs() < 1e5, "P_A at {t} s: {} {}", a.pa_pa, b.pa_pa);
        assert!((a.force_n - f64::from(b.force_n)).abs() < 50.0, "F at {t} s: {} {}", a.force_n, b.force_n);
    }
}

#[test]
fn a_step_that_is_no_step_is_refused() {
    let mut rig = Emulator::new(rig(PerLeak::default()), 0.1, 0.0).unwrap();
    let before = rig;
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e12] {
        assert_eq!(rig.step(step, 0.1, 0.0), Err(PlantError::Step));
    }
    assert_eq!(rig, before);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn every_reading_is_a_number(
        start in any::<f64>(), load in any::<f64>(),
        references in proptest::collection::vec((any::<f64>(), any::<f64>(), -0.5..0.7, -2e4..2e4, any::<bool>()), 1..20),
    ) {
        let leaks = PerLeak { internal: 1e-9, external_a: 1e-9, external_b: 1e-9 };
        let mut rig = Emulator::new(rig(leaks), start, load).unwrap();
        for (wild_x, wild_f, x, f, wild) in references {
            let (x, f) = if wild { (wild_x, wild_f) } else { (x, f) };
            rig.step(0.02, x, f).unwrap();
            let now = rig.reading();
            let m = now.signals;
            for value in [m.x_m, m.v_mps, m.a_mps2, m.pa_pa, m.pb_pa, m.dpa_pas, m.dpb_pas, m.qa_m3s, m.qb_m3s,
                m.force_n, now.supply_pa, now.pitch_command, now.load_command, now.leaks_m3s.internal] {
                prop_assert!(value.is_finite(), "{now:?}");
            }
        }
    }
}
