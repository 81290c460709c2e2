//! The noise of the weak form's rows, known from the sensors' own noise.
//!
//! A row weighs a sensor's samples by a hat where its signal enters the residual, by a difference of two block means where
//! its rate does, by the hat's curvature where that does. How much of each, `sensitivity.rs` says. Rows that share a block are
//! correlated, others are not.

use super::linearisation::Linearisation;
use super::rows::{Row, Rows};
use super::sensitivity::{Channel, Sensitivity};
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::thresholds::IGNORED;
use pitchleak_core::Sensors;

/// Sums of products of the weights of samples in two rows: by hats (0), differences (1) and curvatures (2).
type Products = [[f64; 3]; 3];

/// How samples of white noise weigh in rows, with steps of one.
#[derive(Clone, Copy, Default)]
pub(crate) struct HatWeights {
    /// Within a row.
    pub(crate) own: Products,
    /// With the next row.
    pub(crate) next: Products,
}

/// The weights of a hat over two blocks of `samples`, as `hats.rs` takes mean, rate and curvature over a step.
pub(crate) fn hat_weights(samples: usize) -> HatWeights {
    let m = samples as isize;
    let step = |j: isize| {
        if (0..2 * m - 1).contains(&j) { (m - (j - (m - 1)).abs()) as f64 / m as f64 } else { 0.0 }
    };
    let patterns = [
        [11.0, -93.0, 802.0, 802.0, -93.0, 11.0].map(|share| share / 1440.0),
        [0.0, 0.0, -1.0, 1.0, 0.0, 0.0],
        [0.0, 0.5, -0.5, -0.5, 0.5, 0.0],
    ];
    // Sample i is the first to the last of the steps i + 2 … i − 3.
    let weight = |pattern: &[f64; 6], i: isize| {
        pattern.iter().zip(0_isize..).map(|(share, place)| share * step(i + 2 - place)).sum::<f64>()
    };
    let products = |shift: isize| {
        patterns
            .map(|a| patterns.map(|b| (-3..3 * m + 3).map(|i| weight(&a, i) * weight(&b, i - shift)).sum()))
    };
    HatWeights { own: products(0), next: products(m) }
}

/// What the covariance needs of the rows.
pub(crate) struct NoiseModel<'a> {
    pub(crate) at: &'a Linearisation,
    pub(crate) sensors: &'a Sensors<f64>,
    /// Variance of the error of each equation, as if white in its flow or force.
    pub(crate) equation_error: PerEquation<f64>,
    pub(crate) rows: &'a Rows,
    /// Of each of them.
    pub(crate) sensitivities: &'a [PerEquation<Sensitivity>],
}

impl NoiseModel<'_> {
    /// How the sensors enter an equation of a row. While an equation is incomplete, what is missing may drive leaks and storage to absurd
    /// sizes: their noise must not hide it. That of the leaks is held to the flow meter's, that of storage to the cylinder's own.
    fn sensitivity(&self, row: usize, equation: Equation) -> Sensitivity {
        let mut own = self.sensitivities[row][equation];
        if self.equation_error[equation] <= 0.0 {
            return own;
        }
        let (cylinder, x_m) = (&self.at.model.cylinder, self.rows.rows[row].mean.x_m);
        let (flow_std, volume_m3) = match equation {
            Equation::ChamberA => (self.sensors.flow_a.noise_std, cylinder.volume_a_m3(x_m)),
            Equation::ChamberB => (self.sensors.flow_b.noise_std, cylinder.volume_b_m3(x_m)),
            Equation::Force => return own,
        };
        let leak_gain = flow_std / self.sensors.pressure.noise_std;
        let stored = volume_m3.abs() / self.at.model.fluid.bulk_modulus_pa;
        let [a, b] = [Channel::PressureA as usize, Channel::PressureB as usize];
        let held = |gain: f64, most: f64| if gain > most { most / gain } else { 1.0 };
        let leaks = held(own.gains[a][0].hypot(own.gains[b][0]), leak_gain);
        let storage = held(own.gains[a][1].hypot(own.gains[b][1]), stored);
        for place in [a, b] {
            own.gains[place][0] *= leaks;
            own.gains[place][1] *= storage;
            own.gains[place][2] *= storage;
        }
        own
    }

    /// Variance of one row of an equation, as if all of it were white in the flow or force.
    pub(crate) fn white_variance(&self, row: usize, equation: Equation) -> f64 {
        let own = &self.rows.rows[row];
        self.as_white(own, self.covariance((row, equation), (row, equation), hat_weights(own.samples)))
    }

    /// The white flow or force whose variance makes this variance of a row.
    pub(crate) fn as_white(&self, row: &Row, variance: f64) -> f64 {
        let step_s = row.block_s / row.samples as f64;
        variance / (hat_weights(row.samples).own[0][0] * step_s * step_s)
    }

    /// Standard deviation of a chamber's row as a mean flow, m³/s.
    pub(crate) fn mean_flow_std(&self, row: usize, equation: Equation) -> f64 {
        let own = &self.rows.rows[row];
        self.covariance((row, equation), (row, equation), hat_weights(own.samples)).sqrt() / own.block_s
    }

    /// Covariance of two entries of the same row, or of neighbours.
    fn covariance(
        &self,
        (row_a, a): (usize, Equation),
        (row_b, b): (usize, Equation),
        hats: HatWeights,
    ) -> f64 {
        if (a == Equation::Force) != (b == Equation::Force) {
            return 0.0;
        }
        let row = &self.rows.rows[row_a];
        let step_s = row.block_s / row.samples as f64;
        let weights = if row_a == row_b { hats.own } else { hats.next };
        // `weights` are of a row and the next.
        let (first, second) = if row_a < row_b { ((row_a, a), (row_b, b)) } else { ((row_b, b), (row_a, a)) };
        let (first, second) = (self.sensitivity(first.0, first.1), self.sensitivity(second.0, second.1));
        let steps = [step_s, 1.0, 1.0 / step_s];
        let mut sum = 0.0;
        for (place, channel) in Channel::ALL.into_iter().enumerate() {
            let (one, other) = (first.gains[place], second.gains[place]);
            let mut of_channel = 0.0;
            for (k, one) in one.into_iter().enumerate().filter(|(_, one)| *one != 0.0) {
                for (l, other) in other.into_iter().enumerate() {
                    of_channel += one * other * weights[k][l] * steps[k] * steps[l];
                }
            }
            let noise_times = first.noise_times[place] * second.noise_times[place];
            sum += of_channel * noise_times * channel.noise_std(self.sensors, self.at).powi(2);
        }
        let error = if a == b { self.equation_error[a] } else { 0.0 };
        sum + weights[0][0] * step_s * step_s * error
    }

    /// Covariance of the `i`th entry and the `j`th, which stands before it or is the same.
    pub(crate) fn between(&self, i: usize, j: usize, hats: HatWeights) -> f64 {
        let rows = self.rows;
        let (a, b) = (rows.entries[i], rows.entries[j]);
        if rows.rows[a.row].stretch != rows.rows[b.row].stretch || a.row - b.row > 1 {
            return 0.0;
        }
        let value = self.covariance((a.row, a.equation), (b.row, b.equation), hats);
        if i == j && !rows.counts(&a) { value * IGNORED } else { value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hat_weights_tend_to_two_thirds_and_one_sixth() {
        let HatWeights { own, next } = hat_weights(200);
        assert!(
            (own[0][0] / 200.0 - 2.0 / 3.0).abs() < 1e-3 && (next[0][0] / 200.0 - 1.0 / 6.0).abs() < 1e-3
        );
        assert!((own[1][1] * 200.0 - 2.0).abs() < 1e-9 && (next[1][1] * 200.0 + 1.0).abs() < 1e-9);
        assert!(own[0][1].abs() < 1e-9 && own[0][2] < 0.0);
    }
}
