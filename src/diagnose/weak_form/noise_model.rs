//! The noise of the weak form's rows, known from the sensors' own noise.
//!
//! A row's noise is hat·(n_Q − C n_P) − A (n̄_{k+1} − n̄_k) of the position − (V/β)(n̄_{k+1} − n̄_k) of the
//! pressure. Rows that share a block are correlated, others are not.

use super::linearisation::Linearisation;
use super::rows::{Row, Rows};
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::thresholds::IGNORED;
use pitchleak_core::Sensors;

/// How samples of white noise weigh in hats.
#[derive(Clone, Copy, Default)]
pub(crate) struct HatWeights {
    /// Sum of the squares of the samples' weights in a hat.
    pub(crate) own: f64,
    /// Sum of the products with the weights in the next hat.
    pub(crate) next: f64,
}

/// The weights of a hat over two blocks of `samples`.
pub(crate) fn hat_weights(samples: usize) -> HatWeights {
    let m = samples as isize;
    let step = |j: isize| {
        if (0..2 * m - 1).contains(&j) { (m - (j - (m - 1)).abs()) as f64 / m as f64 } else { 0.0 }
    };
    let weight = |i: isize| (step(i - 1) + step(i)) / 2.0;
    let own = (0..2 * m).map(|i| weight(i) * weight(i)).sum();
    let next = (0..2 * m).map(|i| weight(i) * weight(i - m)).sum();
    HatWeights { own, next }
}

/// What the covariance needs of one kind of row.
pub(crate) struct NoiseModel<'a> {
    pub(crate) at: &'a Linearisation,
    pub(crate) sensors: &'a Sensors<f64>,
    /// Variance of the error of each equation, as if white in its flow or force.
    pub(crate) equation_error: PerEquation<f64>,
}

impl NoiseModel<'_> {
    /// Sensitivity of a chamber's row to both pressures as flows, m³/(s·Pa). While a missing effect drives
    /// the leaks to absurd sizes, their noise must not hide it: it is held to that of the flow meter.
    fn leak_gain(&self, equation: Equation) -> [f64; 2] {
        let leaks = &self.at.model.leaks_m3spa;
        let past = leaks.internal;
        let gain = match equation {
            Equation::ChamberA => [past + leaks.external_a, -past],
            _ => [-past, past + leaks.external_b],
        };
        let noise = gain[0].hypot(gain[1]) * self.sensors.pressure.noise_std;
        let held = if noise > self.flow_std(equation) { self.flow_std(equation) / noise } else { 1.0 };
        gain.map(|g| g * held)
    }

    /// A_A or −A_B: how a change of position enters a chamber.
    pub(crate) fn swept_area(&self, equation: Equation) -> f64 {
        let cylinder = &self.at.model.cylinder;
        if equation == Equation::ChamberA { cylinder.area_a_m2 } else { -cylinder.area_b_m2 }
    }

    /// Variance of one row of an equation, as if all of it were white in the flow or force.
    pub(crate) fn white_variance(&self, row: &Row, equation: Equation) -> f64 {
        let own = Weights { hat: hat_weights(row.samples).own, difference: 2.0 };
        self.as_white(row, self.covariance((row, equation), (row, equation), own))
    }

    /// The white flow or force whose variance makes this variance of a row.
    pub(crate) fn as_white(&self, row: &Row, variance: f64) -> f64 {
        let step_s = row.block_s / row.samples as f64;
        variance / (hat_weights(row.samples).own * step_s * step_s)
    }

    /// Standard deviation of a chamber's row as a mean flow, m³/s.
    pub(crate) fn mean_flow_std(&self, row: &Row, equation: Equation) -> f64 {
        let own = Weights { hat: hat_weights(row.samples).own, difference: 2.0 };
        self.covariance((row, equation), (row, equation), own).sqrt() / row.block_s
    }

    fn flow_std(&self, equation: Equation) -> f64 {
        let meter = if equation == Equation::ChamberA { &self.sensors.flow_a } else { &self.sensors.flow_b };
        meter.noise_std
    }

    /// (V/β) σ_P: noise of the pressure's part that the chamber stores, m³.
    fn stored_std(&self, row: &Row, equation: Equation) -> f64 {
        let cylinder = &self.at.model.cylinder;
        let volume = match equation {
            Equation::ChamberA => cylinder.volume_a_m3(row.mean.x_m),
            _ => cylinder.volume_b_m3(row.mean.x_m),
        };
        volume / self.at.model.fluid.bulk_modulus_pa * self.sensors.pressure.noise_std
    }

    /// Covariance of two entries of the same row or, with `weights` of the next hat, of neighbours.
    fn covariance(
        &self,
        (row_a, a): (&Row, Equation),
        (row_b, b): (&Row, Equation),
        weights: Weights,
    ) -> f64 {
        if (a == Equation::Force) != (b == Equation::Force) {
            return 0.0;
        }
        let step_s = row_a.block_s / row_a.samples as f64;
        let hat = weights.hat * step_s * step_s;
        let difference = weights.difference / row_a.samples as f64;
        let (pressure, cylinder) = (self.sensors.pressure.noise_std, &self.at.model.cylinder);
        if a == Equation::Force {
            let areas = cylinder.area_a_m2.powi(2) + cylinder.area_b_m2.powi(2);
            let error = self.equation_error[a];
            return hat * (areas * pressure.powi(2) + self.sensors.force.noise_std.powi(2) + error);
        }
        let (ga, gb) = (self.leak_gain(a), self.leak_gain(b));
        let leak = (ga[0] * gb[0] + ga[1] * gb[1]) * pressure.powi(2);
        let moved = self.swept_area(a) * self.swept_area(b) * self.sensors.position.noise_std.powi(2);
        if a != b {
            return hat * leak + difference * moved;
        }
        let stored = self.stored_std(row_a, a) * self.stored_std(row_b, b);
        let error = self.equation_error[a];
        hat * (self.flow_std(a).powi(2) + leak + error) + difference * (moved + stored)
    }

    /// Covariance of the `i`th entry and the `j`th, which stands before it or is the same.
    pub(crate) fn between(&self, rows: &Rows, i: usize, j: usize, hats: HatWeights) -> f64 {
        let (a, b) = (rows.entries[i], rows.entries[j]);
        let (row_a, row_b) = (&rows.rows[a.row], &rows.rows[b.row]);
        if row_a.stretch != row_b.stretch || a.row - b.row > 1 {
            return 0.0;
        }
        let weights = if a.row == b.row {
            Weights { hat: hats.own, difference: 2.0 }
        } else {
            Weights { hat: hats.next, difference: -1.0 }
        };
        let value = self.covariance((row_a, a.equation), (row_b, b.equation), weights);
        if i == j && !rows.counts(&a) { value * IGNORED } else { value }
    }
}

/// How the noise of samples enters two rows together: through their hats, and through their
/// differences of block means (times the samples of a block).
#[derive(Clone, Copy, Default)]
struct Weights {
    hat: f64,
    difference: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hat_weights_tend_to_two_thirds_and_one_sixth() {
        let HatWeights { own, next } = hat_weights(200);
        assert!((own / 200.0 - 2.0 / 3.0).abs() < 1e-3 && (next / 200.0 - 1.0 / 6.0).abs() < 1e-3);
    }
}
