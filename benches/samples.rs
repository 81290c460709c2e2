//! Time per sample of the estimators, at the rate of a gateway.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use pitchleak::core::{
    Cylinder, Fluid, PaperEstimator, PaperGains, PaperLaw, Rls, RlsSettings, Sample, Sensors, regressors,
};

const SAMPLES: usize = 10_000;

fn samples() -> Vec<Sample<f64>> {
    (0..SAMPLES)
        .map(|k| {
            let t = k as f64 * 0.01;
            Sample {
                x_m: 0.1 + 0.04 * (0.9 * t).sin(),
                pa_pa: 6e6 + 1e6 * (1.3 * t).sin(),
                pb_pa: 4e6 + 8e5 * (0.7 * t).sin(),
                qa_m3s: Some(4.5e-5 * (0.9 * t).cos()),
                qb_m3s: Some(-3.4e-5 * (0.9 * t).cos()),
                force_n: None,
            }
        })
        .collect()
}

fn rls<const N: usize>(c: &mut Criterion, name: &str, samples: &[Sample<f64>]) {
    let mut group = c.benchmark_group("per sample");
    group.throughput(Throughput::Elements(SAMPLES as u64));
    let new =
        || Rls::<f64, N>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), RlsSettings::default());
    group.bench_function(name, |b| {
        b.iter_batched_ref(
            new,
            |rls| {
                for sample in samples {
                    black_box(rls.update(0.01, sample));
                }
            },
            BatchSize::SmallInput,
        );
    });
}

fn paper(c: &mut Criterion, samples: &[Sample<f64>]) {
    let (cylinder, fluid) = (Cylinder::paper(), Fluid::paper());
    let gains = PaperGains::scaled(&cylinder, &fluid, 10.0, 1.0);
    let mut group = c.benchmark_group("per sample");
    group.throughput(Throughput::Elements(SAMPLES as u64));
    group.bench_function("paper's law", |b| {
        b.iter_batched_ref(
            || PaperLaw::new(&cylinder, &fluid, 0.0),
            |law| {
                for sample in samples {
                    if let Some(f) = regressors(&cylinder, sample, 0.0) {
                        law.step(&gains, 0.01, sample.load_pressure_pa(), &f);
                    }
                }
            },
            BatchSize::SmallInput,
        );
    });
    let Ok(chain) = PaperEstimator::new(cylinder, fluid, gains, 5.0, 100.0) else { return };
    group.bench_function("paper's chain with filters and load", |b| {
        b.iter_batched_ref(
            || chain,
            |chain| {
                for sample in samples {
                    black_box(chain.update(0.01, sample));
                }
            },
            BatchSize::SmallInput,
        );
    });
}

fn per_sample(c: &mut Criterion) {
    let samples = samples();
    rls::<4>(c, "rls", &samples);
    rls::<6>(c, "rls with offsets", &samples);
    rls::<9>(c, "rls with offsets and gains", &samples);
    paper(c, &samples);
}

criterion_group!(benches, per_sample);
criterion_main!(benches);
