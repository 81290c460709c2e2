//! Statistics of the default estimator over noise seeds: do its intervals cover, is it efficient, does a
//! sound cylinder stay silent?

use pitchleak::core::{Fluid, LeakDetector, PerLeak, Rls, RlsSettings, Sensors, Update};
use pitchleak_reproduce::cramer_rao::CramerRaoModel;
use pitchleak_testkit::{Motion, NormalScatter, coverage_bounds, noisy, seeded, sensors_of};
use rand::RngExt;

const DT_S: f64 = 0.01;
/// 3 σ of the sensors' noise, share of full scale.
const ACCURACIES: [f64; 3] = [0.01, 0.003, 0.001];
/// Root mean square error over the Cramér–Rao bound that the README claims.
const EFFICIENCY: f64 = 1.02;
/// Mean error over the bound that noise in the regressors may leave, as docs/estimators.md says.
const BIAS: f64 = 0.1;
/// Share of the 95 % intervals that hold the truth, as claimed there.
const COVERAGE: f64 = 0.957;
/// Runs per accuracy and leak, each with noise of its own.
const SEEDS: u64 = 1000;

fn leaks(internal: f64, external_a: f64, external_b: f64) -> PerLeak<f64> {
    PerLeak { internal, external_a, external_b }
}

fn mean(values: PerLeak<f64>) -> f64 {
    values.iter().map(|(_, value)| value / 3.0).sum()
}

/// What `SEEDS` runs of one setting say.
#[derive(Default)]
struct Statistics {
    /// Share of the 95 % intervals that hold the truth.
    coverage: PerLeak<f64>,
    /// Mean square error over the Cramér–Rao bound's variance.
    mean_square: PerLeak<f64>,
    /// Mean error over the bound's standard deviation.
    bias: PerLeak<f64>,
}

fn run(motion: &Motion, sensors: &Sensors<f64>, first_seed: u64) -> Statistics {
    let fluid = Fluid::paper();
    let clean = motion.samples(60);
    let model = CramerRaoModel { cylinder: &motion.cylinder, fluid: &fluid, sensors, leaks: &motion.leaks };
    let bound = model.bound(DT_S, &clean).expect("is a trace").leak_std;
    let truth = motion.leaks;
    let mut found = Statistics::default();
    for seed in first_seed..first_seed + SEEDS {
        let mut random = seeded(seed);
        let mut rls = Rls::<f64, 4>::new(motion.cylinder, fluid, sensors, RlsSettings::default())
            .expect("a rig that can be");
        for sample in &clean {
            rls.update(DT_S, &noisy(sample, sensors, &mut random));
        }
        for (leak, estimate) in rls.leak_coefficients() {
            let [low, high] = estimate.ci95();
            let error = (estimate.value - truth[leak]) / bound[leak];
            found.coverage[leak] += f64::from(u8::from((low..=high).contains(&truth[leak]))) / SEEDS as f64;
            found.mean_square[leak] += error * error / SEEDS as f64;
            found.bias[leak] += error / SEEDS as f64;
        }
    }
    found
}

/// Each figure within what its number of seeds lets it scatter around the claim, per setting and over all.
#[test]
fn intervals_cover_and_errors_reach_the_bound() {
    let motions = [
        ("sound", leaks(0.0, 0.0, 0.0)),
        ("internal", leaks(1.2e-11, 0.0, 0.0)),
        ("external", leaks(0.0, 4e-12, 2.5e-12)),
        ("all", leaks(1e-11, 3e-12, 2e-12)),
    ];
    let settings = ACCURACIES.iter().flat_map(|accuracy| motions.iter().map(move |m| (*accuracy, m)));
    let one = NormalScatter { n: SEEDS };
    let (mut coverage, mut mean_square, mut runs) = (0.0, 0.0, 0);
    for (at, (accuracy, (name, truth))) in (0..).zip(settings) {
        let found = run(&Motion::wind_like(*truth), &sensors_of(accuracy), at * SEEDS);
        let rms = found.mean_square.map(f64::sqrt);
        println!(
            "{} % of full scale, {name}: cover {:.3?}, rms/bound {rms:.3?}, bias/bound {:.3?}",
            100.0 * accuracy,
            found.coverage,
            found.bias
        );
        let within = |value: f64, [low, high]: [f64; 2]| (low..=high).contains(&value);
        assert!(rms.iter().all(|(_, rms)| within(*rms, one.rms_bounds(EFFICIENCY))), "{name} at {accuracy}");
        assert!(
            found.bias.iter().all(|(_, bias)| bias.abs() < BIAS + one.mean_bound(EFFICIENCY)),
            "{name} at {accuracy}"
        );
        let covers = |share: f64| within(share, coverage_bounds(COVERAGE, SEEDS));
        assert!(found.coverage.iter().all(|(_, share)| covers(*share)), "{name} at {accuracy}");
        coverage += mean(found.coverage);
        mean_square += mean(found.mean_square);
        runs += 1;
    }
    // The three leaks of a run share its noise: only runs count as independent.
    let (coverage, rms) = (coverage / runs as f64, f64::sqrt(mean_square / runs as f64));
    println!("all: cover {coverage:.4}, rms/bound {rms:.4}");
    let all = NormalScatter { n: SEEDS * runs };
    let [low, high] = all.rms_bounds(EFFICIENCY);
    assert!((low..=high).contains(&rms), "{rms} of the bound, {low} to {high} expected");
    let [low, high] = coverage_bounds(COVERAGE, SEEDS * runs);
    assert!((low..=high).contains(&coverage), "{coverage} covered, {low} to {high} expected");
}

/// A sound cylinder raises no alarm, whatever the offsets of its meters.
#[test]
fn a_sound_cylinder_stays_silent() {
    let mut declared = sensors_of(0.01);
    declared.flow_a.bias_std = 0.005 * 20.0 / 6e4;
    declared.flow_b.bias_std = declared.flow_a.bias_std;
    declared.pressure.bias_std = 0.005 * 16e6;
    let motion = Motion::wind_like(PerLeak::default());
    let clean = motion.samples(60);
    let mut alarms = 0;
    for seed in 0..200 {
        let mut random = seeded(1000 + seed);
        let mut bias = |full_scale: f64| full_scale * 0.01 * (2.0 * random.random::<f64>() - 1.0);
        let (qa, qb) = (bias(20.0 / 6e4), bias(20.0 / 6e4));
        let (pa, pb) = (bias(16e6), bias(16e6));
        let mut rls =
            Rls::<f64, 6>::new(motion.cylinder, Fluid::paper(), &declared, RlsSettings::default()).unwrap();
        let mut detector = LeakDetector::new(pitchleak::core::AlarmSettings::default());
        for sample in &clean {
            let mut reading = noisy(sample, &declared, &mut random);
            reading.qa_m3s = reading.qa_m3s.map(|q| q + qa);
            reading.qb_m3s = reading.qb_m3s.map(|q| q + qb);
            reading.pa_pa += pa;
            reading.pb_pa += pb;
            if let Update::Renewed { elapsed_s, .. } = rls.update(DT_S, &reading) {
                let change = detector.update(elapsed_s, &rls.estimates().mean_leaks_m3s);
                alarms += change.iter().filter(|(_, change)| change.is_some()).count();
            }
        }
    }
    assert_eq!(alarms, 0);
}
