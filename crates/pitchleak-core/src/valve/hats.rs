//! Integrals against hats, from means over blocks: nothing is differentiated, and the noise of many readings averages out.
//!
//! With x̄_k the mean of block k, of N samples, and I_m the integral of ẋ by the trapezoidal rule over the step that ends at its sample m:
//!
//! ```text
//! x̄_k+1 − x̄_k = Σ_m (m/N) I_m of block k + Σ_m (1 − m/N) I_m of block k+1
//! ```
//!
//! So both continuity equations hold between two means where leaks and flows are integrated with a weight that rises over one block
//! and falls over the next: a weak form with linear test functions. It is exact for steps of any length: each sample stands in half of
//! the step before it, of weight m/N, and in half of the one after it, of weight (m + 1)/N.

use super::edges::SUMS;
use crate::Real;

/// x, P_A, P_B, spool.
pub(super) const MEANS: usize = 4;

/// A sample whose next step is not known yet.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Sampled<T> {
    pub rates: [T; SUMS],
    pub read: [T; MEANS],
    /// Step before it, s; zero after a gap.
    pub before_s: T,
}

/// Samples of one block.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Block<T> {
    pub count: T,
    /// Of its steps, s.
    pub time_s: T,
    /// Integrals over its samples' halves of steps, …
    pub sums: [T; SUMS],
    /// … and those with weights that rise by one with each sample.
    rising: [T; SUMS],
    means: [T; MEANS],
}

/// Two blocks: what is integrated against the hat over both, and by how much the means differ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hat<T> {
    pub sums: [T; SUMS],
    pub rise: [T; MEANS],
    /// Position at its peak, m.
    pub x_m: T,
    /// Integral of the hat, s.
    pub time_s: T,
}

impl<T: Real> Block<T> {
    pub fn new() -> Self {
        let none = T::zero();
        Self { count: none, time_s: none, sums: [none; SUMS], rising: [none; SUMS], means: [none; MEANS] }
    }

    /// Adds a sample with the steps before and after it, s, and its rates.
    pub fn add(&mut self, sample: &Sampled<T>, after_s: T) {
        let half = T::lit(0.5);
        let [before_s, after_s] = [half * sample.before_s, half * after_s];
        let whole = before_s + after_s;
        let rising = self.count * whole + after_s;
        self.count += T::one();
        self.time_s += whole;
        for ((sum, ramp), rate) in self.sums.iter_mut().zip(&mut self.rising).zip(&sample.rates) {
            *sum += whole * *rate;
            *ramp += rising * *rate;
        }
        self.means.iter_mut().zip(sample.read).for_each(|(mean, value)| *mean += value);
    }

    /// Mean of the spool, a share of its stroke.
    pub fn spool(&self) -> T {
        self.means[3] / self.count
    }
}

impl<T: Real> Hat<T> {
    pub fn over(first: &Block<T>, last: &Block<T>) -> Self {
        let half = T::lit(0.5);
        let (per_first, per_last) = (first.count.recip(), last.count.recip());
        let mut sums = [T::zero(); SUMS];
        for ((sum, before), (falls, ramp)) in
            sums.iter_mut().zip(&first.rising).zip(last.sums.iter().zip(&last.rising))
        {
            *sum = *before * per_first + *falls - *ramp * per_last;
        }
        let mut rise = last.means;
        for (rise, before) in rise.iter_mut().zip(&first.means) {
            *rise = *rise * per_last - *before * per_first;
        }
        let x_m = half * (first.means[0] * per_first + last.means[0] * per_last);
        Self { sums, rise, x_m, time_s: half * (first.time_s + last.time_s) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak_testkit::white_noise;

    /// Whatever the steps: means differ by what is integrated against the hat.
    #[test]
    fn means_differ_by_the_integral_against_the_hat() {
        let mut normal = white_noise(4);
        let mut next = || normal.next().unwrap_or_default();
        let (mut x, mut rate, mut before_s) = (0.0, 1.0, 0.0);
        let mut blocks = [Block::new(), Block::new()];
        for (at, block) in [(0, 9), (1, 14)] {
            for _ in 0..block {
                let sample = Sampled { rates: [rate; SUMS], read: [x; MEANS], before_s };
                before_s = 0.01 * (1.0 + 0.2 * next().abs());
                blocks[at].add(&sample, before_s);
                let after = rate + 0.3 * next();
                x += 0.5 * before_s * (rate + after);
                rate = after;
            }
        }
        let hat = Hat::over(&blocks[0], &blocks[1]);
        assert!((hat.sums[7] - hat.rise[2]).abs() < 1e-12, "{} {}", hat.sums[7], hat.rise[2]);
    }
}
