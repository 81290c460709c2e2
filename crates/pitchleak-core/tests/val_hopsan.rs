//! The plant against an independent simulator (Hopsan): driven by the flows and the load that the
//! trace records, does it show the trace's pressures?
//!
//! Nothing is corrected on the way: one initial state, then 60 s of integration. An error of the
//! flows' integral cannot leave the cylinder again, but it goes into the position (the areas
//! differ, so the piston moves until load and leaks are in balance), where it is measured too;
//! windows of 10 s and 1 s, each started from the trace, show how much of the figure is drift.
//! Only the interpolation between samples is ours: cubic Hermite with central slopes.
#![allow(clippy::unwrap_used)] // helpers of tests are no tests to clippy

use pitchleak_core::plant::{CylinderPlant, Drive};
use pitchleak_core::{Cylinder, Fluid, Model, PerLeak};
use std::path::PathBuf;

/// Columns of the trace: t, x, v, P_A, P_B, Q_A, Q_B, force.
type Row = [f64; 8];

fn trace(name: &str) -> Option<Vec<Row>> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data/hopsan")
        .join(name)
        .with_extension("csv.gz");
    let file = std::fs::File::open(&path).ok()?;
    let mut reader = csv::Reader::from_reader(flate2::read::GzDecoder::new(file));
    let rows = reader.records().map(|record| {
        let record = record.unwrap();
        std::array::from_fn(|i| record[i].parse().unwrap())
    });
    Some(rows.collect())
}

/// Value of a column `share` of the way from row `i` to the next.
fn between(rows: &[Row], i: usize, share: f64, column: usize) -> f64 {
    let at = |k: isize| {
        let index = (i as isize + k).clamp(0, rows.len() as isize - 1);
        rows[index as usize][column]
    };
    let (start, end) = (at(0), at(1));
    let (slope_start, slope_end) = (0.5 * (end - at(-1)), 0.5 * (at(2) - start));
    let s = share;
    start * (1.0 + 2.0 * s) * (1.0 - s).powi(2)
        + end * s * s * (3.0 - 2.0 * s)
        + slope_start * s * (1.0 - s).powi(2)
        + slope_end * s * s * (s - 1.0)
}

/// Root-mean-square errors of x, P_A, P_B as shares of each signal's range, over `window_s` after
/// each restart from a recorded state.
fn nrmse(rows: &[Row], model: Model<f64>, window_s: f64) -> [f64; 3] {
    let plant = CylinderPlant::new(model).unwrap();
    let window = (window_s / 0.01).round() as usize;
    let inner = 100;
    let mut squares = [0.0; 3];
    let mut state = plant.state_at(rows[0][1], rows[0][2], rows[0][3], rows[0][4]);
    for i in 0..rows.len() - 1 {
        if i % window == 0 {
            state = plant.state_at(rows[i][1], rows[i][2], rows[i][3], rows[i][4]);
        }
        for k in 0..inner {
            let step = 0.01 / f64::from(inner);
            state = plant.step(&state, step, |elapsed| {
                let share = (f64::from(k) * step + elapsed) / 0.01;
                let value = |column| between(rows, i, share, column);
                Drive { qa_m3s: value(5), qb_m3s: value(6), force_n: value(7) }
            });
        }
        let (pa, pb) = plant.pressures_pa(&state);
        for (sum, (seen, column)) in squares.iter_mut().zip([(state.x_m, 1), (pa, 3), (pb, 4)]) {
            *sum += (seen - rows[i + 1][column]).powi(2);
        }
    }
    let range = |column: usize| {
        let values = || rows.iter().map(|row| row[column]);
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
    };
    let share = |sum: f64, column| (sum / (rows.len() - 1) as f64).sqrt() / range(column);
    [share(squares[0], 1), share(squares[1], 3), share(squares[2], 4)]
}

fn paper_size(mass_kg: f64, bulk_modulus_pa: f64, leaks: PerLeak<f64>) -> Model<f64> {
    Model {
        cylinder: Cylinder { moving_mass_kg: mass_kg, ..Cylinder::paper() },
        fluid: Fluid { bulk_modulus_pa, bulk_modulus_std_pa: 0.0 },
        leaks_m3spa: leaks,
    }
}

fn agrees(name: &str, model: Model<f64>) {
    let Some(rows) = trace(name) else {
        println!("{name}: the independent simulator's traces are not here, nothing compared");
        return;
    };
    for window_s in [60.0, 10.0, 1.0] {
        let [x, pa, pb] = nrmse(&rows, model, window_s);
        println!("{name}, {window_s:>2} s open loop: NRMSE x {x:.2e}, P_A {pa:.2e}, P_B {pb:.2e}");
        assert!(pa < 1e-3 && pb < 1e-3 && x < 1e-3, "{name} over {window_s} s");
    }
}

#[test]
fn val_h02_internal_leak() {
    let leaks = PerLeak { internal: 1.2e-11, ..PerLeak::default() };
    agrees("h02", paper_size(30.0, 0.9e9, leaks));
}

#[test]
fn val_h06_external_leaks() {
    let leaks = PerLeak { external_a: 4e-12, external_b: 2.5e-12, ..PerLeak::default() };
    agrees("h06", paper_size(50.0, 1.1e9, leaks));
}

/// The comparison can fail: a leak left out shows in the pressures at once.
#[test]
fn val_a_missing_leak_is_seen() {
    if let Some(rows) = trace("h02") {
        let [_, pa, pb] = nrmse(&rows, paper_size(30.0, 0.9e9, PerLeak::default()), 1.0);
        assert!(pa.max(pb) > 0.05, "P_A {pa}, P_B {pb}");
    }
}
