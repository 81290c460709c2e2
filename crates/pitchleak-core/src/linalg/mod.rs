//! Normal equations of N levels and a slope of each leak, in fixed memory.
//!
//! - [`Joint`]: their symmetric matrix, packed.
//! - [`Factors`]: its factorisation U D Uᵀ (Bierman 1977, Factorization Methods for Discrete Sequential Estimation,
//!   §III.4), last parameter first: the slopes, then the levels down to level 0.

mod factors;

pub(crate) use factors::{Factors, Pivots};

use crate::Real;

/// Slopes of a joint matrix.
pub(crate) const SLOPES: usize = 3;

/// Symmetric matrix of N levels, N ≥ 4, and three slopes, packed: N² + 3 N numbers, 28 for N = 4, which is its triangle.
///
/// In a square stands the levels' triangle on and below the diagonal and the slopes' above it; what slopes and levels have in
/// common is a strip beside it. A flat triangle would be smaller for larger N by N (N − 1)/2 − 6, but needs an array of
/// (N + 3)(N + 4)/2, which the language doesn't know how to size.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(crate) struct Joint<T, const N: usize> {
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    square: [[T; N]; N],
    /// A row for each slope.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    pub cross: [[T; N]; SLOPES],
}

impl<T: Real, const N: usize> Joint<T, N> {
    pub fn zero() -> Self {
        Self { square: [[T::zero(); N]; N], cross: [[T::zero(); N]; SLOPES] }
    }

    /// Of levels alone, from their lower triangle; above its diagonal stands nothing.
    pub fn of_levels(lower: [[T; N]; N]) -> Self {
        Self { square: lower, ..Self::zero() }
    }

    /// Of the levels: what stands on and below the diagonal.
    #[cfg(test)]
    pub fn lower(&self) -> &[[T; N]; N] {
        &self.square
    }

    /// Of two levels, `i` >= `j`.
    #[inline]
    pub fn level(&self, i: usize, j: usize) -> T {
        self.square[i][j]
    }

    #[inline]
    pub fn level_mut(&mut self, i: usize, j: usize) -> &mut T {
        &mut self.square[i][j]
    }

    /// Of two levels in any order.
    #[inline]
    pub fn levels(&self, i: usize, j: usize) -> T {
        symmetric(&self.square, i, j)
    }

    /// Of two slopes, `i` >= `j`.
    #[inline]
    pub fn slope(&self, i: usize, j: usize) -> T {
        self.square[j][i + 1]
    }

    #[inline]
    pub fn slope_mut(&mut self, i: usize, j: usize) -> &mut T {
        &mut self.square[j][i + 1]
    }
}

/// Entry of a symmetric matrix kept in the lower triangle.
#[inline]
pub(crate) fn symmetric<T: Copy, const N: usize>(matrix: &[[T; N]; N], i: usize, j: usize) -> T {
    if i >= j { matrix[i][j] } else { matrix[j][i] }
}
