//! Work load for an instruction count: `instructions ESTIMATOR SAMPLES` feeds that many samples of a synthetic
//! trace. `benches/instructions.sh` runs it under callgrind at two lengths; the difference is the cost per
//! sample, free of start-up.

use std::hint::black_box;

use pitchleak::core::{Cylinder, Fluid, PaperGains, PaperLaw, Rls, RlsSettings, Sample, Sensors, regressors};

const PERIOD: usize = 1 << 12;

fn samples() -> Vec<Sample<f64>> {
    (0..PERIOD)
        .map(|k| {
            // Triangle waves: cheap beside the estimator.
            let wave = |period: usize| ((k % period) as f64 / period as f64 - 0.5).abs();
            Sample {
                x_m: 0.05 + 0.1 * wave(700),
                pa_pa: 4e6 + 3e6 * wave(310),
                pb_pa: 3e6 + 2e6 * wave(470),
                qa_m3s: Some(1e-4 * wave(530)),
                qb_m3s: Some(-1e-4 * wave(590)),
                force_n: None,
            }
        })
        .collect()
}

/// Feeds `count` samples, the same few again and again, so that the work load itself costs next to nothing.
fn feed(count: usize, mut take: impl FnMut(&Sample<f64>)) {
    let samples = samples();
    for _ in 0..count / PERIOD {
        for sample in &samples {
            take(black_box(sample));
        }
    }
}

fn rls<const N: usize>(count: usize) {
    let new =
        Rls::<f64, N>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), RlsSettings::default());
    let Ok(mut rls) = new else { return };
    feed(count, |sample| {
        rls.update(black_box(0.01), sample);
    });
    black_box(rls.leak_coefficients());
}

fn paper(count: usize) {
    let (cylinder, fluid) = (Cylinder::paper(), Fluid::paper());
    let gains = PaperGains::scaled(&cylinder, &fluid, 10.0, 1.0);
    let mut law = PaperLaw::new(&cylinder, &fluid, 0.0);
    feed(count, |sample| {
        if let Some(f) = regressors(&cylinder, sample, black_box(0.0)) {
            law.step(&gains, black_box(0.01), sample.load_pressure_pa(), &f);
        }
    });
    black_box(law);
}

fn law(count: usize) {
    let (cylinder, fluid) = (Cylinder::paper(), Fluid::paper());
    let gains = PaperGains::scaled(&cylinder, &fluid, 10.0, 1.0);
    let mut law = PaperLaw::new(&cylinder, &fluid, 0.0);
    let f = [0.1, -1e11, -1e11, 1e11, -1e3];
    feed(count, |sample| law.step(&gains, 0.01, sample.pa_pa, black_box(&f)));
    black_box(law);
}

fn nothing(count: usize) {
    let f = [0.1, -1e11, -1e11, 1e11, -1e3];
    feed(count, |_| {
        black_box(&f);
    });
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let kind = arguments.next().unwrap_or_default();
    let count = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(1000);
    match kind.as_str() {
        "rls" => rls::<4>(count),
        "rls-offsets" => rls::<6>(count),
        "rls-gains" => rls::<9>(count),
        "paper-law" => law(count),
        "paper" => paper(count),
        _ => nothing(count),
    }
}
