// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::block::{Block, of_slopes};
use super::information::{Information, Posterior};
use super::parameter::{LEAKS, leak_column};
use crate::Real;

/// Change of a leak within one memory that is usual, in prior units: a leak that empties the cylinder in four
/// minutes at 1 MPa (the prior's empties it in a tenth of a second).
const USUAL_CHANGE: f64 = 0.1 / 240.0;

/// The hypothesis that each leak has a level and a slope, and that what is known of both fades with a memory:
/// a local linear trend as a discount model (M. West, J. Harrison 1997, Bayesian Forecasting and Dynamic
/// Models, §6.3 and §7.2). It holds for leaks that grow steadily for about as long as the memory.
///
/// Slopes are counted in [`USUAL_CHANGE`] per memory, and have a unit prior as everything else.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Trend<T, const N: usize> {
    pub memory_s: T,
    /// Information of all parameters as they are now; between slopes at [`of_slopes`].
    levels: Information<T, N>,
    /// Information between slopes and parameters.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    cross: [[T; N]; LEAKS],
    slope_vector: [T; LEAKS],
}

/// The slopes eliminated from a trend's normal equations by S = L D Lᵀ: given the levels θ they are
/// s = L⁻ᵀ D⁻¹ (h − H θ), with covariance S⁻¹ about that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elimination<T, const N: usize> {
    /// Information of the levels with the slopes eliminated (Schur complement).
    pub levels: Information<T, N>,
    /// L at [`below`] the diagonal, which is one.
    lower: [T; LEAKS],
    /// H = L⁻¹ C.
    half: [[T; N]; LEAKS],
    /// h = L⁻¹ ξ.
    half_vector: [T; LEAKS],
    /// D.
    pub pivots: [T; LEAKS],
    /// 1/D.
    inverse_pivot: [T; LEAKS],
}

impl<T: Real, const N: usize> Trend<T, N> {
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn new(memory_s: T) -> Self {
        Self::from_levels(memory_s, Information::new())
    }

    /// Levels known, nothing of the slopes.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn from_levels(memory_s: T, mut levels: Information<T, N>) -> Self {
        for i in 0..LEAKS {
            for j in 0..=i {
                let (row, column) = of_slopes(i, j);
                levels.matrix[row][column] = T::zero();
            }
        }
        Self { memory_s, levels, cross: [[T::zero(); N]; LEAKS], slope_vector: [T::zero(); LEAKS] }
    }

    /// What another trend knows, with this memory.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn from_trend(memory_s: T, other: &Self) -> Self {
        let unit = other.memory_s / memory_s;
        let mut trend = Self { memory_s, ..*other };
        for i in 0..LEAKS {
            for j in 0..=i {
                let (row, column) = of_slopes(i, j);
                trend.levels.matrix[row][column] *= unit * unit;
            }
            for j in 0..N {
                trend.cross[i][j] *= unit;
            }
            trend.slope_vector[i] *= unit;
        }
        trend
    }

    /// Change of a level per s, prior units, where a slope is one.
    pub fn rate_ps(&self) -> T {
        T::lit(USUAL_CHANGE) / self.memory_s
    }

    /// `elapsed_s` passes: what is known fades, and the levels move on by their slopes.
    pub fn advance(&mut self, elapsed_s: T) {
        let keep = T::one() / (T::one() + elapsed_s / self.memory_s);
        self.levels.forget(keep);
        let moved = elapsed_s * self.rate_ps();
        for i in 0..LEAKS {
            let own = leak_column(i);
            for j in 0..=i {
                let other = leak_column(j);
                let (row, column) = of_slopes(i, j);
                let slopes =
                    self.levels.matrix[row][column] - moved * (self.cross[i][other] + self.cross[j][own]);
                self.levels.matrix[row][column] =
                    keep * slopes + moved * moved * self.levels.entry(own, other);
            }
            self.slope_vector[i] = keep * self.slope_vector[i] - moved * self.levels.vector[own];
        }
        for i in 0..LEAKS {
            for j in 0..N {
                self.cross[i][j] = keep * self.cross[i][j] - moved * self.levels.entry(leak_column(i), j);
            }
        }
    }

    /// Parameter `own`, which has no slope, has moved by something of this variance: as
    /// [`Information::diffuse`], of levels and slopes together.
    pub fn diffuse(&mut self, own: usize, variance: T) {
        let share = variance / (T::one() + variance * self.levels.matrix[own][own]);
        let column = self.cross.map(|row| row[own]);
        for i in 0..LEAKS {
            let through = share * column[i];
            for j in 0..N {
                self.cross[i][j] -= through * self.levels.entry(own, j);
            }
            for j in 0..=i {
                let (row, place) = of_slopes(i, j);
                self.levels.matrix[row][place] -= through * column[j];
            }
            self.slope_vector[i] -= through * self.levels.vector[own];
        }
        self.levels.diffuse(own, variance);
    }

    pub fn add(&mut self, block: &Block<T, N>) {
        self.levels.add(block);
        let rate = self.rate_ps();
        for i in 0..LEAKS {
            for j in 0..N {
                self.cross[i][j] -= rate * block.aged[i][j];
            }
            for j in 0..=i {
                let (row, column) = of_slopes(i, j);
                self.levels.matrix[row][column] += rate * rate * block.matrix[row][column];
            }
            self.slope_vector[i] -= rate * block.aged_vector[i];
        }
    }

    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn eliminate_slopes(&self) -> Elimination<T, N> {
        let zero = [T::zero(); LEAKS];
        let mut eliminated = Elimination {
            levels: Information::new(),
            lower: zero,
            half: [[T::zero(); N]; LEAKS],
            half_vector: zero,
            pivots: zero,
            inverse_pivot: zero,
        };
        eliminated.factor(&self.levels.matrix);
        eliminated.halve(&self.cross, &self.slope_vector);
        eliminated.leave(&self.levels);
        eliminated
    }
}

impl<T: Real, const N: usize> Elimination<T, N> {
    /// L and D of S + 1 = L D Lᵀ; S at [`of_slopes`] of `matrix`.
    fn factor(&mut self, matrix: &[[T; N]; N]) {
        for i in 0..LEAKS {
            for j in 0..i {
                let (row, column) = of_slopes(i, j);
                let mut sum = matrix[row][column];
                for k in 0..j {
                    // L D stands here until its row is done.
                    sum -= self.lower[below(i, k)] * self.lower[below(j, k)];
                }
                self.lower[below(i, j)] = sum;
            }
            let (row, column) = of_slopes(i, i);
            let diagonal = matrix[row][column] + T::one();
            let mut pivot = diagonal;
            for j in 0..i {
                let own = self.lower[below(i, j)] * self.inverse_pivot[j];
                pivot -= own * self.lower[below(i, j)];
                self.lower[below(i, j)] = own;
            }
            // Rounding (in f32) may not take from the prior.
            let floor = T::lit(0.5) + T::lit(8.0) * T::epsilon() * diagonal;
            self.pivots[i] = pivot.at_least(floor);
            self.inverse_pivot[i] = T::one() / self.pivots[i];
        }
    }

    /// H and h from C and ξ.
    fn halve(&mut self, cross: &[[T; N]; LEAKS], slope_vector: &[T; LEAKS]) {
        for i in 0..LEAKS {
            for j in 0..N {
                let mut entry = cross[i][j];
                for k in 0..i {
                    entry -= self.lower[below(i, k)] * self.half[k][j];
                }
                self.half[i][j] = entry;
            }
            let mut entry = slope_vector[i];
            for k in 0..i {
                entry -= self.lower[below(i, k)] * self.half_vector[k];
            }
            self.half_vector[i] = entry;
        }
    }

    /// What is left of the levels' information. Entry by entry: registers are few on a microcontroller.
    fn leave(&mut self, levels: &Information<T, N>) {
        for j in 0..N {
            let mut factor = [T::zero(); LEAKS];
            for i in 0..LEAKS {
                factor[i] = self.half[i][j] * self.inverse_pivot[i];
            }
            for k in 0..j + 1 {
                let mut entry = levels.matrix[j][k];
                for i in 0..LEAKS {
                    entry -= factor[i] * self.half[i][k];
                }
                self.levels.matrix[j][k] = entry;
            }
            let mut entry = levels.vector[j];
            for i in 0..LEAKS {
                entry -= factor[i] * self.half_vector[i];
            }
            self.levels.vector[j] = entry;
        }
        self.levels.column_noise = levels.column_noise;
    }

    /// Mean slopes that go with the levels.
    pub fn slopes(&self, levels: &[T; N]) -> [T; LEAKS] {
        let mut slopes = self.half_vector;
        for i in 0..LEAKS {
            for j in 0..N {
                slopes[i] -= self.half[i][j] * levels[j];
            }
            slopes[i] *= self.inverse_pivot[i];
        }
        for back in 0..LEAKS {
            let i = LEAKS - 1 - back;
            for k in i + 1..LEAKS {
                let known = slopes[k];
                slopes[i] -= self.lower[below(k, i)] * known;
            }
        }
        slopes
    }

    /// Mean and variance of each slope, per s; `rate_ps` is that of a slope of one.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn slopes_ps(&self, levels: &Posterior<T, N>, rate_ps: T) -> [(T, T); LEAKS] {
        let mean = self.slopes(&levels.mean);
        let mut slopes = [(T::zero(), T::zero()); LEAKS];
        for i in 0..LEAKS {
            let mut one = [T::zero(); LEAKS];
            one[i] = rate_ps;
            slopes[i] = (rate_ps * mean[i], self.variance(levels, &[T::zero(); N], &one));
        }
        slopes
    }

    /// Variance of aᵀθ + bᵀs.
    pub fn variance(&self, levels: &Posterior<T, N>, a: &[T; N], b: &[T; LEAKS]) -> T {
        let mut through = *b;
        let mut whole = *a;
        let mut variance = T::zero();
        for i in 0..LEAKS {
            for k in 0..i {
                let known = through[k];
                through[i] -= self.lower[below(i, k)] * known;
            }
            let factor = through[i] * self.inverse_pivot[i];
            variance += factor * through[i];
            for j in 0..N {
                whole[j] -= self.half[i][j] * factor;
            }
        }
        variance + levels.variance(&whole)
    }
}

/// Place of what stands in row `i` and column `j` < `i`, row by row.
#[inline]
const fn below(i: usize, j: usize) -> usize {
    i + j - 1
}

#[cfg(test)]
mod tests {
    use super::super::block::BlockSums;
    use super::super::information::Prior;
    use super::*;

    const OFFSETS: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
    const PRIOR: Prior<'static, f64> = Prior { mean_0: 0.0, offsets: &OFFSETS };
    const GROWTH_PS: [f64; LEAKS] = [3e-5, -1e-5, 0.0];

    /// A minute of exact readings of leaks that grow, with columns that turn.
    fn grown(memory_s: f64) -> Trend<f64, 4> {
        let mut trend = Trend::new(memory_s);
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
            trend.add(&Block::new(0.5, &sums, &[None; 2], 0.0));
        }
        trend
    }

    #[test]
    fn finds_levels_and_slopes_of_leaks_that_grow() {
        for memory_s in [10.0, 100.0, 3600.0] {
            let trend = grown(memory_s);
            let slopes = trend.eliminate_slopes();
            let now = slopes.levels.solve(&PRIOR);
            let found = slopes.slopes(&now.mean);
            for i in 0..LEAKS {
                let start = [1e-3, 2e-3, 5e-4][i];
                // A block's rows count as if of its middle.
                assert!((now.mean[1 + i] - (start + 60.0 * GROWTH_PS[i])).abs() < 2e-6, "{memory_s} s");
                assert!((found[i] * trend.rate_ps() - GROWTH_PS[i]).abs() < 2e-7, "{memory_s} s");
            }
        }
    }

    #[test]
    fn another_memory_changes_nothing_of_what_is_known() {
        let long = grown(100.0);
        let other = Trend::from_trend(7.0, &long);
        let ends = [long, other].map(|trend| {
            let slopes = trend.eliminate_slopes();
            let now = slopes.levels.solve(&PRIOR);
            (now.mean, slopes.slopes(&now.mean).map(|slope| slope * trend.rate_ps()))
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
        let matrix = |trend: &Trend<f64, 4>, r: usize, c: usize| match (r.checked_sub(4), c.checked_sub(4)) {
            (None, None) => trend.levels.entry(r, c),
            (Some(slope), None) => trend.cross[slope][c],
            (None, Some(slope)) => trend.cross[slope][r],
            (Some(a), Some(b)) => {
                let (row, column) = of_slopes(a.max(b), a.min(b));
                trend.levels.matrix[row][column]
            }
        };
        let vector = |trend: &Trend<f64, 4>, r: usize| match r.checked_sub(4) {
            None => trend.levels.vector[r],
            Some(slope) => trend.slope_vector[slope],
        };
        let (before, own) = (grown(100.0), 0);
        // As much as was known of it.
        let variance = 1.0 / before.levels.entry(own, own);
        let mut after = before;
        after.diffuse(own, variance);
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
}
