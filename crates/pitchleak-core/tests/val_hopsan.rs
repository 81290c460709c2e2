//! Validation against traces of an independent simulator, where they are at hand.

use std::io::Read;
use std::path::PathBuf;

use pitchleak_core::{Cylinder, Fluid, PerLeak, Rls, RlsSettings, Sample, Sensors};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

struct Case {
    name: &'static str,
    bulk_modulus_pa: f64,
    truth: PerLeak<f64>,
}

const CASES: [Case; 2] = [
    Case {
        name: "h02",
        bulk_modulus_pa: 0.9e9,
        truth: PerLeak { internal: 1.2e-11, external_a: 0.0, external_b: 0.0 },
    },
    Case {
        name: "h06",
        bulk_modulus_pa: 1.1e9,
        truth: PerLeak { internal: 0.0, external_a: 4e-12, external_b: 2.5e-12 },
    },
];

fn trace(name: &str) -> Option<Vec<Sample<f64>>> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data/hopsan")
        .join(format!("{name}.csv.gz"));
    let file = std::fs::File::open(path).ok()?;
    let mut text = String::new();
    flate2::read::GzDecoder::new(file).read_to_string(&mut text).ok()?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().ok()?.clone();
    let column = |name: &str| header.iter().position(|h| h == name);
    let (x, pa, pb) = (column("x_m")?, column("pa_pa")?, column("pb_pa")?);
    let (qa, qb) = (column("qa_m3s")?, column("qb_m3s")?);
    let number = |row: &csv::StringRecord, i: usize| row.get(i)?.parse::<f64>().ok();
    reader
        .records()
        .map(|row| {
            let row = row.ok()?;
            Some(Sample {
                x_m: number(&row, x)?,
                pa_pa: number(&row, pa)?,
                pb_pa: number(&row, pb)?,
                qa_m3s: number(&row, qa),
                qb_m3s: number(&row, qb),
                force_n: None,
            })
        })
        .collect()
}

fn noisy(sample: &Sample<f64>, sensors: &Sensors<f64>, rng: &mut ChaCha8Rng) -> Sample<f64> {
    let mut normal = |std: f64| std * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, rng);
    Sample {
        x_m: sample.x_m + normal(sensors.position.noise_std),
        pa_pa: sample.pa_pa + normal(sensors.pressure.noise_std),
        pb_pa: sample.pb_pa + normal(sensors.pressure.noise_std),
        qa_m3s: sample.qa_m3s.map(|q| q + normal(sensors.flow_a.noise_std)),
        qb_m3s: sample.qb_m3s.map(|q| q + normal(sensors.flow_b.noise_std)),
        force_n: None,
    }
}

fn replay(case: &Case, samples: impl Iterator<Item = Sample<f64>>) -> Rls<f64, 4> {
    let fluid =
        Fluid { bulk_modulus_pa: case.bulk_modulus_pa, bulk_modulus_std_pa: 0.25 * case.bulk_modulus_pa };
    let mut rls = Rls::new(Cylinder::paper(), fluid, &Sensors::paper(), RlsSettings::default());
    for sample in samples {
        rls.update(0.01, &sample);
    }
    rls
}

/// Leak flow errors in L/min, and in standard deviations.
fn errors(case: &Case, rls: &Rls<f64, 4>) -> [(f64, f64); 3] {
    let found = rls.leak_coefficients();
    let pressure = rls.mean_pressures_pa();
    let one = |estimate: pitchleak_core::Estimate<f64>, truth: f64, p: f64| {
        ((estimate.value - truth) * p * 6e4, (estimate.value - truth) / estimate.std)
    };
    [
        one(found.internal, case.truth.internal, pressure.internal),
        one(found.external_a, case.truth.external_a, pressure.external_a),
        one(found.external_b, case.truth.external_b, pressure.external_b),
    ]
}

#[test]
fn val_leaks_are_exact_without_noise() {
    for case in &CASES {
        let Some(samples) = trace(case.name) else {
            println!("{}: not at hand, skipped", case.name);
            continue;
        };
        let rls = replay(case, samples.into_iter());
        println!("{} beta {:?}", case.name, 1.0 / rls.compressibility().value);
        for (leak, (lpm, deviations)) in errors(case, &rls).into_iter().enumerate() {
            println!("{} leak {leak}: {lpm:.6} L/min, {deviations:.3} sd", case.name);
            assert!(lpm.abs() < 2e-4);
        }
    }
}

#[test]
fn val_leaks_with_noise_of_one_percent() {
    let sensors = Sensors::paper();
    for case in &CASES {
        let Some(samples) = trace(case.name) else {
            println!("{}: not at hand, skipped", case.name);
            continue;
        };
        let mut worst = [0.0_f64; 3];
        let mut square = [0.0; 3];
        let mut inside = [0; 3];
        let mut nis = [0.0; 2];
        let seeds = 100;
        for seed in 0..seeds {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let rls = replay(case, samples.iter().map(|s| noisy(s, &sensors, &mut rng)));
            let r = rls.normalised_innovation();
            nis[0] += r[0] / seeds as f64;
            nis[1] += r[1] / seeds as f64;
            for (i, (lpm, deviations)) in errors(case, &rls).into_iter().enumerate() {
                worst[i] = worst[i].max(lpm.abs());
                square[i] += lpm * lpm / seeds as f64;
                inside[i] += usize::from(deviations.abs() < 1.96);
            }
        }
        let rms = square.map(f64::sqrt);
        println!(
            "{}: rms {rms:.5?} L/min, worst {worst:.5?} L/min, covered {inside:?} nis {nis:?}",
            case.name
        );
        assert!(worst.iter().all(|w| *w < 0.01));
    }
}
