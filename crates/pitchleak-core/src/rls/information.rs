// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::Parameter;
use super::block::{Block, symmetric};
use super::update::Innovation;
use crate::Real;
use crate::continuity::Equation;

/// Normal equations of a linear regression with a unit prior, and what noise in column 0 does to them.
///
/// Parameters are counted in units of their prior standard deviation from their prior mean, so that the
/// prior is the identity. The prior is never forgotten: when excitation stops, the covariance grows back
/// to the prior and no further (no blow-up).
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Information<T, const N: usize> {
    /// Σ w f fᵀ, lower triangle; a [`Trend`](super::trend::Trend) keeps its slopes' above the diagonal.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    pub matrix: [[T; N]; N],
    /// Σ w f y.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub vector: [T; N],
    /// What sensor noise in column 0 adds to the normal equation of that column on average.
    pub column_noise: T,
}

/// What is known before any sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior<'a, T> {
    /// Mean of parameter 0 in units of its standard deviation.
    pub mean_0: T,
    /// Information of the two flow offsets; that of all other parameters is one.
    pub offsets: &'a [[T; 2]; 2],
}

/// Solution of [`Information`] in prior units.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Solution<T, const N: usize> {
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub mean: [T; N],
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    pub covariance: [[T; N]; N],
}

impl<T: Real, const N: usize> Solution<T, N> {
    pub fn zero() -> Self {
        Self { mean: [T::zero(); N], covariance: [[T::zero(); N]; N] }
    }

    /// Of a covariance's lower triangle.
    #[inline]
    pub fn of(mean: [T; N], mut covariance: [[T; N]; N]) -> Self {
        for i in 0..N {
            covariance[i][i] = covariance[i][i].at_least(T::min_positive_value());
            for j in 0..i {
                covariance[j][i] = covariance[i][j];
            }
        }
        Self { mean, covariance }
    }

    /// What is known before any sample.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn of_prior(offsets: &[[T; 2]; 2]) -> Self {
        Information::new().solve(&Prior { mean_0: T::zero(), offsets }).solution()
    }

    /// Variance of aᵀθ.
    fn variance(&self, a: &[T; N]) -> T {
        let mut variance = T::zero();
        for i in 0..N {
            let mut sum = T::zero();
            for j in 0..N {
                sum += self.covariance[i][j] * a[j];
            }
            variance += a[i] * sum;
        }
        variance
    }

    /// Innovation y − fᵀθ̂ of an equation with unit noise, and its variance 1 + fᵀP f.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn predict(&self, equation: &Equation<T, N>) -> Innovation<T> {
        Innovation {
            value: equation.residual(&self.mean),
            variance: T::one() + self.variance(&equation.columns),
        }
    }
}

impl<T: Real, const N: usize> Information<T, N> {
    pub fn new() -> Self {
        Self { matrix: [[T::zero(); N]; N], vector: [T::zero(); N], column_noise: T::zero() }
    }

    /// Independent parameters of this mean and each its own information, prior included.
    pub fn of(mean: &[T; N], known: &[T; N], prior: &Prior<'_, T>) -> Self {
        let mut information = Self::new();
        for i in 0..N {
            for j in 0..=i {
                if let Some(prior) = prior_entry(prior.offsets, i, j) {
                    information.matrix[i][j] -= prior;
                }
            }
            information.matrix[i][i] += known[i];
            information.vector[i] = known[i] * mean[i];
        }
        information
    }

    /// Weighs all that is known by `keep` (0 to 1).
    pub fn forget(&mut self, keep: T) {
        for i in 0..N {
            for j in 0..=i {
                self.matrix[i][j] *= keep;
            }
            self.vector[i] *= keep;
        }
        self.column_noise *= keep;
    }

    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn add(&mut self, block: &Block<T, N>) {
        for i in 0..N {
            for j in 0..=i {
                self.matrix[i][j] += block.matrix[i][j];
            }
            self.vector[i] += block.vector[i];
        }
        self.column_noise += block.column_noise;
    }

    /// Parameter `own` has moved by something of this variance: M − M e (1/q + eᵀM e)⁻¹ eᵀM, by the matrix inversion lemma.
    pub fn diffuse(&mut self, own: usize, variance: T) {
        // Known to every caller, but not to a compiler that keeps this apart.
        if own >= N {
            return;
        }
        let mut column = [T::zero(); N];
        for i in 0..N {
            column[i] = self.entry(own, i);
        }
        let share = variance / (T::one() + variance * column[own]);
        let told = share * self.vector[own];
        for i in 0..N {
            for j in 0..=i {
                self.matrix[i][j] -= share * column[i] * column[j];
            }
            self.vector[i] -= told * column[i];
        }
    }

    /// Entry of the symmetric matrix.
    #[inline]
    pub fn entry(&self, i: usize, j: usize) -> T {
        symmetric(&self.matrix, i, j)
    }

    /// Posterior mean, and what its covariance follows from: the factors of A = M + prior.
    ///
    /// Noise in column 0 (errors in variables) is taken out of A and of the vector.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn solve(&self, prior: &Prior<'_, T>) -> Posterior<T, N> {
        let factors = self.factor(prior.offsets);
        Posterior { mean: factors.solve(self.vector, prior.mean_0), factors }
    }

    /// Entry of A = M + prior, `i` >= `j`.
    #[inline]
    fn with_prior(&self, offsets: &[[T; 2]; 2], i: usize, j: usize) -> T {
        let entry = self.matrix[i][j];
        prior_entry(offsets, i, j).map_or(entry, |prior| entry + prior)
    }

    /// U D Uᵀ of A = M + prior, last parameter first (Bierman 1977, Factorization Methods for Discrete
    /// Sequential Estimation, §III.4), so that the last pivot is what is known of parameter 0 beyond all
    /// others. The column noise is taken from it, but never more than leaves the prior standing.
    fn factor(&self, offsets: &[[T; 2]; 2]) -> Factors<T, N> {
        // A pivot is kept above the rounding error of its diagonal, which only matters in f32.
        let floor = T::lit(8.0) * T::epsilon();
        let mut upper = [[T::zero(); N]; N];
        let mut pivots = [T::zero(); N];
        let mut inverse_pivot = [T::zero(); N];
        let mut taken = T::zero();
        for back in 0..N {
            let i = N - 1 - back;
            for j in (i + 1..N).rev() {
                let mut sum = self.with_prior(offsets, j, i);
                for k in j + 1..N {
                    sum -= upper[i][k] * upper[j][k];
                }
                upper[i][j] = sum;
            }
            let diagonal = self.with_prior(offsets, i, i);
            let mut pivot = diagonal;
            for j in i + 1..N {
                // upper[i][j] holds U D here; turn it to U as it is used.
                let u = upper[i][j] * inverse_pivot[j];
                pivot -= u * upper[i][j];
                upper[i][j] = u;
            }
            if i == 0 {
                taken = self.column_noise.at_most(pivot - T::one()).at_least(T::zero());
                pivot -= taken;
            }
            pivots[i] = pivot.at_least(floor * diagonal);
            inverse_pivot[i] = T::one() / pivots[i];
        }
        Factors { upper, pivots, inverse_pivot, taken }
    }
}

/// Entry of the prior information, `i` >= `j`; none is zero.
#[inline]
fn prior_entry<T: Real>(offsets: &[[T; 2]; 2], i: usize, j: usize) -> Option<T> {
    const A: usize = Parameter::OffsetA as usize;
    const B: usize = Parameter::OffsetB as usize;
    match (i, j) {
        (A, A) => Some(offsets[0][0]),
        (B, B) => Some(offsets[1][1]),
        (B, A) => Some(offsets[1][0]),
        _ if i == j => Some(T::one()),
        _ => None,
    }
}

/// Posterior mean θ̂ in prior units, and the factors of its information A.
#[derive(Clone, Copy)]
pub(super) struct Posterior<T, const N: usize> {
    pub mean: [T; N],
    factors: Factors<T, N>,
}

impl<T: Real, const N: usize> Posterior<T, N> {
    /// Pivots of A: their product is its determinant.
    pub fn pivots(&self) -> &[T; N] {
        &self.factors.pivots
    }

    /// Variance of parameter 0: its pivot comes last.
    pub fn variance_0(&self) -> T {
        self.factors.inverse_pivot[0]
    }

    /// Variance aᵀ A⁻¹ a of aᵀθ.
    pub fn variance(&self, a: &[T; N]) -> T {
        let mut z = *a;
        self.factors.substitute_upper(&mut z);
        let mut variance = T::zero();
        for i in 0..N {
            variance += z[i] * z[i] * self.factors.inverse_pivot[i];
        }
        variance
    }

    /// The covariance A⁻¹, lower triangle.
    #[inline]
    pub fn covariance(&self) -> [[T; N]; N] {
        self.factors.inverse()
    }

    /// The mean with the whole covariance A⁻¹.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn solution(&self) -> Solution<T, N> {
        Solution::of(self.mean, self.covariance())
    }
}

/// Unit upper U (above the diagonal), D and 1/D.
#[derive(Clone, Copy)]
struct Factors<T, const N: usize> {
    upper: [[T; N]; N],
    pivots: [T; N],
    inverse_pivot: [T; N],
    /// Column noise that was taken out.
    taken: T,
}

impl<T: Real, const N: usize> Factors<T, N> {
    /// x of A x = `vector`, whose first entry lacks what the column noise took: U z = v, then Uᵀ x = D⁻¹ z.
    fn solve(&self, vector: [T; N], mean_0: T) -> [T; N] {
        let mut x = vector;
        x[0] += self.taken * mean_0;
        self.substitute(&mut x);
        x
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

    #[inline]
    fn substitute(&self, x: &mut [T; N]) {
        self.substitute_upper(x);
        for i in 0..N {
            let mut sum = x[i] * self.inverse_pivot[i];
            for k in 0..i {
                sum -= self.upper[k][i] * x[k];
            }
            x[i] = sum;
        }
    }

    /// A⁻¹ = Wᵀ D⁻¹ W with W = U⁻¹, lower triangle.
    #[inline]
    fn inverse(&self) -> [[T; N]; N] {
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
    use super::super::block::{Balance, BlockSums};
    use super::*;

    const OFFSETS: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
    const PRIOR: Prior<'static, f64> = Prior { mean_0: 0.0, offsets: &OFFSETS };

    fn block<const N: usize>(rows: impl Iterator<Item = ([f64; N], f64)>, weight: f64) -> Block<f64, N> {
        let mut sums = BlockSums::new();
        rows.for_each(|(f, y)| sums.add(&f, &[0.0; 3], y, weight));
        Block::new(1.0, &sums, &[None; 2], 0.0)
    }

    #[test]
    fn recovers_a_linear_law_and_its_covariance() {
        let truth = [0.3, -1.2, 2.0, 0.7];
        let row = |k: u32| {
            let t = f64::from(k) * 0.1;
            [t.sin(), (0.7 * t).cos(), 1.0 + 0.1 * t, (1.3 * t).sin()]
        };
        let rows = (0..200).map(|k| (row(k), row(k).iter().zip(truth).map(|(a, b)| a * b).sum()));
        let mut information = Information::new();
        information.add(&block(rows, 1e6));
        let expected = (0..200).fold(nalgebra::Matrix4::<f64>::identity(), |sum, k| {
            let v = nalgebra::Vector4::from(row(k));
            sum + v * v.transpose() * 1e6
        });
        let inverse = expected.try_inverse().unwrap();
        let posterior = information.solve(&PRIOR);
        let (solution, a) = (posterior.solution(), [0.3, -1.0, 2.0, 0.5]);
        let dense = (inverse * nalgebra::Vector4::from(a)).dot(&nalgebra::Vector4::from(a));
        assert!((posterior.variance(&a) / dense - 1.0).abs() < 1e-9);
        assert!((posterior.variance_0() / inverse[(0, 0)] - 1.0).abs() < 1e-9);
        for i in 0..4 {
            assert!((solution.mean[i] - truth[i]).abs() < 1e-5);
            for j in 0..4 {
                assert!((solution.covariance[i][j] - inverse[(i, j)]).abs() < 1e-9 * inverse[(i, i)].abs());
            }
        }
        assert!((posterior.pivots().iter().product::<f64>() / expected.determinant() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_balance_counts_as_one_more_row() {
        let rows = [([1.0, 2.0, 0.5, -1.0], 3.0), ([0.3, -1.0, 0.1, 2.0], -1.0)];
        let (mut together, mut apart) = (Information::new(), Information::new());
        together.add(&block(rows.into_iter(), 1.0));
        let mut sums = BlockSums::new();
        sums.add(&rows[0].0, &[0.0; 3], rows[0].1, 1.0);
        let equation = Equation { left: rows[1].1, columns: rows[1].0 };
        apart.add(&Block::new(1.0, &sums, &[None, Some(Balance { equation, age_s: 0.0 })], 0.0));
        assert_eq!((together.matrix, together.vector), (apart.matrix, apart.vector));
    }

    /// Errors in variables: noise in column 0, known in its variance, takes nothing off the parameter, whose deviation from
    /// a mean is what rows tell. Without, a fifth of 1.5 would be missing.
    #[test]
    fn known_noise_in_column_0_biases_nothing() {
        const NOISE: f64 = 0.5;
        let (mean_0, truth) = (0.9, [0.6, -1.2, 2.0, 0.7]);
        let row = |k: u32| {
            let t = f64::from(k / 2) * 0.1;
            let f = [1.0, t.cos(), (0.7 * t).sin(), (1.3 * t).sin()];
            let y: f64 = mean_0 + f.iter().zip(truth).map(|(f, truth)| f * truth).sum::<f64>();
            let noisy = f[0] + if k.is_multiple_of(2) { NOISE } else { -NOISE };
            ([noisy, f[1], f[2], f[3]], y - noisy * mean_0)
        };
        let mut information = Information::new();
        for block_of in [0..1000, 1000..4000] {
            let count = f64::from(block_of.end - block_of.start);
            let mut sums = BlockSums::new();
            block_of.map(row).for_each(|(f, y)| sums.add(&f, &[0.0; 3], y, 100.0));
            information.add(&Block::new(1.0, &sums, &[None; 2], 100.0 * count * NOISE * NOISE));
        }
        let prior = Prior { mean_0, ..PRIOR };
        let found = information.solve(&prior).solution().mean;
        assert!(found.iter().zip(truth).all(|(found, truth)| (found - truth).abs() < 1e-3), "{found:?}");
    }

    #[test]
    fn forgetting_everything_returns_to_the_prior() {
        let mut information = Information::new();
        information.add(&block([([1.0, 2.0, 3.0, 4.0], 3.0)].into_iter(), 1e4));
        for _ in 0..200 {
            information.forget(0.5);
        }
        let solution = information.solve(&PRIOR).solution();
        assert!((solution.covariance[0][0] - 1.0).abs() < 1e-9);
        assert!(solution.mean[1].abs() < 1e-9);
    }
}
