// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::Innovation;
use super::prior::{LEAKS, Parameter, leak_column};
use crate::Real;
use crate::continuity::Equation;
use crate::linalg::{Factors, Joint, Pivots};

/// Normal equations of the N parameters as they are now, their levels, and of the leaks' slopes, with a unit prior; and what
/// noise in column 0 does to them.
///
/// Levels are counted in units of their prior standard deviation from their prior mean, so that the
/// prior is the identity. The prior is never forgotten: when excitation stops, the covariance grows back
/// to the prior and no further (no blow-up).
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct Information<T, const N: usize> {
    /// Σ w f fᵀ.
    pub matrix: Joint<T, N>,
    /// Σ w f y of the levels …
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub levels: [T; N],
    /// … and of the slopes.
    pub slopes: [T; LEAKS],
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

/// What is known of the levels, prior units.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
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
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn of(mean: [T; N], mut covariance: [[T; N]; N]) -> Self {
        for i in 0..N {
            covariance[i][i] = covariance[i][i].at_least(T::min_positive_value());
            for j in 0..i {
                covariance[j][i] = covariance[i][j];
            }
        }
        Self { mean, covariance }
    }

    /// What is known before any sample: of parameters that have nothing to do with each other, but for the two offsets.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn of_prior(&[[aa, ab], [ba, bb]]: &[[T; 2]; 2]) -> Self {
        const A: usize = Parameter::OffsetA as usize;
        const B: usize = Parameter::OffsetB as usize;
        let mut known = Self::zero();
        for i in 0..N {
            known.covariance[i][i] = T::one();
        }
        if N > B {
            let over = T::one() / (aa * bb - ab * ba);
            (known.covariance[A][A], known.covariance[B][B]) = (bb * over, aa * over);
            (known.covariance[A][B], known.covariance[B][A]) = (-ab * over, -ba * over);
        }
        known
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
        Self {
            matrix: Joint::zero(),
            levels: [T::zero(); N],
            slopes: [T::zero(); LEAKS],
            column_noise: T::zero(),
        }
    }

    /// Knows of independent levels this mean and each its own information, prior included, where it knew nothing.
    pub fn set(&mut self, mean: &[T; N], known: &[T; N], prior: &Prior<'_, T>) {
        for i in 0..N {
            for j in 0..=i {
                if let Some(prior) = prior_entry(prior.offsets, i, j) {
                    *self.matrix.level_mut(i, j) -= prior;
                }
            }
            *self.matrix.level_mut(i, i) += known[i];
            self.levels[i] = known[i] * mean[i];
        }
    }

    /// Adds what a block tells, in which slopes are counted per s; here one is `rate_ps`.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn add(&mut self, block: &Self, rate_ps: T) {
        for i in 0..N {
            for j in 0..=i {
                *self.matrix.level_mut(i, j) += block.matrix.level(i, j);
            }
            self.levels[i] += block.levels[i];
        }
        self.column_noise += block.column_noise;
        if rate_ps <= T::zero() {
            return;
        }
        for i in 0..LEAKS {
            for j in 0..N {
                self.matrix.cross[i][j] += rate_ps * block.matrix.cross[i][j];
            }
            for j in 0..=i {
                *self.matrix.slope_mut(i, j) += rate_ps * rate_ps * block.matrix.slope(i, j);
            }
            self.slopes[i] += rate_ps * block.slopes[i];
        }
    }

    /// Adds a row f of unit variance that is `age_s` old: with slopes s per s it reads fᵀ(θ − age ∘ s), so that of levels and slopes
    /// together it is the row (f, −age ∘ f).
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each row
    pub fn add_row(&mut self, f: &[T; N], y: T, age_s: T) {
        for i in 0..N {
            for j in 0..=i {
                *self.matrix.level_mut(i, j) += f[i] * f[j];
            }
            self.levels[i] += f[i] * y;
        }
        for i in 0..LEAKS {
            let aged = age_s * f[leak_column(i)];
            for j in 0..N {
                self.matrix.cross[i][j] -= aged * f[j];
            }
            for j in 0..=i {
                *self.matrix.slope_mut(i, j) += aged * age_s * f[leak_column(j)];
            }
            self.slopes[i] -= aged * y;
        }
    }

    /// The levels with the slopes eliminated (Schur complement).
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn without_slopes(&self) -> Self {
        let (matrix, levels) = Factors::without_slopes(&self.matrix, &self.levels, &self.slopes);
        Self { matrix, levels, slopes: [T::zero(); LEAKS], column_noise: self.column_noise }
    }

    /// From now on a slope of one is what `unit` was, in units of before.
    pub fn count_slopes_in(&mut self, unit: T) {
        for i in 0..LEAKS {
            for j in 0..=i {
                *self.matrix.slope_mut(i, j) *= unit * unit;
            }
            for j in 0..N {
                self.matrix.cross[i][j] *= unit;
            }
            self.slopes[i] *= unit;
        }
    }

    /// Weighs all that is known by `keep` (0 to 1), and moves the levels on by `moved` times their slopes.
    pub fn advance(&mut self, keep: T, moved: T) {
        for i in 0..N {
            for j in 0..=i {
                *self.matrix.level_mut(i, j) *= keep;
            }
            self.levels[i] *= keep;
        }
        self.column_noise *= keep;
        if moved <= T::zero() {
            return;
        }
        for i in 0..LEAKS {
            let own = leak_column(i);
            for j in 0..=i {
                let other = leak_column(j);
                let through = self.matrix.cross[i][other] + self.matrix.cross[j][own];
                let slopes = self.matrix.slope(i, j) - moved * through;
                *self.matrix.slope_mut(i, j) = keep * slopes + moved * moved * self.matrix.levels(own, other);
            }
            self.slopes[i] = keep * self.slopes[i] - moved * self.levels[own];
        }
        for i in 0..LEAKS {
            for j in 0..N {
                let through = moved * self.matrix.levels(leak_column(i), j);
                self.matrix.cross[i][j] = keep * self.matrix.cross[i][j] - through;
            }
        }
    }

    /// Level `own`, which has no slope, has moved by something of this variance: M − M e (1/q + eᵀM e)⁻¹ eᵀM, by the matrix
    /// inversion lemma.
    pub fn diffuse(&mut self, own: usize, variance: T) {
        // Known to every caller, but not to a compiler that keeps this apart.
        if own >= N {
            return;
        }
        let mut column = [T::zero(); N];
        for i in 0..N {
            column[i] = self.matrix.levels(own, i);
        }
        let share = variance / (T::one() + variance * column[own]);
        let told = share * self.levels[own];
        let through = self.matrix.cross.map(|row| share * row[own]);
        for i in 0..LEAKS {
            for j in 0..=i {
                let moved = through[i] * self.matrix.cross[j][own];
                *self.matrix.slope_mut(i, j) -= moved;
            }
            self.slopes[i] -= told * self.matrix.cross[i][own];
        }
        for i in 0..LEAKS {
            for j in 0..N {
                self.matrix.cross[i][j] -= through[i] * column[j];
            }
        }
        for i in 0..N {
            for j in 0..=i {
                *self.matrix.level_mut(i, j) -= share * column[i] * column[j];
            }
            self.levels[i] -= told * column[i];
        }
    }

    /// Takes from the vectors `of_levels` and `of_slopes` what levels and slopes of this size explain, M (levels, slopes).
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn take_explained(
        &self,
        of_levels: &mut [T; N],
        of_slopes: &mut [T; LEAKS],
        levels: &[T; N],
        slopes: &[T; LEAKS],
    ) {
        of_levels[0] += self.column_noise * levels[0];
        for i in 0..N {
            for j in 0..i {
                let entry = self.matrix.level(i, j);
                of_levels[i] -= entry * levels[j];
                of_levels[j] -= entry * levels[i];
            }
            of_levels[i] -= self.matrix.level(i, i) * levels[i];
        }
        for i in 0..LEAKS {
            for j in 0..N {
                of_levels[j] -= self.matrix.cross[i][j] * slopes[i];
                of_slopes[i] -= self.matrix.cross[i][j] * levels[j];
            }
            for j in 0..=i {
                let entry = self.matrix.slope(i, j);
                of_slopes[i] -= entry * slopes[j];
                if j < i {
                    of_slopes[j] -= entry * slopes[i];
                }
            }
        }
    }

    /// Posterior mean, and what its covariance follows from. A slope of one is `rate_ps` prior units per s; where that is zero there are
    /// none. Noise in column 0 (errors in variables) is taken out of matrix and vector. In place: it is too large to be moved about.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn solve(&self, prior: &Prior<'_, T>, rate_ps: T, posterior: &mut Posterior<T, N>) {
        let Posterior { mean, half, rate_ps: rate, factors } = posterior;
        (*mean, *half, *rate) = (self.levels, self.slopes, rate_ps);
        let entry = |i: usize, j: usize| prior_entry(prior.offsets, i, j);
        factors.factor(&self.matrix, rate_ps > T::zero(), entry, self.column_noise);
        factors.solve(mean, half, prior.mean_0);
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

/// Posterior mean of levels and slopes in prior units, and the factors of their information.
#[derive(Clone, Copy)]
pub(super) struct Posterior<T, const N: usize> {
    /// Of the levels.
    pub mean: [T; N],
    /// From which the slopes follow.
    half: [T; LEAKS],
    rate_ps: T,
    factors: Factors<T, N>,
}

impl<T: Real, const N: usize> Posterior<T, N> {
    /// Room for one.
    #[inline(always)]
    pub fn room() -> Self {
        Self { mean: [T::one(); N], half: [T::one(); LEAKS], rate_ps: T::one(), factors: Factors::room() }
    }

    /// Pivots of its information.
    #[inline]
    pub fn pivots(&self) -> Pivots<T, N> {
        self.factors.pivots()
    }

    /// Variance of level 0.
    pub fn variance_0(&self) -> T {
        self.factors.variance_0()
    }

    /// Variance of aᵀ levels + bᵀ slopes, the slopes in prior units per s.
    pub fn variance(&self, a: &[T; N], b: &[T; LEAKS]) -> T {
        self.factors.variance(a, &b.map(|b| self.rate_ps * b))
    }

    /// Mean of each slope, prior units per s.
    pub fn slopes_ps(&self) -> [T; LEAKS] {
        self.factors.slopes(&self.half, &self.mean).map(|slope| self.rate_ps * slope)
    }

    /// Mean and variance of each slope, prior units per s.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn slopes(&self) -> [(T, T); LEAKS] {
        let mean_ps = self.slopes_ps();
        let mut slopes = [(T::zero(), T::zero()); LEAKS];
        for i in 0..LEAKS {
            let mut one = [T::zero(); LEAKS];
            one[i] = T::one();
            slopes[i] = (mean_ps[i], self.variance(&[T::zero(); N], &one));
        }
        slopes
    }

    /// ln of how much larger the determinant of the information is than it was with the pivots `before`.
    pub fn growth_since(&self, before: &Pivots<T, N>) -> T {
        self.factors.determinant_over(before).at_most(T::max_value()).libm_ln()
    }

    /// Covariance of the levels, lower triangle.
    #[inline]
    pub fn covariance(&self) -> [[T; N]; N] {
        self.factors.covariance()
    }

    /// What is known of the levels.
    #[cfg_attr(target_os = "none", inline(never))] // its stack is none of what follows
    pub fn solution(&self) -> Solution<T, N> {
        Solution::of(self.mean, self.covariance())
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::{Balance, Block, BlockSums};
    use super::*;

    impl<T: Real, const N: usize> Information<T, N> {
        pub fn solved(&self, prior: &Prior<'_, T>, rate_ps: T) -> Posterior<T, N> {
            let mut posterior = Posterior::room();
            self.solve(prior, rate_ps, &mut posterior);
            posterior
        }
    }

    const OFFSETS: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
    const PRIOR: Prior<'static, f64> = Prior { mean_0: 0.0, offsets: &OFFSETS };

    fn block<const N: usize>(
        rows: impl Iterator<Item = ([f64; N], f64)>,
        weight: f64,
    ) -> Information<f64, N> {
        let mut sums = BlockSums::new();
        rows.for_each(|(f, y)| sums.add(&f, &[0.0; 3], y, weight));
        Block::new(1.0, &sums, &[None; 2], 0.0).information
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
        information.add(&block(rows, 1e6), 0.0);
        let expected = (0..200).fold(nalgebra::Matrix4::<f64>::identity(), |sum, k| {
            let v = nalgebra::Vector4::from(row(k));
            sum + v * v.transpose() * 1e6
        });
        let inverse = expected.try_inverse().unwrap();
        let posterior = information.solved(&PRIOR, 0.0);
        let (solution, a) = (posterior.solution(), [0.3, -1.0, 2.0, 0.5]);
        let dense = (inverse * nalgebra::Vector4::from(a)).dot(&nalgebra::Vector4::from(a));
        assert!((posterior.variance(&a, &[0.0; 3]) / dense - 1.0).abs() < 1e-9);
        assert!((posterior.variance_0() / inverse[(0, 0)] - 1.0).abs() < 1e-9);
        for i in 0..4 {
            assert!((solution.mean[i] - truth[i]).abs() < 1e-5);
            for j in 0..4 {
                assert!((solution.covariance[i][j] - inverse[(i, j)]).abs() < 1e-9 * inverse[(i, i)].abs());
            }
        }
        let before = Information::<f64, 4>::new().solved(&PRIOR, 0.0);
        assert!((posterior.growth_since(&before.pivots()) - expected.determinant().ln()).abs() < 1e-9);
    }

    /// Offsets that have to do with each other, as through a leak.
    #[test]
    fn without_a_sample_the_prior_is_known() {
        let prior = Prior { mean_0: 0.0, offsets: &[[2.0, -0.7], [-0.7, 1.5]] };
        let (known, solved) =
            (Solution::<f64, 6>::of_prior(prior.offsets), Information::new().solved(&prior, 0.0).solution());
        let [known, solved] =
            [known, solved].map(|told| told.mean.into_iter().chain(told.covariance.into_iter().flatten()));
        for (known, solved) in known.zip(solved) {
            assert!((known - solved).abs() < 1e-12, "{known} {solved}");
        }
    }

    #[test]
    fn a_balance_counts_as_one_more_row() {
        let rows = [([1.0, 2.0, 0.5, -1.0], 3.0), ([0.3, -1.0, 0.1, 2.0], -1.0)];
        let (mut together, mut apart) = (Information::new(), Information::new());
        together.add(&block(rows.into_iter(), 1.0), 0.0);
        let mut sums = BlockSums::new();
        sums.add(&rows[0].0, &[0.0; 3], rows[0].1, 1.0);
        let equation = Equation { left: rows[1].1, columns: rows[1].0 };
        apart.add(
            &Block::new(1.0, &sums, &[None, Some(Balance { equation, age_s: 0.0 })], 0.0).information,
            0.0,
        );
        assert_eq!((together.matrix.lower(), together.levels), (apart.matrix.lower(), apart.levels));
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
            information
                .add(&Block::new(1.0, &sums, &[None; 2], 100.0 * count * NOISE * NOISE).information, 0.0);
        }
        let prior = Prior { mean_0, ..PRIOR };
        let found = information.solved(&prior, 0.0).solution().mean;
        assert!(found.iter().zip(truth).all(|(found, truth)| (found - truth).abs() < 1e-3), "{found:?}");
    }

    #[test]
    fn forgetting_everything_returns_to_the_prior() {
        let mut information = Information::new();
        information.add(&block([([1.0, 2.0, 3.0, 4.0], 3.0)].into_iter(), 1e4), 0.0);
        for _ in 0..200 {
            information.advance(0.5, 0.0);
        }
        let solution = information.solved(&PRIOR, 0.0).solution();
        assert!((solution.covariance[0][0] - 1.0).abs() < 1e-9);
        assert!(solution.mean[1].abs() < 1e-9);
    }
}
