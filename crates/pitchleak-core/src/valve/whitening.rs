//! Rows of hats whose noise stands in their neighbours, too, made white one after the other: S = L Lᵀ with L of two block diagonals.

use super::filter::Row;
use super::rows::{BlockNoise, ByMeans, Pair};
use crate::Real;

/// The last hat's rows, white.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Whitening<T> {
    pub rows: [Row<T>; 2],
    /// L's own block: [balance, both, A].
    diagonal: [T; 3],
    by_means: ByMeans<T>,
    /// Of the block over which it falls.
    pub last: BlockNoise<T>,
}

/// A variance that is less than this share of what it was before the last hat's part was taken off is rounding.
const LEAST_SHARE: f64 = 1e-5;

impl<T: Real> Whitening<T> {
    /// The next hat, from the block over which it rises to the one over which it falls, after the hat `before` where there is no gap.
    pub fn next(
        before: Option<&Self>,
        rows: &[Row<T>; 2],
        by_means: ByMeans<T>,
        [first, last]: [BlockNoise<T>; 2],
    ) -> Self {
        let mut whole = [T::zero(); 3];
        first.add_own(-T::one(), &by_means, &mut whole);
        last.add_own(T::one(), &by_means, &mut whole);
        let (mut own, mut rows) = (whole, *rows);
        if let Some(before) = before {
            let shares = before.shares(first.shared(&by_means, &before.by_means));
            let [[a, b], [c, d]] = shares;
            let left = [own[0] - a * a - b * b, own[1] - c * a - d * b, own[2] - c * c - d * d];
            if is_positive(&left, &whole) {
                own = left;
                before.take_off(shares, &mut rows);
            }
        }
        let balance = own[0].sqrt();
        let both = own[1] / balance;
        let a = (own[2] - both * both).sqrt();
        let (per_balance, per_a) = (balance.recip(), a.recip());
        let [on_balance, on_a] = &mut rows;
        for (first, second) in on_balance.iter_mut().zip(on_a) {
            *first *= per_balance;
            *second = (*second - both * *first) * per_a;
        }
        Self { rows, diagonal: [balance, both, a], by_means, last }
    }

    /// S_k,k−1 L_k−1⁻ᵀ.
    fn shares(&self, shared: [Pair<T>; 2]) -> [Pair<T>; 2] {
        let [balance, both, a] = self.diagonal;
        shared.map(|[left, right]| {
            let left = left / balance;
            [left, (right - both * left) / a]
        })
    }

    fn take_off(&self, shares: [Pair<T>; 2], rows: &mut [Row<T>; 2]) {
        let [balance, a] = &self.rows;
        for (row, [by_balance, by_a]) in rows.iter_mut().zip(shares) {
            for ((entry, first), second) in row.iter_mut().zip(balance).zip(a) {
                *entry -= by_balance * *first + by_a * *second;
            }
        }
    }
}

/// Whether what is left of a covariance is one, beyond rounding.
fn is_positive<T: Real>(left: &[T; 3], whole: &[T; 3]) -> bool {
    let share = T::lit(LEAST_SHARE);
    left[0] > share * whole[0] && left[2] - left[1] * left[1] / left[0] > share * whole[2]
}
