//! Least squares where leaks let no oil in: coefficients that come out negative and can't be are left out, one after another (active set;
//! Lawson & Hanson 1974, "Solving Least Squares Problems", ch. 23).

// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use crate::Real;

/// Keeps columns that do not change solvable, as a share of their squares.
const RIDGE: f64 = 1e-4;

/// The solution of normal equations.
pub(super) struct LeakFit<T, const N: usize> {
    coefficients: [T; N],
    last_pivot: T,
    /// How much of the left side's square it explains.
    pub explained: T,
}

impl<T: Real, const N: usize> LeakFit<T, N> {
    /// Of the lower triangle of `matrix`.
    pub fn of(matrix: &[[T; N]; N], vector: &[T; N], are_leaks: &[bool; N]) -> Self {
        let mut is_free = [true; N];
        let mut found = Self::with(matrix, vector, &is_free);
        while let Some(wrong) = (0..N).find(|i| are_leaks[*i] && found.coefficients[*i] < T::zero()) {
            is_free[wrong] = false;
            found = Self::with(matrix, vector, &is_free);
        }
        found
    }

    /// The last coefficient and its variance for unit noise; none where its column is not there.
    pub fn last(&self) -> Option<(T, T)> {
        let share = T::one() / (self.last_pivot * self.last_pivot);
        (self.last_pivot > T::zero()).then_some((self.coefficients[N - 1], share))
    }

    fn with(matrix: &[[T; N]; N], vector: &[T; N], is_free: &[bool; N]) -> Self {
        let mut factor = [[T::zero(); N]; N];
        let mut half = [T::zero(); N];
        let mut explained = T::zero();
        for i in 0..N {
            let (mut square, mut value) = (matrix[i][i] * T::lit(1.0 + RIDGE), vector[i]);
            for j in 0..i {
                let mut product = matrix[i][j];
                for k in 0..j {
                    product -= factor[i][k] * factor[j][k];
                }
                factor[i][j] = if factor[j][j] > T::zero() { product / factor[j][j] } else { T::zero() };
                square -= factor[i][j] * factor[i][j];
                value -= factor[i][j] * half[j];
            }
            if is_free[i] && square > T::zero() {
                factor[i][i] = square.sqrt();
                half[i] = value / factor[i][i];
                explained += half[i] * half[i];
            } else {
                factor[i] = [T::zero(); N];
            }
        }
        let mut coefficients = [T::zero(); N];
        for i in (0..N).rev().filter(|i| factor[*i][*i] > T::zero()) {
            let mut value = half[i];
            for k in i + 1..N {
                value -= factor[k][i] * coefficients[k];
            }
            coefficients[i] = value / factor[i][i];
        }
        Self { coefficients, last_pivot: factor[N - 1][N - 1], explained }
    }
}
