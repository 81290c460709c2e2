//! The unknowns and their covariance P = U D Uᵀ, U unit upper triangular: Bierman, Factorization Methods for Discrete Sequential
//! Estimation (1977), ch. V. It keeps P positive in f32, where one leak's variance falls by ten orders.

use super::calibration::ValveCalibration;
use super::unknowns::VALVE_UNKNOWNS as N;
use crate::Real;

/// Entries above U's diagonal, column by column.
const ABOVE: usize = N * (N - 1) / 2;
/// A pivot is at least this share of its variance: what is less is rounding.
const LEAST_SHARE: f64 = 1e-6;

/// Columns of an equation, then its left side; the noise of that has the variance 1.
pub(super) type Row<T> = [T; N + 1];

/// The unknowns beside those of the calibration, and how well they are known.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Filter<T> {
    pub step: [T; N],
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    above: [T; ABOVE],
    pivots: [T; N],
}

/// What an equation said that was not foretold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surprise<T> {
    pub innovation: T,
    /// Its variance.
    pub variance: T,
    /// By which of it each unknown moves.
    pub gains: [T; N],
}

impl<T: Real> Filter<T> {
    /// Of the calibration's covariances and what was added to each variance since.
    pub fn of(calibration: &ValveCalibration<T>, added: &[T; N]) -> Self {
        let zero = T::zero();
        let mut filter = Self { step: [zero; N], above: [zero; ABOVE], pivots: [zero; N] };
        // Row by row below the diagonal is column by column above it.
        let mut entries = calibration.covariance.iter();
        for (j, (pivot, more)) in filter.pivots.iter_mut().zip(added).enumerate() {
            let column = filter.above.get_mut(start(j)..start(j) + j).unwrap_or_default();
            column.iter_mut().zip(entries.by_ref()).for_each(|(place, entry)| *place = *entry);
            *pivot = entries.next().copied().unwrap_or_default() + *more;
        }
        filter.factor();
        filter
    }

    /// From P, in place: the last column first.
    fn factor(&mut self) {
        let least = self.pivots.map(|variance| T::lit(LEAST_SHARE) * variance);
        for j in (0..N).rev() {
            let pivot = self.pivots[j].at_least(least[j]).at_least(T::min_positive_value());
            self.pivots[j] = pivot;
            let (before, column) = self.above.split_at_mut_checked(start(j)).unwrap_or_default();
            let column = column.get_mut(..j).unwrap_or_default();
            let mut left = before.iter_mut();
            for (i, entry) in column.iter().enumerate() {
                let share = *entry / pivot;
                column.iter().take(i).zip(left.by_ref()).for_each(|(other, place)| *place -= share * *other);
                if let Some(own) = self.pivots.get_mut(i) {
                    *own -= share * *entry;
                }
            }
            column.iter_mut().for_each(|entry| *entry = *entry / pivot);
        }
    }

    /// Takes in an equation (Bierman 1977, §V.3).
    pub fn update(&mut self, row: &Row<T>) -> Surprise<T> {
        let mut gains = [T::zero(); N];
        let mut innovation = row[N];
        let mut variance = T::one();
        let mut above = self.above.iter_mut();
        for j in 0..N {
            innovation -= row[j] * self.step[j];
            let mut projected = row[j];
            let column = above.as_slice();
            column.iter().zip(row).take(j).for_each(|(entry, own)| projected += *entry * *own);
            let weighed = self.pivots[j] * projected;
            let share = -projected / variance;
            let before = variance;
            variance += projected * weighed;
            self.pivots[j] *= before / variance;
            for (gain, entry) in gains.iter_mut().take(j).zip(above.by_ref()) {
                let old = *entry;
                *entry += share * *gain;
                *gain += weighed * old;
            }
            gains[j] = weighed;
        }
        let per_variance = variance.recip();
        for (gain, step) in gains.iter_mut().zip(&mut self.step) {
            *gain *= per_variance;
            *step += *gain * innovation;
        }
        Surprise { innovation, variance, gains }
    }

    /// The unknowns may have moved along a direction, by a step of this variance (Agee and Turner 1972; Bierman 1977, §III.5).
    pub fn widen(&mut self, variance: T, mut direction: [T; N]) {
        let mut left = variance;
        for (j, pivot) in self.pivots.iter_mut().enumerate().rev() {
            let own = direction.get(j).copied().unwrap_or_default();
            let wider = *pivot + left * own * own;
            if own.is_zero() || wider <= T::zero() {
                continue;
            }
            let share = left * own / wider;
            left *= *pivot / wider;
            *pivot = wider;
            let column = self.above.get_mut(start(j)..start(j) + j).unwrap_or_default();
            for (entry, other) in column.iter_mut().zip(&mut direction) {
                *other -= own * *entry;
                *entry += share * *other;
            }
        }
    }

    /// Variance of an unknown.
    pub fn variance(&self, unknown: usize) -> T {
        let mut sum = self.pivots.get(unknown).copied().unwrap_or_default();
        for j in unknown + 1..N {
            let entry = self.above.get(start(j) + unknown).copied().unwrap_or_default();
            sum += entry * entry * self.pivots[j];
        }
        sum
    }
}

/// Where column `j` begins.
const fn start(j: usize) -> usize {
    if j == 0 { 0 } else { j * (j - 1) / 2 }
}
