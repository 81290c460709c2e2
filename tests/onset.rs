//! Alarms, as README and docs/reproduction.md claim them: a leak that opens is found soon and named alone, and a sound
//! cylinder raises none.

use pitchleak::core::{Leak, PerLeak};
use pitchleak::replay::Replay;
use pitchleak::simulate::{Biases, LeakCourse, LeakSize, Scenario, Sensing, Truth};
use pitchleak::trace::Record;
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use pitchleak_reproduce::{Run, SAMPLE_RATE_HZ, rig};
use rayon::prelude::*;
use std::thread;

const ONSET_S: f64 = 60.0;
const LPM: f64 = 1.0 / 60e3;

/// A minute of sound operation, then `leak` of this size on average.
fn opening(wind: WindCase, leak: Leak, size_lpm: f64) -> Vec<Truth> {
    let history = History::of(&Wind::BuiltIn(wind)).expect("is built in");
    let size = |which| {
        let size = LeakSize::MeanFlow(if which == leak { size_lpm * LPM } else { 0.0 });
        LeakCourse::from_onset(size, ONSET_S)
    };
    let reference = Emulation::paper().reference(&history, rig().cylinder.stroke_m).expect("fits");
    let scenario = Scenario {
        leaks: PerLeak::from_fn(size),
        duration_s: ONSET_S + 15.0,
        sample_rate_hz: SAMPLE_RATE_HZ,
        ..Scenario::new(rig(), reference)
    };
    let open = Scenario { start_s: 10.0 + ONSET_S, duration_s: 60.0, ..scenario.clone() };
    scenario.collect(open.leak_coefficients().expect("within reach")).expect("runs")
}

/// Calls `at` after each sample, as the paper's sensors read the run, with whether the estimates are new.
fn run(truths: &[Truth], seed: u64, mut at: impl FnMut(&Replay, &Record, bool)) {
    let mut sensing = Sensing::new(rig().sensors(), Biases::default(), seed);
    let mut replay = Replay::new(&rig()).expect("a rig");
    for (index, truth) in truths.iter().enumerate() {
        let dt_s = if index == 0 { 0.0 } else { 1.0 / SAMPLE_RATE_HZ };
        let sample = sensing.read(&truth.sample);
        let record = Record { t_s: truth.t_s, dt_s, sample, ..Record::default() };
        let renewed = replay.push(&record);
        at(&replay, &record, renewed);
    }
}

/// Calls `at` with the alarms that stand whenever the estimates are new.
fn watch(truths: &[Truth], seed: u64, mut at: impl FnMut(f64, PerLeak<bool>)) {
    run(truths, seed, |replay, record, renewed| {
        if renewed {
            at(record.t_s, replay.estimate_row(record).active);
        }
    });
}

/// Every wind and leak at twice and five times the threshold of 0.1 L/min, and a large one: sizes and how soon.
#[test]
fn a_sudden_leak_is_named_alone_and_soon() {
    let each = |size_lpm, within_s| {
        WindCase::ALL.into_iter().flat_map(move |wind| Leak::ALL.map(|leak| (wind, leak, size_lpm, within_s)))
    };
    let large = [(WindCase::Mps13, Leak::ExternalB, 1.0, 4.5)];
    let cases: Vec<_> = each(0.2, 7.0).chain(each(0.5, 4.5)).chain(large).collect();
    cases.into_par_iter().for_each(|(wind, leak, size_lpm, within_s)| {
        let truths = opening(wind, leak, size_lpm);
        for seed in 0..5 {
            watch(&truths, seed, |t_s, active| {
                for (which, alarm) in active {
                    let at = format!("{wind:?}, {leak:?} of {size_lpm} L/min, seed {seed}, {t_s} s");
                    assert!(!alarm || which == leak && t_s >= ONSET_S, "wrong alarm: {at}");
                    assert!(alarm || which != leak || t_s < ONSET_S + within_s, "no alarm: {at}");
                }
            });
        }
    });
}

/// A hose that bursts takes its chamber's pressure away, and where a leak opened the pressures swing: for seconds it looks like a meter's zero
/// that jumps. No such leak is ruled out.
#[test]
fn a_leak_that_has_just_opened_is_not_ruled_out() {
    let each = |size_lpm| {
        WindCase::ALL.into_iter().flat_map(move |wind| Leak::ALL.map(|leak| (wind, leak, size_lpm)))
    };
    let large = [(WindCase::Mps13, Leak::ExternalB, 1.0), (WindCase::Mps21, Leak::ExternalB, 0.7)];
    let cases: Vec<_> = each(0.2).chain(each(0.5)).chain(large).collect();
    cases.into_par_iter().for_each(|(wind, leak, size_lpm)| {
        let truths = opening(wind, leak, size_lpm);
        for seed in 0..4 {
            run(&truths, seed, |replay, record, _| {
                let open_s = record.t_s - ONSET_S;
                if [3.0, 5.0, 8.0, 15.0].into_iter().any(|at_s| (open_s - at_s).abs() < 1e-6) {
                    let ruled_out = replay.decision().expect("enough to weigh").ruled_out;
                    let at = format!("{wind:?}, {leak:?} of {size_lpm} L/min, seed {seed}, {open_s} s after");
                    assert!(!ruled_out.contains(&leak), "{at}");
                }
            });
        }
    });
}

#[test]
fn no_false_alarm_in_a_hundred_hours() {
    const SECONDS: f64 = 100.0 * 3600.0;
    thread::scope(|scope| {
        for (wind, first_seed) in WindCase::ALL.into_iter().zip([0, 10_000, 20_000, 30_000]) {
            scope.spawn(move || {
                let run = Run::simulate(wind, PerLeak::default()).expect("runs");
                let runs = (SECONDS / 4.0 * SAMPLE_RATE_HZ / run.truths.len() as f64).ceil() as u64;
                for seed in first_seed..first_seed + runs {
                    watch(&run.truths, seed, |t_s, active| {
                        assert!(active.iter().all(|(_, alarm)| !alarm), "{wind:?}, seed {seed}, {t_s} s");
                    });
                }
            });
        }
    });
}
