//! Work load for an instruction count: `instructions ESTIMATOR SAMPLES` feeds that many samples of a synthetic
//! trace. `benches/instructions.sh` runs it under callgrind at two lengths; the difference is the cost per
//! sample, free of start-up.

use std::hint::black_box;

use pitchleak::core::{
    Cylinder, Fluid, PaperGains, PaperLaw, Rls, RlsSettings, Sample, Sensors, VALVE_COVARIANCES,
    VALVE_UNKNOWNS, ValveCalibration, ValveFilter, ValveNoise, ValveSample, regressors,
};

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

fn valve(count: usize) {
    let mut mean = [0.0; VALVE_UNKNOWNS];
    mean[3..8].fill(1.0);
    mean[12] = 0.02;
    let mut covariance = [0.0; VALVE_COVARIANCES];
    (0..VALVE_UNKNOWNS).for_each(|row| covariance[row * (row + 3) / 2] = 1e-6);
    let calibration = ValveCalibration {
        mean,
        covariance,
        rated_flow_m3s: 4.0 / 60e3,
        rated_drop_pa: 35e5,
        tank_pa: 0.0,
        hysteresis: 0.003,
        null_leak: 0.02,
        gain_drift: 0.03,
        lap_drift: 0.001,
        null_leak_drift: 0.1,
    };
    let noise = ValveNoise { position_m: 2e-4, pressure_pa: 16e3, spool: 1e-3, supply_pa: 16e3 };
    let new = ValveFilter::new(&Cylinder::paper(), &Fluid::paper(), &calibration, &noise, 0.5);
    let Ok(mut filter) = new else { return };
    feed(count, |sample| {
        let Sample { x_m, pa_pa, pb_pa, qa_m3s, .. } = *sample;
        let spool = 5e3 * qa_m3s.unwrap_or_default();
        filter.update(black_box(0.01), &ValveSample { x_m, pa_pa, pb_pa, spool, ps_pa: 1e7 });
    });
    black_box(filter.estimates());
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
        "valve" => valve(count),
        _ => nothing(count),
    }
}
