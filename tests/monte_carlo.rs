//! Statistics of the default estimator over noise seeds: do its intervals cover, is it efficient, does a
//! sound cylinder stay silent?

#![allow(clippy::unwrap_used)]

mod synthetic;

use pitchleak::core::{Fluid, LeakDetector, PerLeak, Rls, RlsSettings, Sample, Sensors, Update};
use pitchleak::cramer_rao::CramerRaoModel;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use synthetic::Motion;

const DT_S: f64 = 0.01;

fn leaks(internal: f64, external_a: f64, external_b: f64) -> PerLeak<f64> {
    PerLeak { internal, external_a, external_b }
}

/// Sensors of the paper with another accuracy.
fn sensors(accuracy_of_paper: f64) -> Sensors<f64> {
    let mut s = Sensors::paper();
    for spread in [&mut s.flow_a, &mut s.flow_b, &mut s.pressure, &mut s.position] {
        spread.noise_std *= accuracy_of_paper;
    }
    s
}

/// A minute of exact readings.
fn minute(motion: &Motion) -> Vec<Sample<f64>> {
    (0..6000).map(|k| motion.sample(f64::from(k) * DT_S)).collect()
}

/// The sample as the sensors read it: white noise on every channel.
fn noisy(sample: &Sample<f64>, sensors: &Sensors<f64>, rng: &mut ChaCha8Rng) -> Sample<f64> {
    let mut normal = |std: f64| std * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, rng);
    Sample {
        x_m: sample.x_m + normal(sensors.position.noise_std),
        pa_pa: sample.pa_pa + normal(sensors.pressure.noise_std),
        pb_pa: sample.pb_pa + normal(sensors.pressure.noise_std),
        qa_m3s: sample.qa_m3s.map(|q| q + normal(sensors.flow_a.noise_std)),
        qb_m3s: sample.qb_m3s.map(|q| q + normal(sensors.flow_b.noise_std)),
        force_n: sample.force_n,
    }
}

struct Statistics {
    covered: f64,
    efficiency: PerLeak<f64>,
    worst_bias: f64,
}

fn run(motion: &Motion, sensors: &Sensors<f64>, seeds: u64) -> Statistics {
    let fluid = Fluid { bulk_modulus_pa: motion.bulk_modulus_pa, bulk_modulus_std_pa: 0.2e9 };
    let clean = minute(motion);
    let model = CramerRaoModel { cylinder: &motion.cylinder, fluid: &fluid, sensors, leaks: &motion.leaks };
    let bound = model.bound(DT_S, &clean).unwrap().leak_std;
    let truth = motion.leaks;
    let (mut inside, mut square, mut sum) = (0, PerLeak::<f64>::default(), PerLeak::<f64>::default());
    for seed in 0..seeds {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut rls = Rls::<f64, 4>::new(motion.cylinder, fluid, sensors, RlsSettings::default());
        for sample in &clean {
            rls.update(DT_S, &noisy(sample, sensors, &mut rng));
        }
        for (leak, estimate) in rls.leak_coefficients() {
            let [low, high] = estimate.ci95();
            inside += usize::from((low..=high).contains(&truth[leak]));
            let error = (estimate.value - truth[leak]) / bound[leak];
            square[leak] += error * error / seeds as f64;
            sum[leak] += error / seeds as f64;
        }
    }
    Statistics {
        covered: inside as f64 / (3 * seeds) as f64,
        efficiency: square.map(f64::sqrt),
        worst_bias: sum.iter().fold(0.0, |worst: f64, (_, bias)| worst.max(bias.abs())),
    }
}

/// Issue: 95 % intervals cover 93–97 %, root-mean-square error at most 1.3 times the Cramér–Rao bound.
#[test]
fn intervals_cover_and_errors_are_near_the_bound() {
    let cases = [
        ("sound", leaks(0.0, 0.0, 0.0)),
        ("internal", leaks(1.2e-11, 0.0, 0.0)),
        ("external", leaks(0.0, 4e-12, 2.5e-12)),
        ("all", leaks(1e-11, 3e-12, 2e-12)),
    ];
    for accuracy in [1.0, 0.3, 0.1] {
        let mut covered = 0.0;
        for (name, truth) in &cases {
            let found = run(&Motion::wind_like(*truth), &sensors(accuracy), 200);
            println!(
                "{accuracy} % of full scale, {name}: cover {:.3}, rmse/bound {:.3?}, bias/bound {:.2}",
                found.covered, found.efficiency, found.worst_bias
            );
            covered += found.covered / cases.len() as f64;
            assert!(found.efficiency.iter().all(|(_, e)| *e < 1.3), "{name} at {accuracy} %");
            assert!(
                found.efficiency.iter().all(|(_, e)| *e > 0.8),
                "below the bound: {name} at {accuracy} %"
            );
        }
        assert!((0.93..=0.97).contains(&covered), "{covered} covered at {accuracy} %");
    }
}

/// A sound cylinder raises no alarm, whatever the offsets of its meters.
#[test]
fn a_sound_cylinder_stays_silent() {
    let mut declared = sensors(1.0);
    declared.flow_a.bias_std = 0.005 * 20.0 / 6e4;
    declared.flow_b.bias_std = declared.flow_a.bias_std;
    declared.pressure.bias_std = 0.005 * 16e6;
    let motion = Motion::wind_like(leaks(0.0, 0.0, 0.0));
    let clean = minute(&motion);
    let fluid = Fluid { bulk_modulus_pa: motion.bulk_modulus_pa, bulk_modulus_std_pa: 0.2e9 };
    let mut alarms = 0;
    for seed in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
        let mut bias = |full_scale: f64| full_scale * 0.01 * (2.0 * rng.random::<f64>() - 1.0);
        let (qa, qb) = (bias(20.0 / 6e4), bias(20.0 / 6e4));
        let (pa, pb) = (bias(16e6), bias(16e6));
        let mut rls = Rls::<f64, 6>::new(motion.cylinder, fluid, &declared, RlsSettings::default());
        let mut detector = LeakDetector::new(pitchleak::core::AlarmSettings::default());
        for sample in &clean {
            let mut reading = noisy(sample, &declared, &mut rng);
            reading.qa_m3s = reading.qa_m3s.map(|q| q + qa);
            reading.qb_m3s = reading.qb_m3s.map(|q| q + qb);
            reading.pa_pa += pa;
            reading.pb_pa += pb;
            if matches!(rls.update(DT_S, &reading), Update::Renewed | Update::Changed) {
                let change = detector.update(0.25, &rls.mean_leak_flows_m3s());
                alarms += change.iter().filter(|(_, change)| change.is_some()).count();
            }
        }
    }
    assert_eq!(alarms, 0);
}
