// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::block::Block;
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
    /// Information of all parameters as they are now.
    levels: Information<T, N>,
    /// Information between slopes and parameters.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    cross: [[T; N]; LEAKS],
    /// Information between slopes, both triangles.
    slopes: [[T; LEAKS]; LEAKS],
    slope_vector: [T; LEAKS],
}

/// The slopes eliminated from a trend's normal equations by Cholesky S = R Rᵀ: given the levels θ they are
/// s = R⁻ᵀ (h − H θ), with covariance S⁻¹ about that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elimination<T, const N: usize> {
    /// R below the diagonal, and 1/R on it.
    root: [[T; LEAKS]; LEAKS],
    /// H = R⁻¹ C.
    half: [[T; N]; LEAKS],
    /// h = R⁻¹ ξ.
    half_vector: [T; LEAKS],
    /// Diagonal of R².
    pub pivots: [T; LEAKS],
}

impl<T: Real, const N: usize> Trend<T, N> {
    pub fn new(memory_s: T) -> Self {
        Self::from_levels(memory_s, Information::new())
    }

    /// Levels known, nothing of the slopes.
    pub fn from_levels(memory_s: T, levels: Information<T, N>) -> Self {
        Self {
            memory_s,
            levels,
            cross: [[T::zero(); N]; LEAKS],
            slopes: [[T::zero(); LEAKS]; LEAKS],
            slope_vector: [T::zero(); LEAKS],
        }
    }

    /// What another trend knows, with this memory.
    pub fn from_trend(memory_s: T, other: &Self) -> Self {
        let unit = other.memory_s / memory_s;
        Self {
            memory_s,
            levels: other.levels,
            cross: other.cross.map(|row| row.map(|c| c * unit)),
            slopes: other.slopes.map(|row| row.map(|s| s * unit * unit)),
            slope_vector: other.slope_vector.map(|v| v * unit),
        }
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
        let before = self.cross;
        for i in 0..LEAKS {
            let own = leak_column(i);
            for j in 0..N {
                self.cross[i][j] = keep * before[i][j] - moved * self.levels.entry(own, j);
            }
            for j in 0..LEAKS {
                let other = leak_column(j);
                self.slopes[i][j] = keep * (self.slopes[i][j] - moved * (before[i][other] + before[j][own]))
                    + moved * moved * self.levels.entry(own, other);
            }
            self.slope_vector[i] = keep * self.slope_vector[i] - moved * self.levels.vector[own];
        }
    }

    /// Parameter `own`, which has no slope, has moved by something of this variance: as
    /// [`Information::diffuse`], of levels and slopes together.
    pub fn diffuse(&mut self, own: usize, variance: T) {
        let levels = &self.levels;
        let share = variance / (T::one() + variance * levels.matrix[own][own]);
        let column = self.cross.map(|row| row[own]);
        for i in 0..LEAKS {
            let through = share * column[i];
            for j in 0..N {
                self.cross[i][j] -= through * levels.entry(own, j);
            }
            for j in 0..LEAKS {
                self.slopes[i][j] -= through * column[j];
            }
            self.slope_vector[i] -= through * levels.vector[own];
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
            for j in 0..LEAKS {
                self.slopes[i][j] += rate * rate * block.aged_square[i][j];
            }
            self.slope_vector[i] -= rate * block.aged_vector[i];
        }
    }

    /// The levels' information with the slopes eliminated (Schur complement), and how the slopes follow.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn eliminate_slopes(&self) -> (Information<T, N>, Elimination<T, N>) {
        let (root, pivots) = self.slope_root();
        let mut half = self.cross;
        let mut half_vector = self.slope_vector;
        for i in 0..LEAKS {
            for k in 0..i {
                let factor = root[i][k];
                for j in 0..N {
                    let above = half[k][j];
                    half[i][j] -= factor * above;
                }
                let known = half_vector[k];
                half_vector[i] -= factor * known;
            }
            for j in 0..N {
                half[i][j] *= root[i][i];
            }
            half_vector[i] *= root[i][i];
        }
        let mut levels = self.levels;
        for i in 0..N {
            for k in 0..LEAKS {
                let factor = half[k][i];
                for j in 0..=i {
                    levels.matrix[i][j] -= factor * half[k][j];
                }
                levels.vector[i] -= factor * half_vector[k];
            }
        }
        (levels, Elimination { root, half, half_vector, pivots })
    }

    /// R of S + 1 = R Rᵀ with 1/R on its diagonal, and the diagonal of R².
    fn slope_root(&self) -> ([[T; LEAKS]; LEAKS], [T; LEAKS]) {
        let mut root = [[T::zero(); LEAKS]; LEAKS];
        let mut pivots = [T::zero(); LEAKS];
        for i in 0..LEAKS {
            for j in 0..i {
                let mut sum = self.slopes[i][j];
                for k in 0..j {
                    sum -= root[i][k] * root[j][k];
                }
                root[i][j] = sum * root[j][j];
            }
            let mut pivot = self.slopes[i][i] + T::one();
            let floor = T::lit(8.0) * T::epsilon() * pivot;
            for k in 0..i {
                pivot -= root[i][k] * root[i][k];
            }
            // Rounding (in f32) may not take from the prior.
            pivots[i] = pivot.max(T::lit(0.5)).max(floor);
            root[i][i] = T::one() / pivots[i].sqrt();
        }
        (root, pivots)
    }
}

impl<T: Real, const N: usize> Elimination<T, N> {
    /// Leaks that do not change.
    pub fn no_slopes() -> Self {
        Self {
            root: [[T::zero(); LEAKS]; LEAKS],
            half: [[T::zero(); N]; LEAKS],
            half_vector: [T::zero(); LEAKS],
            pivots: [T::one(); LEAKS],
        }
    }

    /// Mean slopes that go with the levels.
    pub fn slopes(&self, levels: &[T; N]) -> [T; LEAKS] {
        let mut slopes = self.half_vector;
        for i in 0..LEAKS {
            for j in 0..N {
                slopes[i] -= self.half[i][j] * levels[j];
            }
        }
        for back in 0..LEAKS {
            let i = LEAKS - 1 - back;
            for k in i + 1..LEAKS {
                let known = slopes[k];
                slopes[i] -= self.root[k][i] * known;
            }
            slopes[i] *= self.root[i][i];
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
                through[i] -= self.root[i][k] * known;
            }
            through[i] *= self.root[i][i];
            variance += through[i] * through[i];
            for j in 0..N {
                whole[j] -= self.half[i][j] * through[i];
            }
        }
        variance + levels.variance(&whole)
    }
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
            let (levels, slopes) = trend.eliminate_slopes();
            let now = levels.solve(&PRIOR);
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
            let (levels, slopes) = trend.eliminate_slopes();
            let now = levels.solve(&PRIOR);
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
            (Some(a), Some(b)) => trend.slopes[a][b],
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
