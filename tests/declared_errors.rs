//! Errors of sensors that the rig file declares: the intervals of the leaks hold all the same.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::core::{Leak, PerLeak, Rls, RlsSettings, Sample, Sensors};
use pitchleak::simulate::{LeakCourse, LeakSize, Scenario, Truth};
use pitchleak::units::LPM_PER_M3S;
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use pitchleak_testkit::{coverage_bounds, noisy, seeded};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

const SEEDS: u64 = 60;
const DURATION_S: f64 = 60.0;
const LEAKS_M3SPA: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 2e-12, external_b: 0.0 };

/// A sensor's reading through a run of which this share has passed.
type Wrong = fn(&mut Sample<f64>, [f64; 2], f64);

fn truths(wind: WindCase) -> Vec<Truth> {
    let history = History::of(&Wind::BuiltIn(wind)).unwrap();
    let rig = Rig::paper();
    let reference = Emulation::paper().reference(&history, rig.cylinder.stroke_m).unwrap();
    let scenario = Scenario {
        leaks: LEAKS_M3SPA.map(|size| LeakCourse::from_onset(LeakSize::Coefficient(size), 0.0)),
        duration_s: DURATION_S,
        ..Scenario::new(rig, reference)
    };
    scenario.collect(LEAKS_M3SPA).unwrap()
}

/// Which leaks' intervals hold at the end of a run whose sensors are wrong by random draws.
fn held<const N: usize>(truths: &[Truth], sensors: &Sensors<f64>, wrong: Wrong, seed: u64) -> PerLeak<bool> {
    let rig = Rig::paper();
    let mut rls = Rls::<f64, N>::new(rig.cylinder, rig.fluid, sensors, RlsSettings::default()).unwrap();
    let mut random = seeded(seed);
    let draws = [(); 2].map(|()| StandardNormal.sample(&mut random));
    for (index, truth) in truths.iter().enumerate() {
        let mut sample = truth.sample;
        wrong(&mut sample, draws, index as f64 / truths.len() as f64);
        rls.update(0.01, &noisy(&sample, sensors, &mut random));
    }
    let found = rls.estimates().leaks_m3spa;
    PerLeak::from_fn(|leak| (found[leak].value - LEAKS_M3SPA[leak]).abs() <= found[leak].half_width95())
}

/// Share of the intervals of each leak that hold, over two winds.
fn assert_covers<const N: usize>(name: &str, sensors: impl Fn(f64) -> Sensors<f64>, wrong: Wrong) {
    let [least, _] = coverage_bounds(0.95, SEEDS);
    for wind in [WindCase::Mps13, WindCase::Mps21] {
        let truths = truths(wind);
        for accuracy in [0.001, 0.003, 0.01] {
            let sensors = sensors(accuracy);
            let runs: Vec<PerLeak<bool>> =
                (0..SEEDS).into_par_iter().map(|seed| held::<N>(&truths, &sensors, wrong, seed)).collect();
            for leak in Leak::ALL {
                let share = runs.iter().filter(|run| run[leak]).count() as f64 / SEEDS as f64;
                println!("{name}, {wind:?}, {accuracy}, {}: {:.1} %", leak.id(), 100.0 * share);
                assert!(share >= least, "{name}, {wind:?}, {accuracy}, {leak:?}: {share}");
            }
        }
    }
}

fn sensors(accuracy: f64) -> Sensors<f64> {
    let mut rig = Rig::paper();
    rig.instruments = rig.instruments.with_accuracy(accuracy);
    rig.sensors()
}

const FULL_SCALE_M3S: f64 = 20.0 / LPM_PER_M3S;

#[test]
fn a_declared_position_gain_is_cured() {
    let declared = |accuracy| {
        let mut sensors = sensors(accuracy);
        sensors.position.gain_std = 0.02;
        sensors
    };
    assert_covers::<9>("position gain 2 %", declared, |sample, [gain, _], _| sample.x_m *= 1.0 + 0.02 * gain);
}

/// Zeros that move by 1 % of full scale (1 σ) through the run.
#[test]
fn a_declared_drift_is_cured() {
    let declared = |accuracy| {
        let mut sensors = sensors(accuracy);
        for meter in [&mut sensors.flow_a, &mut sensors.flow_b] {
            meter.drift_std_ph = 0.01 * FULL_SCALE_M3S * 3600.0 / DURATION_S;
        }
        sensors
    };
    let drift: Wrong = |sample, [a, b], passed| {
        let off = |draw: f64| 0.01 * FULL_SCALE_M3S * draw * passed;
        sample.qa_m3s = sample.qa_m3s.map(|flow| flow + off(a));
        sample.qb_m3s = sample.qb_m3s.map(|flow| flow + off(b));
    };
    assert_covers::<6>("drift 1 %", declared, drift);
}

#[test]
fn declared_offsets_are_cured() {
    let declared = |accuracy| {
        let mut sensors = sensors(accuracy);
        sensors.flow_a.bias_std = 0.01 * FULL_SCALE_M3S;
        sensors.flow_b.bias_std = 0.01 * FULL_SCALE_M3S;
        sensors
    };
    let offset: Wrong = |sample, [a, b], _| {
        sample.qa_m3s = sample.qa_m3s.map(|flow| flow + 0.01 * FULL_SCALE_M3S * a);
        sample.qb_m3s = sample.qb_m3s.map(|flow| flow + 0.01 * FULL_SCALE_M3S * b);
    };
    assert_covers::<6>("offset 1 %", declared, offset);
}
