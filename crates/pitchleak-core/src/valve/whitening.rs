//! Rows of hats whose noise stands in their neighbours, too, made white one after the other: S = L Lᵀ with L of two block diagonals.

use super::filter::Row;
use super::rows::{Ends, Pair};
use super::unknowns::VALVE_UNKNOWNS as N;
use crate::Real;

/// The last hat's rows, white.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Whitening<T> {
    pub rows: [Row<T>; 2],
    /// L's own block: [balance, both, A].
    diagonal: [T; 3],
    /// How the means stood in it.
    by_mean: [Pair<T>; 5],
}

/// A variance is at least this share of what it was before the last row was taken off: what is less is rounding.
const LEAST_SHARE: f64 = 1e-5;

impl<T: Real> Whitening<T> {
    /// The next hat, that rises over `first` and falls over `last`, after `before` where there is no gap between them.
    pub fn next(before: Option<&Self>, mut rows: [Row<T>; 2], first: &Ends<T>, last: &Ends<T>) -> Self {
        let mut own = [T::zero(); 3];
        first.add_own(-T::one(), &mut own);
        last.add_own(T::one(), &mut own);
        let whole = own;
        if let Some(before) = before {
            let [balance, both, a] = before.diagonal;
            let shared = first.shared(&before.by_mean);
            let [on_balance, on_a] = shared.map(|[left, right]| {
                let left = left / balance;
                [left, (right - both * left) / a]
            });
            let dot = |x: Pair<T>, y: Pair<T>| x[0] * y[0] + x[1] * y[1];
            own[0] -= dot(on_balance, on_balance);
            own[1] -= dot(on_a, on_balance);
            own[2] -= dot(on_a, on_a);
            for (row, [by_balance, by_a]) in rows.iter_mut().zip([on_balance, on_a]) {
                for ((entry, first), second) in row.iter_mut().zip(&before.rows[0]).zip(&before.rows[1]) {
                    *entry -= by_balance * *first + by_a * *second;
                }
            }
        }
        let share = T::lit(LEAST_SHARE);
        let balance = own[0].at_least(share * whole[0]).sqrt();
        let both = own[1] / balance;
        let a = (own[2] - both * both).at_least(share * whole[2]).sqrt();
        let (per_balance, per_a) = (balance.recip(), a.recip());
        let [on_balance, on_a] = &mut rows;
        for (first, second) in on_balance.iter_mut().zip(on_a) {
            *first *= per_balance;
            *second = (*second - both * *first) * per_a;
        }
        Self { rows, diagonal: [balance, both, a], by_mean: first.by_mean }
    }
}

const _: () = assert!(N == 23);
