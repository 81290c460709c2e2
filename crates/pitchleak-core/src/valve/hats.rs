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

/// x, P_A, P_B, spool; P_A, P_B of the readings between.
pub(super) const MEANS: usize = 6;
/// Those that a sample has.
pub(super) const READ: usize = 4;

/// A sample whose next step is not known yet.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Sampled<T> {
    pub rates: [T; SUMS],
    pub read: [T; READ],
    /// Step before it, s; zero after a gap.
    pub before_s: T,
}

/// Samples of one block.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Block<T> {
    pub count: T,
    pub samples: u32,
    /// Of its steps, s.
    pub time_s: T,
    /// Integrals over its samples' halves of steps, …
    pub sums: [T; SUMS],
    /// … and those with weights that rise by one with each sample.
    rising: [T; SUMS],
    means: [T; MEANS],
    /// P_A, P_B of its first and of its last sample.
    ends: [[T; 2]; 2],
}

/// Every second sample of a block: how many, by how much the weight of the first and last is less than 1, one over the sum of the
/// weights, and the sum of their squares over its square.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seconds<T> {
    many: T,
    less: T,
    per_sum: T,
    pub square: T,
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
        Self {
            count: none,
            samples: 0,
            ends: [[none; 2]; 2],
            time_s: none,
            sums: [none; SUMS],
            rising: [none; SUMS],
            means: [none; MEANS],
        }
    }

    /// Adds a sample with the steps before and after it, s, and its rates.
    pub fn add(&mut self, sample: &Sampled<T>, after_s: T) {
        let half = T::lit(0.5);
        let [before_s, after_s] = [half * sample.before_s, half * after_s];
        let whole = before_s + after_s;
        let rising = self.count * whole + after_s;
        self.count += T::one();
        self.samples += 1;
        self.time_s += whole;
        for ((sum, ramp), rate) in self.sums.iter_mut().zip(&mut self.rising).zip(&sample.rates) {
            *sum += whole * *rate;
            *ramp += rising * *rate;
        }
        let [x, pa, pb, spool] = sample.read;
        let [of_x, of_a, of_b, of_spool, between_a, between_b] = &mut self.means;
        *of_x += x;
        *of_spool += spool;
        let [a, b] = if self.samples % 2 == 1 { [of_a, of_b] } else { [between_a, between_b] };
        *a += pa;
        *b += pb;
        self.ends[1] = [pa, pb];
        if self.samples == 1 {
            self.ends[0] = [pa, pb];
        }
    }

    /// Whether its number of samples is odd: then every second sample from the first to the last have the middle of all.
    pub fn is_odd(&self) -> bool {
        self.samples % 2 == 1
    }

    /// How every second sample, of M, are weighed: the ends by 1 − M/(4M − 6), then their spread in time is that of all, (N² − 1)/12.
    pub fn seconds(&self) -> Seconds<T> {
        let one = T::one();
        let many = T::lit(0.5) * (self.count + one);
        let less = many / (T::lit(4.0) * many - T::lit(6.0));
        let per_sum = (many - less - less).recip();
        let end = one - less;
        let square = (many - T::lit(2.0) + T::lit(2.0) * end * end) * per_sum * per_sum;
        Seconds { many, less, per_sum, square }
    }

    fn means(&self) -> [T; MEANS] {
        let Seconds { many, less, per_sum, .. } = self.seconds();
        let (per_count, per_between) = (self.count.recip(), (self.count - many).recip());
        let [x, pa, pb, spool, between_a, between_b] = self.means;
        let [[first_a, first_b], [last_a, last_b]] = self.ends;
        let pa = (pa - less * (first_a + last_a)) * per_sum;
        let pb = (pb - less * (first_b + last_b)) * per_sum;
        [x * per_count, pa, pb, spool * per_count, between_a * per_between, between_b * per_between]
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
        let (before, mut rise) = (first.means(), last.means());
        let x_m = half * (before[0] + rise[0]);
        rise.iter_mut().zip(before).for_each(|(rise, before)| *rise -= before);
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
                let sample = Sampled { rates: [rate; SUMS], read: [x; READ], before_s };
                before_s = 0.01 * (1.0 + 0.2 * next().abs());
                blocks[at].add(&sample, before_s);
                let after = rate + 0.3 * next();
                x += 0.5 * before_s * (rate + after);
                rate = after;
            }
        }
        let hat = Hat::over(&blocks[0], &blocks[1]);
        assert!((hat.sums[7] - hat.rise[3]).abs() < 1e-12, "{} {}", hat.sums[7], hat.rise[3]);
    }
}
