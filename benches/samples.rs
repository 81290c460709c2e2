//! Time per sample of the estimators, at the rate of a gateway; and of a decision.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use pitchleak::Rig;
use pitchleak::core::{
    Cylinder, Fluid, PaperEstimator, PaperGains, PaperLaw, PerLeak, Rls, RlsSettings, Sample, Sensors,
    regressors,
};
use pitchleak::explain::{Statistic, explain};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::told::Told;
use pitchleak::trace::{Record, TableLayout, TraceReader};

const SAMPLES: usize = 10_000;

fn samples(count: usize) -> Vec<Sample<f64>> {
    (0..count)
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
        Rls::<f64, N>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), RlsSettings::default());
    let Ok(new) = new else { return };
    group.bench_function(name, |b| {
        b.iter_batched_ref(
            || new,
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

/// A whole replay of columns in memory: their checks, the estimator, the alarms.
fn columns(c: &mut Criterion, samples: &[Sample<f64>]) {
    let rig = Rig::paper();
    let headers = ["t_s", "x_m", "pa_pa", "pb_pa", "qa_m3s", "qb_m3s"].map(str::to_owned);
    let Ok(layout) = TableLayout::new("columns", &headers, &rig) else { return };
    let of = |value: fn(&Sample<f64>) -> f64| samples.iter().map(value).collect::<Vec<_>>();
    let columns = [
        (0..samples.len()).map(|k| k as f64 * 0.01).collect(),
        of(|s| s.x_m),
        of(|s| s.pa_pa),
        of(|s| s.pb_pa),
        of(|s| s.qa_m3s.unwrap_or(f64::NAN)),
        of(|s| s.qb_m3s.unwrap_or(f64::NAN)),
    ];
    let mut group = c.benchmark_group("per sample");
    group.sample_size(10).throughput(Throughput::Elements(samples.len() as u64));
    group.bench_function("replay of columns", |b| {
        b.iter(|| {
            let batch = columns.iter().map(Vec::as_slice).collect();
            let mut reader = TraceReader::from_table("columns", &layout, vec![batch], &rig)?;
            replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(()))
        });
    });
}

/// One decision of the posterior, on a recorded leak of 40 s.
fn decision(c: &mut Criterion) {
    let Ok(rig) = Rig::load(data("rig.toml")) else { return };
    let mut statistic = Box::new(Statistic::new(&rig.cylinder, &rig.fluid, &rig.sensors()));
    let Ok(mut reader) = TraceReader::open(data("external_a.csv.gz"), &rig) else { return };
    let mut record = Record::default();
    while let Ok(true) = reader.next_record(&mut record) {
        statistic.push(record.step_s(), &record.sample);
    }
    let mut group = c.benchmark_group("per decision");
    group.sample_size(20);
    group.bench_function("posterior", |b| {
        b.iter(|| explain(&statistic, &rig, PerLeak::default(), &Told::default()))
    });
}

fn data(name: &str) -> String {
    format!("{}/data/traces/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn per_sample(c: &mut Criterion) {
    let samples = samples(SAMPLES);
    rls::<4>(c, "rls", &samples);
    rls::<6>(c, "rls with offsets", &samples);
    rls::<9>(c, "rls with offsets and gains", &samples);
    paper(c, &samples);
    columns(c, &self::samples(1_000_000));
}

criterion_group!(benches, per_sample, decision);
criterion_main!(benches);
