//! What a fit says of its other parameters where leaks are at least zero.
//!
//! A fit alone lets a zero that is off stand against a leak below none. Given a sample of leaks p that are not,
//!
//!   E θ = μ + c'Σ⁻¹(p̄ − μ_p),   var θ = σ² − c'Σ⁻¹(Σ − C)Σ⁻¹c,
//!
//! with Σ the leaks' covariance, c theirs with θ, and C that of the sample: the laws of total expectation and variance.

use super::orthant::Orthant;
use nalgebra::{DMatrix, DVector};
use pitchleak_core::Estimate;

/// Leaks as fitted, and as they are.
pub(super) struct GivenLeaks {
    /// Σ⁻¹(p̄ − μ_p) and Σ⁻¹(Σ − C)Σ⁻¹.
    moved: DVector<f64>,
    narrowed: DMatrix<f64>,
}

impl GivenLeaks {
    /// Of N(`means`, `covariance`) and its sample.
    pub fn new(means: &[f64], covariance: &[Vec<f64>], sample: &Orthant) -> Self {
        let k = means.len();
        let covariance = DMatrix::from_fn(k, k, |i, j| covariance[i][j]);
        let mean = |of: &dyn Fn(&[f64]) -> f64| {
            sample.points.iter().zip(&sample.weights).map(|(point, weight)| weight * of(point)).sum::<f64>()
        };
        let kept = DVector::from_fn(k, |i, _| mean(&|point| point[i]));
        let scatter =
            DMatrix::from_fn(k, k, |i, j| mean(&|point| (point[i] - kept[i]) * (point[j] - kept[j])));
        // None where leaks are known without any doubt: then nothing goes with them.
        let inverse =
            covariance.clone().cholesky().map_or_else(|| DMatrix::zeros(k, k), |factor| factor.inverse());
        let moved = &inverse * (kept - DVector::from_column_slice(means));
        let narrowed = &inverse * (covariance - scatter) * &inverse;
        Self { moved, narrowed }
    }

    /// A parameter of which the fit says this, and this covariance with each leak.
    pub fn size(&self, fitted: f64, variance: f64, with_leaks: &[f64]) -> Estimate<f64> {
        let with_leaks = DVector::from_column_slice(with_leaks);
        let variance = variance - with_leaks.dot(&(&self.narrowed * &with_leaks));
        Estimate { value: fitted + with_leaks.dot(&self.moved), std: variance.max(0.0).sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::orthant::{POINTS, positive_orthant};
    use super::*;

    /// A zero and a leak below none that make each other up, by their joint density where the leak is positive.
    #[test]
    fn a_zero_does_not_stand_against_a_leak_below_none() {
        let (leak, zero, correlation) = (-2.0, 1.9, -0.95);
        let sample = positive_orthant(&[leak], &[vec![1.0]], POINTS);
        let found = GivenLeaks::new(&[leak], &[vec![1.0]], &sample).size(zero, 1.0, &[correlation]);
        let (mut sums, steps) = ([0.0; 3], 400);
        let free_variance = 1.0 - correlation * correlation;
        for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
            let p = 4.0 * (f64::from(i) + 0.5) / f64::from(steps);
            let theta = -4.0 + 8.0 * (f64::from(j) + 0.5) / f64::from(steps);
            let off = theta - (zero + correlation * (p - leak));
            let density = (-0.5 * (p - leak).powi(2) - 0.5 * off * off / free_variance).exp();
            sums.iter_mut().zip([1.0, theta, theta * theta]).for_each(|(sum, of)| *sum += density * of);
        }
        let mean = sums[1] / sums[0];
        let std = (sums[2] / sums[0] - mean * mean).sqrt();
        assert!(
            (found.value - mean).abs() < 0.02 && (found.std - std).abs() < 0.02,
            "{found:?} {mean} {std}"
        );
        assert!(mean.abs() < 0.5, "{mean}");
    }
}
