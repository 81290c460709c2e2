//! Hypotheses on how fast the leaks change, and what several of them know together.

// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::block::Block;
use super::information::{Information, Posterior, Prior, Solution};
use crate::Real;

/// Change of a leak within one memory that is usual, in prior units: a leak that empties the cylinder in four
/// minutes at 1 MPa (the prior's empties it in a tenth of a second).
const USUAL_CHANGE: f64 = 0.1 / 240.0;

/// How fast the leaks change: that they stay, or that each has a level and a slope; what is known of both fades with a memory.
///
/// The latter is a local linear trend as a discount model (M. West, J. Harrison 1997, Bayesian Forecasting and Dynamic
/// Models, §6.3 and §7.2). It holds for leaks that grow steadily for about as long as the memory.
///
/// Slopes are counted in [`USUAL_CHANGE`] per memory, and have a unit prior as everything else.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct Hypothesis<T, const N: usize> {
    pub memory_s: T,
    has_slopes: bool,
    pub known: Information<T, N>,
}

impl<T: Real, const N: usize> Hypothesis<T, N> {
    /// The leaks stay.
    pub fn steady(memory_s: T) -> Self {
        Self { memory_s, has_slopes: false, known: Information::new() }
    }

    /// The leaks have slopes.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn trend(memory_s: T) -> Self {
        Self { has_slopes: true, ..Self::steady(memory_s) }
    }

    /// Knows nothing.
    pub fn forget_all(&mut self) {
        self.known = Information::new();
    }

    /// Knows what `other` knows.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn take_over(&mut self, other: &Self) {
        self.known = other.known;
        if !self.has_slopes {
            self.known = other.known.without_slopes();
        } else if other.has_slopes {
            self.known.count_slopes_in(other.memory_s / self.memory_s);
        }
    }

    /// Change of a level per s, prior units, where a slope is one; zero where there are none.
    pub fn rate_ps(&self) -> T {
        if self.has_slopes { T::lit(USUAL_CHANGE) / self.memory_s } else { T::zero() }
    }

    /// `elapsed_s` passes: what is known fades, and levels move on by their slopes.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn advance(&mut self, elapsed_s: T) {
        let keep = T::one() / (T::one() + elapsed_s / self.memory_s);
        self.known.advance(keep, elapsed_s * self.rate_ps());
    }

    /// Takes in what a block tells.
    pub fn learn(&mut self, block: &Block<T, N>) {
        self.known.add(&block.information, self.rate_ps());
    }

    /// Makes `posterior` what it knows.
    pub fn solve(&self, prior: &Prior<'_, T>, posterior: &mut Posterior<T, N>) {
        self.known.solve(prior, self.rate_ps(), posterior);
    }
}

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
    use super::super::block::BlockSums;
    use super::super::prior::LEAKS;
    use super::*;

    impl<T: Real, const N: usize> Hypothesis<T, N> {
        pub fn solved(&self, prior: &Prior<'_, T>) -> Posterior<T, N> {
            self.known.solved(prior, self.rate_ps())
        }
    }

    const OFFSETS: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
    const PRIOR: Prior<'static, f64> = Prior { mean_0: 0.0, offsets: &OFFSETS };
    const GROWTH_PS: [f64; LEAKS] = [3e-5, -1e-5, 0.0];

    /// A minute of exact readings of leaks that grow, with columns that turn.
    fn grown(memory_s: f64) -> Hypothesis<f64, 4> {
        let mut trend = Hypothesis::trend(memory_s);
        for index in 0..120 {
            let mut sums = BlockSums::new();
            for k in 0..10 {
                let t_s = f64::from(index) * 0.5 + f64::from(k) * 0.05 + 0.025;
                let f = [t_s.sin(), 1.0 + (0.7 * t_s).cos(), (1.9 * t_s).sin(), 0.5];
                let theta = [0.2, 1e-3 + GROWTH_PS[0] * t_s, 2e-3 + GROWTH_PS[1] * t_s, 5e-4];
                let y = f.iter().zip(theta).map(|(f, theta)| f * theta).sum();
                sums.add(&f, &[0.0; LEAKS], y, 1e14);
            }
            trend.advance(0.5);
            trend.learn(&Block::new(0.5, &sums, &[None; 2], 0.0));
        }
        trend
    }

    #[test]
    fn finds_levels_and_slopes_of_leaks_that_grow() {
        for memory_s in [10.0, 100.0, 3600.0] {
            let trend = grown(memory_s);
            let now = trend.solved(&PRIOR);
            for i in 0..LEAKS {
                let start = [1e-3, 2e-3, 5e-4][i];
                // A block's rows count as if of its middle.
                assert!((now.mean[1 + i] - (start + 60.0 * GROWTH_PS[i])).abs() < 2e-6, "{memory_s} s");
                assert!((now.slopes_ps()[i] - GROWTH_PS[i]).abs() < 2e-7, "{memory_s} s");
            }
        }
    }

    #[test]
    fn another_memory_changes_nothing_of_what_is_known() {
        let long = grown(100.0);
        let mut other = Hypothesis::trend(7.0);
        other.take_over(&long);
        let ends = [long, other].map(|trend| {
            let now = trend.solved(&PRIOR);
            (now.mean, now.slopes_ps())
        });
        for i in 0..LEAKS {
            assert!((ends[0].0[1 + i] - ends[1].0[1 + i]).abs() < 1e-9);
            assert!((ends[0].1[i] - ends[1].1[i]).abs() < 1e-9);
        }
    }

    /// (M⁻¹ + v e eᵀ) M' = M⁻¹ M, without an inverse: M' + v M'e eᵀM = M, and so with the vector.
    #[test]
    fn what_has_moved_is_known_by_its_variance_less() {
        const WIDTH: usize = 4 + LEAKS;
        let matrix = |trend: &Hypothesis<f64, 4>, r: usize, c: usize| {
            let joint = &trend.known.matrix;
            match (r.max(c), r.min(c)) {
                (r, c) if r < 4 => joint.level(r, c),
                (r, c) if c < 4 => joint.cross[r - 4][c],
                (r, c) => joint.slope(r - 4, c - 4),
            }
        };
        let vector = |trend: &Hypothesis<f64, 4>, r: usize| match r.checked_sub(4) {
            None => trend.known.levels[r],
            Some(slope) => trend.known.slopes[slope],
        };
        let (before, own) = (grown(100.0), 0);
        // As much as was known of it.
        let variance = 1.0 / matrix(&before, own, own);
        let mut after = before;
        after.known.diffuse(own, variance);
        for r in 0..WIDTH {
            let moved = variance * matrix(&after, r, own);
            for c in 0..WIDTH {
                let again = matrix(&after, r, c) + moved * matrix(&before, own, c);
                let known = matrix(&before, r, c);
                let scale = (matrix(&before, r, r) * matrix(&before, c, c)).sqrt();
                assert!((again - known).abs() < 1e-12 * scale, "{r} {c}: {again} {known}");
            }
            let (again, known) = (vector(&after, r) + moved * vector(&before, own), vector(&before, r));
            assert!(
                (again - known).abs() < 1e-12 * known.abs().max(vector(&before, own).abs()),
                "{r}: {again} {known}"
            );
        }
    }

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
    fn a_mixture_is_the_weighed_mean_and_the_spread_about_it() {
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
