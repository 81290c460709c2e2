// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::{Joint, SLOPES};
use crate::Real;

/// U D Uᵀ of a joint information matrix A, last parameter first: the columns of the slopes, then those of the levels. The last
/// pivot is what is known of level 0 beyond all others.
#[derive(Clone, Copy)]
pub(crate) struct Factors<T, const N: usize> {
    slopes: Slopes<T, N>,
    /// U of the levels above the diagonal; on it and below what the slopes leave of A.
    upper: [[T; N]; N],
    pivots: [T; N],
    inverse_pivot: [T; N],
    /// What was taken off level 0.
    taken: T,
}

/// The columns of the slopes: A = [L C; Cᵀ S] with S = W D Wᵀ, W unit lower triangular by rows; what they leave of L is
/// L − Hᵀ D⁻¹ H with H = W⁻¹ Cᵀ.
#[derive(Clone, Copy)]
struct Slopes<T, const N: usize> {
    /// Whether there are any: else D is one, and W and H are of no use.
    any: bool,
    /// W at [`below`] the diagonal.
    lower: [T; SLOPES],
    /// H.
    half: [[T; N]; SLOPES],
    pivots: [T; SLOPES],
    inverse_pivot: [T; SLOPES],
}

/// Pivots of a joint matrix: their product is its determinant.
#[derive(Clone, Copy)]
pub(crate) struct Pivots<T, const N: usize> {
    levels: [T; N],
    slopes: [T; SLOPES],
}

/// Place of what stands in row `i` and column `j` < `i`, row by row.
#[inline]
const fn below(i: usize, j: usize) -> usize {
    i + j - 1
}

impl<T: Real, const N: usize> Slopes<T, N> {
    #[inline(always)]
    fn none() -> Self {
        let one = [T::one(); SLOPES];
        Self { any: false, lower: one, half: [[T::one(); N]; SLOPES], pivots: one, inverse_pivot: one }
    }

    /// The columns of `matrix`.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    fn eliminate(&mut self, matrix: &Joint<T, N>) {
        self.any = true;
        self.factor(matrix);
        for i in 0..SLOPES {
            for j in 0..N {
                let mut entry = matrix.cross[i][j];
                for k in 0..i {
                    entry -= self.lower[below(i, k)] * self.half[k][j];
                }
                self.half[i][j] = entry;
            }
        }
    }

    /// W and D of S + 1: slopes have a unit prior.
    fn factor(&mut self, matrix: &Joint<T, N>) {
        for i in 0..SLOPES {
            for j in 0..i {
                let mut sum = matrix.slope(i, j);
                for k in 0..j {
                    // W D stands here until its row is done.
                    sum -= self.lower[below(i, k)] * self.lower[below(j, k)];
                }
                self.lower[below(i, j)] = sum;
            }
            let diagonal = matrix.slope(i, i) + T::one();
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

    /// W⁻¹ ξ.
    fn forward(&self, mut vector: [T; SLOPES]) -> [T; SLOPES] {
        for i in 0..SLOPES {
            for k in 0..i {
                let known = vector[k];
                vector[i] -= self.lower[below(i, k)] * known;
            }
        }
        vector
    }

    /// What is `left` of the levels' lower triangle. Entry by entry: registers are few on a microcontroller.
    #[cfg_attr(target_os = "none", inline(never))]
    fn leave(&self, matrix: &Joint<T, N>, left: &mut [[T; N]; N]) {
        for j in 0..N {
            let mut factor = [T::zero(); SLOPES];
            for i in 0..SLOPES {
                factor[i] = self.half[i][j] * self.inverse_pivot[i];
            }
            for k in 0..j + 1 {
                let mut entry = matrix.level(j, k);
                for i in 0..SLOPES {
                    entry -= factor[i] * self.half[i][k];
                }
                left[j][k] = entry;
            }
        }
    }

    /// What they leave of a vector: the levels' part less Hᵀ D⁻¹ h, with h the slopes' part after [`forward`](Self::forward).
    fn left_vector(&self, mut levels: [T; N], half: &[T; SLOPES]) -> [T; N] {
        for i in 0..SLOPES {
            let factor = half[i] * self.inverse_pivot[i];
            for j in 0..N {
                levels[j] -= self.half[i][j] * factor;
            }
        }
        levels
    }

    /// The slopes that go with the levels: W⁻ᵀ D⁻¹ (h − H θ).
    fn back(&self, half: &[T; SLOPES], levels: &[T; N]) -> [T; SLOPES] {
        let mut slopes = *half;
        for i in 0..SLOPES {
            for j in 0..N {
                slopes[i] -= self.half[i][j] * levels[j];
            }
            slopes[i] *= self.inverse_pivot[i];
        }
        for back in 0..SLOPES {
            let i = SLOPES - 1 - back;
            for k in i + 1..SLOPES {
                let known = slopes[k];
                slopes[i] -= self.lower[below(k, i)] * known;
            }
        }
        slopes
    }
}

impl<T: Real, const N: usize> Factors<T, N> {
    /// Room for factors. All in it is one: zeros would be cleared by a function that is slow on a microcontroller.
    #[inline(always)]
    pub fn room() -> Self {
        Self {
            slopes: Slopes::none(),
            upper: [[T::one(); N]; N],
            pivots: [T::one(); N],
            inverse_pivot: [T::one(); N],
            taken: T::one(),
        }
    }

    /// Makes them those of `matrix` with `prior` added to its levels' lower triangle and one to each slope; without `slopes` it has none.
    /// Noise of `column_noise` in the column of level 0 is taken off its pivot, but never more than leaves the prior standing. In
    /// place: they are too large to be moved about.
    #[inline]
    pub fn factor(
        &mut self,
        matrix: &Joint<T, N>,
        slopes: bool,
        prior: impl Fn(usize, usize) -> Option<T>,
        column_noise: T,
    ) {
        if slopes {
            self.slopes.eliminate(matrix);
            self.slopes.leave(matrix, &mut self.upper);
        } else {
            if self.slopes.any {
                self.slopes = Slopes::none();
            }
            // Entry by entry: what stands above the diagonal is of no use.
            for i in 0..N {
                for j in 0..i + 1 {
                    self.upper[i][j] = matrix.level(i, j);
                }
            }
        }
        self.factor_levels(prior, column_noise);
    }

    /// What `matrix` and vectors leave of the levels once the slopes are eliminated (Schur complement).
    pub fn without_slopes(
        matrix: &Joint<T, N>,
        levels: &[T; N],
        slopes: &[T; SLOPES],
    ) -> (Joint<T, N>, [T; N]) {
        let mut of_slopes = Slopes::none();
        of_slopes.eliminate(matrix);
        let mut left = [[T::zero(); N]; N];
        of_slopes.leave(matrix, &mut left);
        (Joint::of_levels(left), of_slopes.left_vector(*levels, &of_slopes.forward(*slopes)))
    }

    #[inline]
    fn factor_levels(&mut self, prior: impl Fn(usize, usize) -> Option<T>, column_noise: T) {
        let with_prior = |left: T, i: usize, j: usize| prior(i, j).map_or(left, |prior| left + prior);
        // A pivot is kept above the rounding error of its diagonal, which only matters in f32.
        let floor = T::lit(8.0) * T::epsilon();
        for back in 0..N {
            let i = N - 1 - back;
            for j in (i + 1..N).rev() {
                let mut sum = with_prior(self.upper[j][i], j, i);
                for k in j + 1..N {
                    sum -= self.upper[i][k] * self.upper[j][k];
                }
                self.upper[i][j] = sum;
            }
            let diagonal = with_prior(self.upper[i][i], i, i);
            let mut pivot = diagonal;
            for j in i + 1..N {
                // U D stands here; turn it to U as it is used.
                let u = self.upper[i][j] * self.inverse_pivot[j];
                pivot -= u * self.upper[i][j];
                self.upper[i][j] = u;
            }
            if i == 0 {
                self.taken = column_noise.at_most(pivot - T::one()).at_least(T::zero());
                pivot -= self.taken;
            }
            self.pivots[i] = pivot.at_least(floor * diagonal);
            self.inverse_pivot[i] = T::one() / self.pivots[i];
        }
    }

    /// Turns `levels` into the levels of A θ = (`levels`, `slopes`), where the entry of level 0 lacks `mean_0` times what was taken; and
    /// `slopes` into what [`slopes`](Self::slopes) needs.
    #[inline]
    pub fn solve(&self, levels: &mut [T; N], slopes: &mut [T; SLOPES], mean_0: T) {
        if self.slopes.any {
            *slopes = self.slopes.forward(*slopes);
            *levels = self.slopes.left_vector(*levels, slopes);
        }
        levels[0] += self.taken * mean_0;
        self.substitute_upper(levels);
        for i in 0..N {
            let mut sum = levels[i] * self.inverse_pivot[i];
            for k in 0..i {
                sum -= self.upper[k][i] * levels[k];
            }
            levels[i] = sum;
        }
    }

    /// The slopes that go with the levels of [`solve`](Self::solve).
    pub fn slopes(&self, half: &[T; SLOPES], levels: &[T; N]) -> [T; SLOPES] {
        if self.slopes.any { self.slopes.back(half, levels) } else { [T::zero(); SLOPES] }
    }

    /// The quadratic form (a, b)ᵀ A⁻¹ (a, b): variance of aᵀ levels + bᵀ slopes.
    pub fn variance(&self, a: &[T; N], b: &[T; SLOPES]) -> T {
        let (mut z, mut variance) = (*a, T::zero());
        if self.slopes.any {
            let half = self.slopes.forward(*b);
            for i in 0..SLOPES {
                variance += half[i] * self.slopes.inverse_pivot[i] * half[i];
            }
            z = self.slopes.left_vector(z, &half);
        }
        self.substitute_upper(&mut z);
        let mut of_levels = T::zero();
        for i in 0..N {
            of_levels += z[i] * z[i] * self.inverse_pivot[i];
        }
        variance + of_levels
    }

    /// Variance of level 0: its pivot comes last.
    pub fn variance_0(&self) -> T {
        self.inverse_pivot[0]
    }

    /// D.
    #[inline]
    pub fn pivots(&self) -> Pivots<T, N> {
        Pivots { levels: self.pivots, slopes: self.slopes.pivots }
    }

    /// det A over that of a matrix with the pivots `other`; one by one, as their product may be beyond f32.
    #[inline]
    pub fn determinant_over(&self, other: &Pivots<T, N>) -> T {
        let ratio = |own: &[T], other: &[T]| {
            own.iter().zip(other).fold(T::one(), |product, (own, other)| product * (*own / *other))
        };
        ratio(&self.pivots, &other.levels) * ratio(&self.slopes.pivots, &other.slopes)
    }

    /// z of U z = x.
    #[inline]
    fn substitute_upper(&self, x: &mut [T; N]) {
        for back in 0..N {
            let i = N - 1 - back;
            for k in i + 1..N {
                let known = x[k];
                x[i] -= self.upper[i][k] * known;
            }
        }
    }

    /// Covariance of the levels, V D⁻¹ V with V = U⁻¹ transposed on the left; lower triangle.
    #[inline]
    pub fn covariance(&self) -> [[T; N]; N] {
        let mut w = [[T::zero(); N]; N];
        for j in 0..N {
            w[j][j] = T::one();
            for i in (0..j).rev() {
                let mut sum = self.upper[i][j];
                for k in i + 1..j {
                    sum += self.upper[i][k] * w[k][j];
                }
                w[i][j] = -sum;
            }
        }
        let mut inverse = [[T::zero(); N]; N];
        for i in 0..N {
            let weighed = self.inverse_pivot[0] * w[0][i];
            for j in 0..i + 1 {
                inverse[i][j] = weighed * w[0][j];
            }
        }
        for k in 1..N {
            for i in k..N {
                let weighed = self.inverse_pivot[k] * w[k][i];
                for j in k..i + 1 {
                    inverse[i][j] += weighed * w[k][j];
                }
            }
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};
    use proptest::prelude::*;

    const SIZE: usize = 4 + SLOPES;

    fn dense(joint: &Joint<f64, 4>) -> SMatrix<f64, SIZE, SIZE> {
        SMatrix::from_fn(|i, j| {
            let entry = match (i.max(j), i.min(j)) {
                (i, j) if i < 4 => joint.level(i, j),
                (i, j) if j < 4 => joint.cross[i - 4][j],
                (i, j) => joint.slope(i - 4, j - 4),
            };
            entry + if i == j { 1.0 } else { 0.0 }
        })
    }

    /// Σ f fᵀ of rows of seven numbers.
    fn joint(rows: &[[f64; SIZE]]) -> Joint<f64, 4> {
        let mut joint = Joint::zero();
        for f in rows {
            for i in 0..4 {
                for j in 0..=i {
                    *joint.level_mut(i, j) += f[i] * f[j];
                }
            }
            for i in 0..SLOPES {
                for j in 0..4 {
                    joint.cross[i][j] += f[4 + i] * f[j];
                }
                for j in 0..=i {
                    *joint.slope_mut(i, j) += f[4 + i] * f[4 + j];
                }
            }
        }
        joint
    }

    fn unit(i: usize, j: usize) -> Option<f64> {
        (i == j).then_some(1.0)
    }

    proptest! {
        /// All that is asked of the factors is what dense algebra says.
        #[test]
        fn factors_are_those_of_the_whole_matrix(
            rows in prop::collection::vec(prop::array::uniform7(-2.0..2.0), 1..12), v in prop::array::uniform7(-1.0..1.0),
        ) {
            let joint = joint(&rows);
            let mut factors = Factors::room();
            factors.factor(&joint, true, unit, 0.0);
            let matrix = dense(&joint);
            let inverse = matrix.try_inverse().unwrap();
            let (a, b) = ([v[0], v[1], v[2], v[3]], [v[4], v[5], v[6]]);
            let vector = SVector::<f64, SIZE>::from(v);
            let expected = inverse * vector;
            let (mut levels, mut half) = (a, b);
            factors.solve(&mut levels, &mut half, 0.0);
            let slopes = factors.slopes(&half, &levels);
            for (found, expected) in levels.iter().chain(&slopes).zip(expected.iter()) {
                prop_assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
            let variance = vector.dot(&expected);
            prop_assert!((factors.variance(&a, &b) - variance).abs() < 1e-9, "{variance}");
            let covariance = factors.covariance();
            for i in 0..4 {
                for j in 0..=i {
                    prop_assert!((covariance[i][j] - inverse[(i, j)]).abs() < 1e-9);
                }
            }
            prop_assert!((factors.variance_0() - inverse[(0, 0)]).abs() < 1e-9);
            prop_assert!((factors.determinant_over(&Factors::room().pivots()) / matrix.determinant() - 1.0).abs() < 1e-9);
        }
    }

    /// Without slopes the levels are those of a matrix without them.
    #[test]
    fn no_slopes_are_slopes_that_nothing_tells_of() {
        let rows = [[0.3, -1.2, 2.0, 0.7, 0.0, 0.0, 0.0], [1.0, 0.4, -0.6, 1.5, 0.0, 0.0, 0.0]];
        let joint = joint(&rows);
        let [with, without] = [true, false].map(|slopes| {
            let mut factors = Factors::room();
            factors.factor(&joint, slopes, unit, 0.2);
            factors
        });
        let vector = [1.0, -2.0, 0.5, 3.0];
        let same = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-12;
        let solved = [with, without].map(|factors| {
            let mut levels = vector;
            factors.solve(&mut levels, &mut [0.0; 3], 0.9);
            levels
        });
        assert!(solved[0].iter().zip(solved[1]).all(|(with, without)| same(*with, without)));
        assert!(same(with.variance(&vector, &[0.0; 3]), without.variance(&vector, &[0.0; 3])));
        assert!(same(with.determinant_over(&without.pivots()), 1.0));
    }
}
