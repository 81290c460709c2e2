//! Integrals against hats, from means over blocks: nothing is differentiated, and the noise of many readings averages out.
//!
//! With x̄_k the mean of block k, of N samples, and I_m the integral of ẋ by the trapezoidal rule over the step that ends at its sample m:
//!
//! ```text
//! x̄_k+1 − x̄_k = Σ_m (m/N) I_m of block k + Σ_m (1 − m/N) I_m of block k+1
//! ```
//!
//! So both continuity equations hold between two means where leaks and flows are integrated with a weight that rises over one block
//! and falls over the next: a weak form with linear test functions. It is exact for steps of any length.

use super::edges::{SUMS, Scaled};
use crate::Real;

/// x, P_A, P_B, spool.
pub(super) const MEANS: usize = 4;

/// Samples of one block.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Block<T> {
    pub count: T,
    /// Of its steps, s.
    pub time_s: T,
    /// Σ I_m.
    pub sums: [T; SUMS],
    /// Σ (N − m) I_m.
    falling: [T; SUMS],
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
        Self { count: none, time_s: none, sums: [none; SUMS], falling: [none; SUMS], means: [none; MEANS] }
    }

    /// Goes on to a reading, `dt_s` after the one before, where `rates` are their own and `before` those of that one.
    pub fn add(&mut self, dt_s: T, before: &[T; SUMS], rates: &[T; SUMS], reading: &Scaled<T>) {
        let half = T::lit(0.5) * dt_s;
        self.count += T::one();
        self.time_s += dt_s;
        let (sums, falling) = (self.sums.iter_mut(), self.falling.iter_mut());
        for ((sum, falling), (was, is)) in sums.zip(falling).zip(before.iter().zip(rates)) {
            *sum += half * (*was + *is);
            *falling += *sum;
        }
        let read = [reading.x_m, reading.pa, reading.pb, reading.spool];
        self.means.iter_mut().zip(read).for_each(|(mean, value)| *mean += value);
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
        let mut sums = first.sums;
        for ((sum, before), after) in sums.iter_mut().zip(&first.falling).zip(&last.falling) {
            *sum += *after * per_last - *before * per_first;
        }
        let mut rise = last.means;
        for (rise, before) in rise.iter_mut().zip(&first.means) {
            *rise = *rise * per_last - *before * per_first;
        }
        let x_m = half * (first.means[0] * per_first + last.means[0] * per_last);
        Self { sums, rise, x_m, time_s: half * (first.time_s + last.time_s) }
    }
}
