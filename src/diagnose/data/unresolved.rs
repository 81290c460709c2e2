//! What moves between two samples. Where a valve closes and the oil rings, slow samples show an image of the ringing and not its mean
//! over a step: what they read there is as uncertain as their fast part is large.

use super::sensor_noise::{difference_order, differences};
use super::series::Series;
use crate::diagnose::thresholds::{LEAST_STEP_S, UNRESOLVED_SIGMA};
use pitchleak_core::Sensors;
use std::ops::Range;

/// The fast part of each reading along a trace, held against the noise of its sensor.
pub(crate) struct Unresolved {
    /// Squares of differences in variances of the noise: position, pressures, flows, force. Empty where samples are fast enough.
    squares: Option<[Vec<f64>; 6]>,
    order: usize,
}

impl Unresolved {
    pub(crate) fn of(series: &Series, sensors: &Sensors<f64>) -> Self {
        let order = difference_order(series.step_s());
        let squares = |values: &[f64], noise_std: f64| -> Vec<f64> {
            let (fast, of_white) = differences(values, order);
            let unit = of_white * noise_std.max(f64::MIN_POSITIVE);
            fast.into_iter().map(|d| (d / unit).powi(2)).collect()
        };
        let is_slow = series.step_s() > 1.5 * LEAST_STEP_S;
        let squares = is_slow.then(|| {
            [
                squares(&series.x_m, sensors.position.noise_std),
                squares(&series.pa_pa, sensors.pressure.noise_std),
                squares(&series.pb_pa, sensors.pressure.noise_std),
                squares(&series.qa_m3s, sensors.flow_a.noise_std),
                squares(&series.qb_m3s, sensors.flow_b.noise_std),
                squares(&series.force_n, sensors.force.noise_std),
            ]
        });
        Self { squares, order }
    }

    /// Standard deviation of what is read in some samples, in those of the sensors' noise: one where noise explains it.
    pub(crate) fn noise_times(&self, samples: Range<usize>) -> [f64; 6] {
        let of = |squares: &Vec<f64>| {
            // Differences count where their middle lies.
            let place = |sample: usize| sample.saturating_sub(self.order / 2).min(squares.len());
            let near =
                squares[place(samples.start)..place(samples.end)].iter().filter(|square| square.is_finite());
            let (sum, count) = near.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
            if sum > UNRESOLVED_SIGMA.powi(2) * count { (sum / count).sqrt() } else { 1.0 }
        };
        self.squares.as_ref().map_or([1.0; 6], |squares| squares.each_ref().map(of))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::{declared, sound};
    use pitchleak_core::Sample;

    /// Samples of 20 Hz, one of which jumps.
    fn slow(jolt_pa: f64) -> Series {
        let (full, mut series) = (sound(60), Series::default());
        for at in (0..full.len()).step_by(5) {
            let sample = Sample {
                x_m: full.x_m[at],
                pa_pa: full.pa_pa[at] + if at == 1500 { jolt_pa } else { 0.0 },
                pb_pa: full.pb_pa[at],
                qa_m3s: Some(full.qa_m3s[at]),
                qb_m3s: Some(full.qb_m3s[at]),
                force_n: Some(full.force_n[at]),
            };
            series.push(full.t_s[at], &sample, None);
        }
        series
    }

    #[test]
    fn a_jolt_is_unresolved_where_it_is_and_noise_is_not() {
        let sensors = declared().sensors;
        let jolt = 30.0 * sensors.pressure.noise_std;
        let (quiet, jolted) = (Unresolved::of(&slow(0.0), &sensors), Unresolved::of(&slow(jolt), &sensors));
        let is_one = |times: &[f64; 6]| times.iter().all(|one| (one - 1.0).abs() < 1e-12);
        let loud = (0..1190).step_by(2).filter(|at| !is_one(&quiet.noise_times(*at..at + 4))).count();
        assert!(loud < 5, "{loud} of 595 by chance");
        let there = jolted.noise_times(298..302);
        assert!(there[1] > 5.0 && there[2] < 2.0, "{there:?}");
        let beside = (jolted.noise_times(320..324)[1], quiet.noise_times(320..324)[1]);
        assert!((beside.0 - beside.1).abs() < 1e-12, "{beside:?}");
    }
}
