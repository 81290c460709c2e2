// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::information::{Posterior, Solution};
use crate::Real;

/// What several hypotheses know, weighed, one added after the other: the mean, and the covariance about it, which holds
/// what they disagree on.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct Mixture<T, const N: usize> {
    /// Of the covariance the lower triangle.
    known: Solution<T, N>,
    /// Sum of the weights, in units of e to the power of `largest`.
    weight: T,
    /// The largest ln of a weight.
    largest: T,
}

impl<T: Real, const N: usize> Mixture<T, N> {
    pub fn new() -> Self {
        Self { known: Solution::zero(), weight: T::zero(), largest: T::neg_infinity() }
    }

    /// Adds what one hypothesis knows; its weight is `share` times e to the power of `log_weight`.
    pub fn add(&mut self, share: T, log_weight: T, posterior: &Posterior<T, N>) {
        if share <= T::zero() {
            return;
        }
        let mut weight = share;
        if log_weight > self.largest {
            self.weight *= (self.largest - log_weight).libm_exp();
            self.largest = log_weight;
        } else {
            weight *= (log_weight - self.largest).libm_exp();
        }
        self.weight += weight;
        // Where all weigh nothing in T, the latest is as good as any.
        let part = if self.weight > T::zero() { weight / self.weight } else { T::one() };
        if part > T::epsilon() {
            self.mix(part, posterior);
        }
    }

    fn mix(&mut self, part: T, other: &Posterior<T, N>) {
        let rest = T::one() - part;
        let covariance = other.covariance();
        let mut apart = other.mean;
        for i in 0..N {
            apart[i] -= self.known.mean[i];
            self.known.mean[i] += part * apart[i];
            let moved = rest * apart[i];
            for j in 0..i + 1 {
                let own = &mut self.known.covariance[i][j];
                *own = rest * *own + part * (covariance[i][j] + moved * apart[j]);
            }
        }
    }

    pub fn solution(&self) -> Solution<T, N> {
        Solution::of(self.known.mean, self.known.covariance)
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::{Block, BlockSums};
    use super::super::information::{Information, Prior};
    use super::*;

    const PRIOR: Prior<'static, f64> = Prior { mean_0: 0.0, offsets: &[[1.0, 0.0], [0.0, 1.0]] };

    fn posterior(seed: f64) -> Posterior<f64, 4> {
        let mut sums = BlockSums::new();
        for k in 0..9 {
            let t = seed + f64::from(k);
            sums.add(
                &[t.sin(), (1.7 * t).cos(), (2.3 * t).sin(), 0.5],
                &[0.0; 3],
                3.0 * (5.0 * t).sin(),
                2.0,
            );
        }
        let mut information = Information::new();
        information.add(&Block::new(1.0, &sums, &[None; 2], 0.0).information, 0.0);
        information.solved(&PRIOR, 0.0)
    }

    /// Σ w m and Σ w (P + (m − m̄)(m − m̄)ᵀ), whatever the order, and one of no weight left out.
    #[test]
    fn is_the_weighed_mean_and_the_spread_about_it() {
        let parts = [(1.0, -3.0), (0.5, 0.5), (0.8, -1.0), (0.0, 9.0)]
            .map(|(share, log_weight): (f64, f64)| (share, log_weight, posterior(share - 2.0 * log_weight)));
        let whole: f64 = parts.iter().map(|(share, log, _)| share * log.exp()).sum();
        let weighed = |entry: &dyn Fn(&Solution<f64, 4>) -> f64| -> f64 {
            parts.iter().map(|(share, log, known)| share * log.exp() / whole * entry(&known.solution())).sum()
        };
        let mut forth = Mixture::new();
        parts.iter().for_each(|(share, log, known)| forth.add(*share, *log, known));
        let mut back = Mixture::new();
        parts.iter().rev().for_each(|(share, log, known)| back.add(*share, *log, known));
        for found in [forth.solution(), back.solution()] {
            let mean: [f64; 4] = core::array::from_fn(|i| weighed(&|known| known.mean[i]));
            for i in 0..4 {
                assert!((found.mean[i] - mean[i]).abs() < 1e-12);
                for j in 0..4 {
                    let spread = weighed(&|known| {
                        known.covariance[i][j] + (known.mean[i] - mean[i]) * (known.mean[j] - mean[j])
                    });
                    assert!((found.covariance[i][j] - spread).abs() < 1e-12);
                }
            }
        }
    }
}
