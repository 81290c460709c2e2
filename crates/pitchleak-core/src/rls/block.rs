// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::balance::Equation;
use super::parameter::{LEAKS, leak_column};
use crate::Real;

/// Sums of the position filter's whitened observations over one block.
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
    /// Σ (age of f) f²/S for each leak: f looks back, by so much the older is the leak that it tells of.
    pub aged: [T; LEAKS],
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
            aged: [T::zero(); LEAKS],
            square: T::zero(),
            count: T::zero(),
        }
    }

    /// Adds one observation y = fᵀθ + noise of variance 1/`weight`; `aged` holds Σ age · f of each leak, s.
    #[inline]
    pub fn add(&mut self, f: &[T; N], aged: &[T; LEAKS], y: T, weight: T) {
        for i in 0..N {
            let wf = weight * f[i];
            for j in 0..=i {
                self.matrix[i][j] += wf * f[j];
            }
            self.vector[i] += wf * y;
        }
        for i in 0..LEAKS {
            self.aged[i] += weight * aged[i] * f[leak_column(i)];
        }
        self.square += weight * y * y;
        self.count += T::one();
    }

    /// Mean age of what each leak's column tells of, s.
    fn ages_s(&self) -> [T; LEAKS] {
        let mut ages = [T::zero(); LEAKS];
        for i in 0..LEAKS {
            let information = self.matrix[leak_column(i)][leak_column(i)];
            if information > T::zero() {
                ages[i] = self.aged[i] / information;
            }
        }
        ages
    }
}

/// Balances of one block: between them it looks for sudden changes.
pub(super) const BALANCES: usize = 2;

/// A balance of unit variance.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Balance<T, const N: usize> {
    pub equation: Equation<T, N>,
    /// Its age at the block's end, s.
    pub age_s: T,
}

/// What one block tells: the odometer's sums and, where both chambers were fed, whitened balances.
///
/// A row f tells of each leak as it was some time ago: with slopes s it reads fᵀ(θ − age ∘ s), so its information of
/// levels and slopes together is that of the row (f, −age ∘ f).
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Block<T, const N: usize> {
    /// Its length, s.
    pub time_s: T,
    /// Σ f fᵀ, lower triangle; at [`of_slopes`] Σ age² f fᵀ for the leaks.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    pub matrix: [[T; N]; N],
    /// Σ f y.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub vector: [T; N],
    /// Σ age f fᵀ for the leaks.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    pub aged: [[T; N]; LEAKS],
    /// Σ age f y for the leaks.
    pub aged_vector: [T; LEAKS],
    /// Σ y².
    square: T,
    /// Number of rows.
    count: T,
    /// What sensor noise in column 0 adds to Σ f₀² on average.
    pub column_noise: T,
}

/// Place, above the diagonal of a matrix whose lower triangle is the parameters', of the symmetric matrix of the leaks'
/// slopes; `i` >= `j`.
#[inline]
pub(super) const fn of_slopes(i: usize, j: usize) -> (usize, usize) {
    (j, i + 1)
}

impl<T: Real, const N: usize> Block<T, N> {
    pub fn new(
        time_s: T,
        sums: &BlockSums<T, N>,
        balances: &[Option<Balance<T, N>>; BALANCES],
        column_noise: T,
    ) -> Self {
        let mut block = Self::odometer(time_s, sums, column_noise);
        for Balance { equation, age_s } in balances.iter().flatten() {
            block.add(&equation.columns, equation.left, *age_s);
        }
        block
    }

    fn odometer(time_s: T, sums: &BlockSums<T, N>, column_noise: T) -> Self {
        let middle_s = T::lit(0.5) * time_s;
        let age_s = sums.ages_s().map(|age| age + middle_s);
        let mut block = Self {
            time_s,
            matrix: sums.matrix,
            vector: sums.vector,
            aged: [[T::zero(); N]; LEAKS],
            aged_vector: [T::zero(); LEAKS],
            square: sums.square,
            count: sums.count,
            column_noise,
        };
        for i in 0..LEAKS {
            let own = leak_column(i);
            for j in 0..N {
                block.aged[i][j] = age_s[i] * symmetric(&sums.matrix, own, j);
            }
            for j in 0..=i {
                let (row, column) = of_slopes(i, j);
                block.matrix[row][column] = age_s[j] * block.aged[i][leak_column(j)];
            }
            block.aged_vector[i] = age_s[i] * sums.vector[own];
        }
        block
    }

    /// Adds a row of unit variance that is `age_s` old.
    fn add(&mut self, f: &[T; N], y: T, age_s: T) {
        for i in 0..N {
            for j in 0..=i {
                self.matrix[i][j] += f[i] * f[j];
            }
            self.vector[i] += f[i] * y;
        }
        for i in 0..LEAKS {
            let aged = age_s * f[leak_column(i)];
            for j in 0..N {
                self.aged[i][j] += aged * f[j];
            }
            for j in 0..=i {
                let (row, column) = of_slopes(i, j);
                self.matrix[row][column] += aged * age_s * f[leak_column(j)];
            }
            self.aged_vector[i] += aged * y;
        }
        self.square += y * y;
        self.count += T::one();
    }

    /// Σ (y − fᵀθ)² at `theta`, and the number of rows.
    pub fn chi_square(&self, theta: &[T; N]) -> (T, T) {
        let mut chi = self.square;
        for i in 0..N {
            let mut told = T::lit(2.0) * self.vector[i] - theta[i] * self.matrix[i][i];
            for j in 0..i {
                told -= T::lit(2.0) * theta[j] * self.matrix[i][j];
            }
            chi -= theta[i] * told;
        }
        (chi, self.count)
    }
}

/// Entry of a symmetric matrix kept in the lower triangle.
#[inline]
pub(super) fn symmetric<T: Copy, const N: usize>(matrix: &[[T; N]; N], i: usize, j: usize) -> T {
    if i >= j { matrix[i][j] } else { matrix[j][i] }
}
