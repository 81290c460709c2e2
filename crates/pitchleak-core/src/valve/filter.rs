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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
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
            column.iter_mut().for_each(|entry| *entry /= pivot);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::valve::unknowns::VALVE_COVARIANCES;
    use nalgebra::{SMatrix, SVector};
    use pitchleak_testkit::white_noise;

    type Dense = SMatrix<f64, N, N>;

    /// A covariance, and the filter of it.
    fn drawn(seed: u64) -> (Dense, Filter<f64>) {
        let mut normal = white_noise(seed);
        let root = Dense::from_fn(|_, _| normal.next().unwrap_or_default());
        let dense = root * root.transpose() + Dense::identity() * 0.1;
        let mut covariance = [0.0; VALVE_COVARIANCES];
        let rows = (0..N).flat_map(|i| (0..=i).map(move |j| (i, j)));
        covariance.iter_mut().zip(rows).for_each(|(entry, place)| *entry = dense[place]);
        let calibration = ValveCalibration {
            mean: [0.0; N],
            covariance,
            rated_flow_m3s: 1.0,
            rated_drop_pa: 1.0,
            tank_pa: 0.0,
            hysteresis: 0.0,
            null_leak: 0.0,
            gain_drift: 0.0,
            lap_drift: 0.0,
            null_leak_drift: 0.0,
        };
        (dense, Filter::of(&calibration, &[0.0; N]))
    }

    fn assert_same(dense: &Dense, filter: &Filter<f64>) {
        for unknown in 0..N {
            let variance = dense[(unknown, unknown)];
            assert!((filter.variance(unknown) / variance - 1.0).abs() < 1e-9, "{unknown}");
        }
    }

    /// The textbook's Kalman filter with the whole covariance.
    #[test]
    fn an_equation_does_what_the_textbook_says() {
        let (mut dense, mut filter) = drawn(1);
        assert_same(&dense, &filter);
        let mut step = SVector::<f64, N>::zeros();
        let mut normal = white_noise(2);
        for _ in 0..50 {
            let row: Row<f64> = [(); N + 1].map(|()| normal.next().unwrap_or_default());
            let columns = SVector::<f64, N>::from_iterator(row[..N].iter().copied());
            let moved = dense * columns;
            let variance = 1.0 + columns.dot(&moved);
            let innovation = row[N] - columns.dot(&step);
            step += moved * (innovation / variance);
            dense -= moved * moved.transpose() / variance;
            let surprise = filter.update(&row);
            assert!((surprise.innovation - innovation).abs() < 1e-8);
            assert!((surprise.variance / variance - 1.0).abs() < 1e-9);
            assert!((surprise.gains[5] - moved[5] / variance).abs() < 1e-9);
        }
        assert_same(&dense, &filter);
        assert!(step.iter().zip(filter.step).all(|(dense, own)| (dense - own).abs() < 1e-8));
    }

    #[test]
    fn a_direction_that_widens_is_added_to_the_covariance() {
        let (mut dense, mut filter) = drawn(3);
        for (unknown, variance) in [(0, 0.5), (9, 2.0), (22, 0.1)] {
            let mut direction = [0.0; N];
            (direction[unknown], direction[4]) = (1.0, -0.7);
            let vector = SVector::from(direction);
            dense += vector * vector.transpose() * variance;
            filter.widen(variance, direction);
            assert_same(&dense, &filter);
        }
    }
}
