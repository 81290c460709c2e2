// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::Parameter;
use crate::Real;

/// Weighted normal equations of a linear regression with exponential forgetting and a unit prior.
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
    /// Σ w f fᵀ, lower triangle.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    matrix: [[T; N]; N],
    /// Σ w² f fᵀ, lower triangle: what the weighted sum's own noise amounts to.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    noise: [[T; N]; N],
    /// Σ w f y.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    vector: [T; N],
    /// What sensor noise in column 0 adds to the normal equation of that column on average.
    column_noise: T,
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

/// Sums over one block: what is forgotten as one.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct BlockSums<T, const N: usize> {
    /// Σ f fᵀ/S, lower triangle.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    pub matrix: [[T; N]; N],
    /// Σ f y/S.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub vector: [T; N],
    /// Σ (variance of sensor noise in column 0)/S.
    pub column_noise: T,
    /// Σ y²/S.
    pub square: T,
    /// Number of terms.
    pub count: T,
}

impl<T: Real, const N: usize> BlockSums<T, N> {
    pub fn new() -> Self {
        Self {
            matrix: [[T::zero(); N]; N],
            vector: [T::zero(); N],
            column_noise: T::zero(),
            square: T::zero(),
            count: T::zero(),
        }
    }

    /// Adds one observation y = fᵀθ + noise of variance 1/`weight`.
    #[inline]
    pub fn add(&mut self, f: &[T; N], y: T, weight: T) {
        for i in 0..N {
            let wf = weight * f[i];
            for j in 0..=i {
                self.matrix[i][j] += wf * f[j];
            }
            self.vector[i] += wf * y;
        }
        self.square += weight * y * y;
        self.count += T::one();
    }

    /// Σ (y − fᵀθ)²/S at `theta`.
    pub fn chi_square(&self, theta: &[T; N]) -> T {
        let mut chi = self.square;
        for i in 0..N {
            chi -= T::lit(2.0) * theta[i] * self.vector[i];
            for j in 0..=i {
                let twice = if i == j { T::one() } else { T::lit(2.0) };
                chi += twice * theta[i] * theta[j] * self.matrix[i][j];
            }
        }
        chi.max(T::zero())
    }
}

impl<T: Real, const N: usize> Solution<T, N> {
    /// Innovation y − fᵀθ̂ of an observation with unit noise, and its variance 1 + fᵀP f.
    pub fn predict(&self, y: T, f: &[T; N]) -> (T, T) {
        let mut innovation = y;
        let mut variance = T::one();
        for i in 0..N {
            innovation -= f[i] * self.mean[i];
            for j in 0..N {
                variance += f[i] * self.covariance[i][j] * f[j];
            }
        }
        (innovation, variance)
    }
}

impl<T: Real, const N: usize> Information<T, N> {
    pub fn new() -> Self {
        Self {
            matrix: [[T::zero(); N]; N],
            noise: [[T::zero(); N]; N],
            vector: [T::zero(); N],
            column_noise: T::zero(),
        }
    }

    /// Weighs all that is known by `keep` (0 to 1).
    pub fn forget(&mut self, keep: T) {
        let keep_noise = keep * keep;
        for i in 0..N {
            for j in 0..=i {
                self.matrix[i][j] *= keep;
                self.noise[i][j] *= keep_noise;
            }
            self.vector[i] *= keep;
        }
        self.column_noise *= keep;
    }

    pub fn add(&mut self, block: &BlockSums<T, N>) {
        for i in 0..N {
            for j in 0..=i {
                self.matrix[i][j] += block.matrix[i][j];
                self.noise[i][j] += block.matrix[i][j];
            }
            self.vector[i] += block.vector[i];
        }
        self.column_noise += block.column_noise;
    }

    /// Posterior mean and the covariance of its error, A⁻¹ (N + prior) A⁻¹ with A = M + prior: forgetting weighs
    /// the samples unequally, so A⁻¹ alone would overstate the spread (White 1980, sandwich form).
    ///
    /// Noise in column 0 (errors in variables) is taken out of A and of the vector; `mean_0` is the
    /// prior mean of that parameter in units of its prior standard deviation. `offsets` is the prior
    /// information of the two flow offsets; that of all other parameters is one.
    pub fn solve(&self, mean_0: T, offsets: &[[T; 2]; 2]) -> Solution<T, N> {
        let (factors, taken) = self.factor(offsets);
        let inverse = factors.inverse();
        let mut vector = self.vector;
        if let Some(first) = vector.first_mut() {
            *first += taken * mean_0;
        }
        let noise = self.noise_with_prior(offsets);
        let mut mean = [T::zero(); N];
        let mut half = [[T::zero(); N]; N];
        for i in 0..N {
            for k in 0..N {
                mean[i] += inverse[i][k] * vector[k];
                for j in 0..N {
                    half[i][j] += inverse[i][k] * noise[k][j];
                }
            }
        }
        let mut covariance = [[T::zero(); N]; N];
        for i in 0..N {
            for j in 0..N {
                for k in 0..N {
                    covariance[i][j] += half[i][k] * inverse[k][j];
                }
            }
            covariance[i][i] = covariance[i][i].max(T::min_positive_value());
        }
        Solution { mean, covariance }
    }

    #[inline]
    fn noise_with_prior(&self, offsets: &[[T; 2]; 2]) -> [[T; N]; N] {
        let mut whole = [[T::zero(); N]; N];
        for i in 0..N {
            for j in 0..=i {
                whole[i][j] = self.noise[i][j] + prior(offsets, i, j);
                whole[j][i] = whole[i][j];
            }
        }
        whole
    }

    /// U D Uᵀ of A = M + prior, last parameter first (Bierman 1977, Factorization Methods for Discrete
    /// Sequential Estimation, §III.4), so that the last pivot is what is known of parameter 0 beyond all
    /// others. The column noise is taken from it, but never more than leaves the prior standing. Also returns what was
    /// taken.
    fn factor(&self, offsets: &[[T; 2]; 2]) -> (Factors<T, N>, T) {
        // A pivot is kept above the rounding error of its diagonal, which only matters in f32.
        let floor = T::lit(8.0) * T::epsilon();
        let mut upper = [[T::zero(); N]; N];
        let mut inverse_pivot = [T::zero(); N];
        let mut taken = T::zero();
        for back in 0..N {
            let i = N - 1 - back;
            for j in (i + 1..N).rev() {
                let mut sum = self.matrix[j][i] + prior(offsets, j, i);
                for k in j + 1..N {
                    sum -= upper[i][k] * upper[j][k];
                }
                upper[i][j] = sum;
            }
            let diagonal = self.matrix[i][i] + prior(offsets, i, i);
            let mut pivot = diagonal;
            for j in i + 1..N {
                // upper[i][j] holds U D here; turn it to U as it is used.
                let u = upper[i][j] * inverse_pivot[j];
                pivot -= u * upper[i][j];
                upper[i][j] = u;
            }
            if i == 0 {
                taken = self.column_noise.min(pivot - T::one()).max(T::zero());
                pivot -= taken;
            }
            inverse_pivot[i] = T::one() / pivot.max(floor * diagonal);
        }
        (Factors { upper, inverse_pivot }, taken)
    }
}

/// Entry of the prior information, `i` >= `j`.
#[inline]
fn prior<T: Real>(offsets: &[[T; 2]; 2], i: usize, j: usize) -> T {
    const A: usize = Parameter::OffsetA as usize;
    const B: usize = Parameter::OffsetB as usize;
    match (i, j) {
        (A, A) => offsets[0][0],
        (B, B) => offsets[1][1],
        (B, A) => offsets[1][0],
        _ if i == j => T::one(),
        _ => T::zero(),
    }
}

/// Unit upper U (above the diagonal) and 1/D.
struct Factors<T, const N: usize> {
    upper: [[T; N]; N],
    inverse_pivot: [T; N],
}

impl<T: Real, const N: usize> Factors<T, N> {
    /// (U D Uᵀ)⁻¹, column by column: U z = e, then Uᵀ x = D⁻¹ z.
    fn inverse(&self) -> [[T; N]; N] {
        let mut inverse = [[T::zero(); N]; N];
        for column in 0..N {
            let mut x = [T::zero(); N];
            for back in 0..N {
                let i = N - 1 - back;
                let mut sum = if i == column { T::one() } else { T::zero() };
                for k in i + 1..N {
                    sum -= self.upper[i][k] * x[k];
                }
                x[i] = sum;
            }
            for i in 0..N {
                let mut sum = x[i] * self.inverse_pivot[i];
                for k in 0..i {
                    sum -= self.upper[k][i] * x[k];
                }
                x[i] = sum;
            }
            for i in 0..N {
                inverse[i][column] = x[i];
            }
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_a_linear_law_and_its_covariance() {
        let mut sums = BlockSums::<f64, 3>::new();
        let truth = [0.3, -1.2, 2.0];
        let mut expected = nalgebra::Matrix3::<f64>::identity();
        for k in 0..200 {
            let t = k as f64 * 0.1;
            let f = [t.sin(), (0.7 * t).cos(), 1.0 + 0.1 * t];
            let y = f.iter().zip(truth).map(|(a, b)| a * b).sum();
            sums.add(&f, y, 1e6);
            let v = nalgebra::Vector3::from(f);
            expected += v * v.transpose() * 1e6;
        }
        let mut information = Information::new();
        information.add(&sums);
        let solution = information.solve(0.0, &[[1.0, 0.0], [0.0, 1.0]]);
        let inverse = expected.try_inverse().unwrap();
        for i in 0..3 {
            assert!((solution.mean[i] - truth[i]).abs() < 1e-5);
            for j in 0..3 {
                assert!((solution.covariance[i][j] - inverse[(i, j)]).abs() < 1e-9 * inverse[(i, i)].abs());
            }
        }
        assert!(sums.chi_square(&solution.mean) < 1e-3);
    }

    #[test]
    fn forgetting_everything_returns_to_the_prior() {
        let mut sums = BlockSums::<f64, 2>::new();
        sums.add(&[1.0, 2.0], 3.0, 1e4);
        let mut information = Information::new();
        information.add(&sums);
        for _ in 0..200 {
            information.forget(0.5);
        }
        let solution = information.solve(0.0, &[[1.0, 0.0], [0.0, 1.0]]);
        assert!((solution.covariance[0][0] - 1.0).abs() < 1e-9);
        assert!(solution.mean[1].abs() < 1e-9);
    }
}
