//! The smallest leak that is found, by the sensors' accuracy, their calibration and the sampling rate: the chart of
//! docs/instrumenting.md.
//!
//! ```text
//! cargo run --release --example smallest_leak -- OUT.svg
//! ```
//!
//! Prints the chart's numbers, too.

mod chart;
mod limit;

use chart::{Chart, Curve};
use limit::{Limits, Motion, PERIODS};
use pitchleak::core::Sensors;
use pitchleak::simulate::SimulateError;
use pitchleak::wind::WindCase;
use pitchleak::{Rig, units::LPM_PER_M3S};
use rayon::prelude::*;
use std::error::Error;

/// What can be said beside an answer that comes from several threads.
pub type Failure = Box<dyn Error + Send + Sync>;

/// Accuracy where another quantity varies, and of the points' sensors: 3 σ of one reading, share of full scale.
const ACCURACY: f64 = 3e-3;
/// Sampling rate where another quantity varies, Hz.
const RATE_HZ: f64 = 100.0;

/// White noise of `accuracy`; flow meters whose zeros are known to `zero` at first and drift by `drift` an hour (1 σ), all as
/// shares of full scale.
fn sensors(accuracy: f64, zero: f64, drift: f64) -> Sensors<f64> {
    let mut rig = Rig::paper();
    rig.instruments = rig.instruments.with_accuracy(accuracy);
    let mut sensors = rig.sensors();
    for (spread, sheet) in
        [(&mut sensors.flow_a, rig.instruments.flow_a), (&mut sensors.flow_b, rig.instruments.flow_b)]
    {
        spread.bias_std = zero * sheet.full_scale;
        spread.drift_std_ph = drift * sheet.full_scale;
    }
    sensors
}

/// A curve for each period, and points where the estimator was asked.
fn curves(at: &[f64], limits: impl Fn(f64) -> Result<Limits, Failure> + Sync) -> Result<Vec<Curve>, Failure> {
    let limits: Vec<Limits> = at.par_iter().map(|at| limits(*at)).collect::<Result<_, _>>()?;
    let mut curves: Vec<Curve> = PERIODS
        .iter()
        .enumerate()
        .map(|(place, (name, _))| Curve {
            name,
            points: at
                .iter()
                .zip(&limits)
                .map(|(at, limits)| (*at, LPM_PER_M3S * limits.bound_m3s[place]))
                .collect(),
        })
        .collect();
    let estimated =
        at.iter().zip(&limits).map(|(at, limits)| (*at, LPM_PER_M3S * limits.estimated_m3s)).collect();
    curves.push(Curve { name: chart::ESTIMATED, points: estimated });
    Ok(curves)
}

fn main() -> Result<(), Failure> {
    let out = std::env::args().nth(1).ok_or("say where the chart goes: OUT.svg")?;
    let at_rate = |rate_hz| -> Result<Motion, SimulateError> { Motion::of(WindCase::Mps13, rate_hz) };
    let motion = at_rate(RATE_HZ)?;
    let percent = |share: f64| 0.01 * share;
    let charts = [
        Chart {
            title: "accuracy of every sensor",
            x_label: "3 σ of one reading, % of full scale",
            curves: curves(&[0.05, 0.1, 0.2, 0.5, 1.0, 2.0], |x| {
                motion.limits(&sensors(percent(x), 0.0, 0.0))
            })?,
        },
        Chart {
            title: "zeros of the flow meters, which stay",
            x_label: "known to (1 σ), % of full scale",
            curves: curves(&[0.01, 0.03, 0.1, 0.3, 1.0, 3.0], |x| {
                motion.limits(&sensors(ACCURACY, percent(x), 0.0))
            })?,
        },
        Chart {
            title: "zeros of the flow meters, which drift",
            x_label: "in an hour (1 σ), % of full scale",
            curves: curves(&[0.01, 0.03, 0.1, 0.3, 1.0, 3.0], |x| {
                motion.limits(&sensors(ACCURACY, 0.0, percent(x)))
            })?,
        },
        Chart {
            title: "sampling",
            x_label: "samples per second",
            curves: curves(&[10.0, 20.0, 50.0, 100.0, 200.0, 500.0], |x| {
                at_rate(x)?.limits(&sensors(ACCURACY, 0.0, 0.0))
            })?,
        },
    ];
    for chart in &charts {
        print!("{}", chart.to_text());
    }
    Ok(std::fs::write(out, chart::svg(&charts)?)?)
}
