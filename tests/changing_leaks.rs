//! Leaks that change: does the estimator follow them, does its interval hold the leak of the moment, does it tell the
//! trend?

#![allow(clippy::unwrap_used)]

use pitchleak::core::{
    Emulator, EmulatorParams, Estimate, Leak, Model, PerLeak, Rls, RlsSettings, Sample, Update,
};
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use pitchleak_testkit::{noisy, seeded};

const DT_S: f64 = 0.01;
const LPM_PER_M3S: f64 = 60e3;
const SEEDS: u64 = 10;
/// The estimates count from here on, s.
const START_S: f64 = 10.0;
/// Accuracies, 3σ as a share of full scale, %.
const ACCURACIES: [f64; 3] = [0.1, 0.3, 1.0];

/// What was there, sample by sample.
struct Truth {
    samples: Vec<Sample<f64>>,
    leaks_m3spa: Vec<PerLeak<f64>>,
    /// Means of |P_L|, P_A, P_B, Pa: they turn coefficients into flows.
    pressures_pa: PerLeak<f64>,
}

impl Truth {
    /// The paper's rig in a wind, with leaks as `leaks_m3spa` gives them over time.
    fn simulate(wind: WindCase, duration_s: f64, leaks_m3spa: impl Fn(f64) -> PerLeak<f64>) -> Self {
        let rig = pitchleak_reproduce::rig();
        let history = History::of(&Wind::BuiltIn(wind)).unwrap();
        let reference = Emulation::paper().reference(&history, rig.cylinder.stroke_m).unwrap();
        // There and back again, so that a run may be longer than the wind.
        let (begin, end) = reference.span_s().unwrap();
        let fold = |t_s: f64| {
            let span = end - begin - 1.0;
            let turn = (t_s + 10.0) % (2.0 * span);
            begin + if turn < span { turn } else { 2.0 * span - turn }
        };
        let model = Model { cylinder: rig.cylinder, fluid: rig.fluid, leaks_m3spa: PerLeak::default() };
        let params = EmulatorParams { internal_step_s: 1e-3, ..EmulatorParams::for_model(model).unwrap() };
        let at = |t_s: f64| (reference.position_m.at(fold(t_s)), reference.load_n.at(fold(t_s)));
        let (position_m, load_n) = at(-10.0);
        let mut emulator = Emulator::new(params, position_m, load_n).unwrap();
        let mut truth =
            Self { samples: Vec::new(), leaks_m3spa: Vec::new(), pressures_pa: PerLeak::default() };
        let samples = (duration_s / DT_S).round() as i32;
        for k in -1000..samples {
            let t_s = f64::from(k) * DT_S;
            let leaks = leaks_m3spa(t_s.max(0.0));
            emulator.set_leaks(leaks).unwrap();
            if k >= 0 {
                let now = emulator.reading().signals;
                truth.samples.push(Sample {
                    x_m: now.x_m,
                    pa_pa: now.pa_pa,
                    pb_pa: now.pb_pa,
                    qa_m3s: Some(now.qa_m3s),
                    qb_m3s: Some(now.qb_m3s),
                    force_n: None,
                });
                truth.leaks_m3spa.push(leaks);
                let share = 1.0 / f64::from(samples);
                truth.pressures_pa.internal += share * (now.pa_pa - now.pb_pa).abs();
                truth.pressures_pa.external_a += share * now.pa_pa;
                truth.pressures_pa.external_b += share * now.pb_pa;
            }
            for step in 1..=10 {
                let (position_m, load_n) = at(t_s + f64::from(step) * 1e-3);
                emulator.step(1e-3, position_m, load_n).unwrap();
            }
        }
        truth
    }
}

/// What many seeds showed of one leak.
#[derive(Clone, Copy, Default)]
struct Tally {
    inside: f64,
    square_lpm: f64,
    count: f64,
    trends_inside: f64,
    changes: f64,
}

fn holds(estimate: &Estimate<f64>, truth: f64) -> f64 {
    let [low, high] = estimate.ci95();
    f64::from(u8::from((low..=high).contains(&truth)))
}

fn estimate(truth: &Truth, accuracy_percent: f64, leak: Leak) -> Tally {
    let rig = pitchleak_reproduce::rig();
    let sensors = rig.instruments.with_accuracy(accuracy_percent / 100.0).spread();
    let mut tally = Tally::default();
    for seed in 0..SEEDS {
        let mut random = seeded(seed);
        let settings = RlsSettings::default();
        let mut rls = Rls::<f64, 4>::new(rig.cylinder, rig.fluid, &sensors, settings).unwrap();
        for (k, sample) in truth.samples.iter().enumerate() {
            let update = rls.update(DT_S, &noisy(sample, &sensors, &mut random));
            let Update::Renewed { changed, .. } = update else { continue };
            tally.changes += f64::from(u8::from(changed));
            if k as f64 * DT_S > START_S {
                let found = rls.leak_coefficients()[leak];
                let now = truth.leaks_m3spa[k][leak];
                tally.inside += holds(&found, now);
                tally.square_lpm += ((found.value - now) * truth.pressures_pa[leak] * LPM_PER_M3S).powi(2);
                tally.count += 1.0;
            }
        }
        let [.., before, last] = truth.leaks_m3spa[..] else { continue };
        let slope = (last[leak] - before[leak]) / DT_S;
        tally.trends_inside += holds(&rls.estimates().leak_slopes_m3spa_ps[leak], slope);
    }
    tally
}

/// Runs `leaks` in all winds at all accuracies; gives the share of time, over all, in which the interval holds the leak
/// of the moment, and the share of runs at whose end that of the trend holds it.
fn run(name: &str, duration_s: f64, leak: Leak, flow_lpm: impl Fn(f64) -> f64) -> [(f64, f64); 3] {
    let pressure_pa = PerLeak { internal: 1.5e6, external_a: 5e6, external_b: 5e6 }[leak];
    let course = |t_s: f64| {
        let mut leaks = PerLeak::default();
        leaks[leak] = flow_lpm(t_s) / LPM_PER_M3S / pressure_pa;
        leaks
    };
    let truths = WindCase::ALL.map(|wind| Truth::simulate(wind, duration_s, course));
    ACCURACIES.map(|accuracy| {
        let tallies = truths.each_ref().map(|truth| estimate(truth, accuracy, leak));
        let sum = |of: fn(&Tally) -> f64| tallies.iter().map(of).sum::<f64>();
        let coverage = sum(|t| t.inside) / sum(|t| t.count);
        let trends = sum(|t| t.trends_inside) / (SEEDS * 4) as f64;
        let rms = tallies.map(|t| (t.square_lpm / t.count).sqrt());
        println!(
            "{name} {}, {accuracy} %: holds the leak {:.1} % of the time, the trend in {:.0} %, rms {rms:.5?} L/min, {} restarts",
            leak.label(),
            100.0 * coverage,
            100.0 * trends,
            sum(|t| t.changes),
        );
        (coverage, trends)
    })
}

#[test]
fn a_leak_that_grows_is_followed() {
    for leak in [Leak::Internal, Leak::ExternalA] {
        for (coverage, trends) in run("grows", 300.0, leak, |t_s| 0.5 * t_s / 300.0) {
            assert!(coverage >= 0.9, "{coverage} of the time");
            assert!(trends >= 0.85, "{trends} of the trends");
        }
    }
}

#[test]
fn a_leak_that_drifts_with_the_oil_is_followed() {
    // After a minute's drift the leak stays: for some seconds the trend goes on, and better sensors are surer of it.
    for (warm_up_s, least) in [(60.0, 0.8), (120.0, 0.83)] {
        let drift = |t_s: f64| 0.5 * (1.0 + 0.3 * (t_s / warm_up_s).min(1.0));
        for (coverage, _) in run(&format!("drifts for {warm_up_s} s"), 120.0, Leak::Internal, drift) {
            assert!(coverage >= least, "{coverage} of the time");
        }
    }
}

#[test]
fn a_leak_that_stays_is_known_better_and_better() {
    for (coverage, trends) in run("stays", 600.0, Leak::Internal, |_| 0.5) {
        assert!((0.93..=0.985).contains(&coverage), "{coverage} of the time");
        assert!(trends >= 0.85, "{trends} of the trends");
    }
}

#[test]
fn a_leak_that_comes_and_goes_is_followed() {
    let comes_and_goes = |t_s: f64| if t_s % 60.0 > 50.0 { 0.5 } else { 0.0 };
    for (coverage, _) in run("comes and goes", 300.0, Leak::ExternalA, comes_and_goes) {
        assert!(coverage >= 0.9, "{coverage} of the time");
    }
}
