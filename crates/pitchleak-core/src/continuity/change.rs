//! Blocks that wait for their segment: where a leak changes at once a segment ends, at the block of the change.
//!
//! Least squares where leaks let no oil in: coefficients that come out negative and can't be are left out, one after another (active set;
//! Lawson & Hanson 1974, "Solving Least Squares Problems", ch. 23).

// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::block_sums::{Block, RawSum};
use crate::number::Filled;
use crate::{Cylinder, Real, Sensors};

/// Blocks that wait at most: 6 s.
const WAITING: usize = 24;
/// Blocks of a segment without a change: 4 s. Fewer cost the position its memory, as each segment's noise begins anew; chosen.
pub(super) const SEGMENT_BLOCKS: usize = 16;
/// Blocks on either side of a change at the least: as many as the regression has columns before it.
const LEAST_SIDE: usize = 4;
/// A change shows by so many standard deviations. A false one costs a border; chosen.
const CHANGE_SIGMAS: f64 = 5.0;
/// Constant flow, and the leaks.
const STEADY: usize = 4;
/// Those, and the change.
const REGRESSORS: usize = STEADY + 1;
/// Those that let no oil in. What falls with the pressure that a leak takes away is the leak that opened, and no other one that does.
const ARE_LEAKS: [bool; REGRESSORS] = [false, true, true, true, false];

/// How many things a change may follow: time, as a meter's zero, and the pressure across each leak.
const FOLLOWED: usize = 4;

/// The waiting blocks.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct Waiting<T> {
    blocks: Filled<Block<T>, WAITING>,
    area_m2: [T; 2],
    /// Variance of a balance's flow noise per s² of Σ dt², m².
    variance: T,
}

impl<T: Real> Waiting<T> {
    pub fn new(cylinder: &Cylinder<T>, sensors: &Sensors<T>) -> Self {
        let square = |std: T, area: T| std * std / (area * area);
        Self {
            blocks: Filled::new(),
            area_m2: [cylinder.area_a_m2, cylinder.area_b_m2],
            variance: square(sensors.flow_a.noise_std, cylinder.area_a_m2)
                + square(sensors.flow_b.noise_std, cylinder.area_b_m2),
        }
    }

    /// The waiting blocks, oldest first.
    pub fn blocks(&self) -> &[Block<T>] {
        self.blocks.all()
    }

    /// One more.
    pub fn add(&mut self, block: &Block<T>) {
        self.blocks.push(*block);
    }

    /// Whether it has to let some go.
    pub fn is_full(&self) -> bool {
        self.blocks.is_full()
    }

    /// Lets the oldest go.
    pub fn release(&mut self, released: usize) {
        self.blocks.remove(0, released);
    }

    /// The block in which a flow changed at once, if one did.
    pub fn change(&self) -> Option<usize> {
        let latest = self.blocks().len().checked_sub(LEAST_SIDE)?;
        let mut best = (None, T::lit(CHANGE_SIGMAS * CHANGE_SIGMAS));
        for at in LEAST_SIDE..latest {
            for square in self.contrasts(at).into_iter().flatten().flatten() {
                if square > best.1 {
                    best = (Some(at), square);
                }
            }
        }
        best.0
    }

    /// Squares of the sizes in their standard deviations of changes that follow each of these, the block `at` itself left out.
    fn contrasts(&self, at: usize) -> Option<[Option<T>; FOLLOWED]> {
        let mut matrix = [[T::zero(); REGRESSORS]; REGRESSORS];
        let mut vector = [T::zero(); REGRESSORS];
        // Of each change: its products with the steady regressors, its square, and its product with the left side.
        let mut changes = [([T::zero(); REGRESSORS], T::zero()); FOLLOWED];
        let (mut square, mut declared, mut rows) = (T::zero(), T::zero(), T::zero());
        for (place, block) in self.blocks().iter().enumerate().filter(|(place, _)| *place != at) {
            if block.fed != [true, true] {
                return None;
            }
            let (left, row, followed) = self.balance(block);
            for i in 0..STEADY {
                for j in 0..=i {
                    matrix[i][j] += row[i] * row[j];
                }
                vector[i] += row[i] * left;
            }
            if place > at {
                for ((products, with_left), own) in changes.iter_mut().zip(followed) {
                    let others = row.iter().chain([&own]);
                    products.iter_mut().zip(others).for_each(|(sum, other)| *sum += own * *other);
                    *with_left += own * left;
                }
            }
            square += left * left;
            declared += self.variance * block.time_square_s2[0];
            rows += T::one();
        }
        let freedom = rows - T::lit(REGRESSORS as f64);
        Some(changes.map(|(products, with_left)| {
            (matrix[STEADY], vector[STEADY]) = (products, with_left);
            let fit = LeakFit::of(&matrix, &vector, &ARE_LEAKS);
            let (last, variance_share) = fit.last()?;
            let variance = ((square - fit.explained) / freedom).at_least(declared / rows);
            Some(last * last / (variance * variance_share))
        }))
    }

    /// The balance of a block, in metres of travel: its left side, the steady regressors, and what a change may follow.
    fn balance(&self, block: &Block<T>) -> (T, [T; STEADY], [T; FOLLOWED]) {
        let sum = |raw: RawSum| block.sums[raw as usize];
        let [a, b] = self.area_m2;
        let (pa, pb, time) = (sum(RawSum::PressureA), sum(RawSum::PressureB), sum(RawSum::Time));
        let left = sum(RawSum::ResidualA) / a + sum(RawSum::ResidualB) / b;
        (left, [time, pb - pa, pa, pb], [time, pa - pb, pa, pb])
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use pitchleak_testkit::white_noise;

    const N: usize = 4;

    fn normal_equations(seed: u64) -> ([[f64; N]; N], [f64; N]) {
        let mut noise = white_noise(seed);
        let rows = DMatrix::from_fn(9, N, |_, _| noise.next().expect("no end"));
        let left = DVector::from_fn(9, |_, _| noise.next().expect("no end"));
        let (square, vector) = (rows.transpose() * &rows, rows.transpose() * left);
        (
            core::array::from_fn(|i| core::array::from_fn(|j| square[(i, j)])),
            core::array::from_fn(|i| vector[i]),
        )
    }

    /// Coefficients, what they explain, and the inverse's last entry, of those that are free.
    fn dense(matrix: &[[f64; N]; N], vector: &[f64; N], is_free: [bool; N]) -> (DVector<f64>, f64, f64) {
        let entry = |i: usize, j: usize| match (is_free[i] && is_free[j], i == j) {
            (true, true) => (1.0 + RIDGE) * matrix[i][j],
            (true, false) => matrix[i][j],
            (false, _) => f64::from(i == j),
        };
        let inverse = DMatrix::from_fn(N, N, entry).try_inverse().expect("of full rank");
        let vector = DVector::from_fn(N, |i, _| if is_free[i] { vector[i] } else { 0.0 });
        let found = &inverse * &vector;
        let explained = found.dot(&vector);
        (found, explained, inverse[(N - 1, N - 1)])
    }

    /// Least squares where nothing has to be positive; else those of the leaks that are left, none of which
    /// lets oil in.
    #[test]
    fn is_least_squares_of_leaks_that_let_no_oil_in() {
        let mut left_out = 0;
        for seed in 0..40 {
            let (matrix, vector) = normal_equations(seed);
            for are_leaks in [[false; N], [true, true, true, false]] {
                let fit = LeakFit::of(&matrix, &vector, &are_leaks);
                assert!((0..N).all(|i| !are_leaks[i] || fit.coefficients[i] >= 0.0));
                let is_free = fit.coefficients.map(|coefficient| coefficient.abs() > 0.0);
                assert!((0..N).all(|i| are_leaks[i] || is_free[i]));
                left_out += is_free.into_iter().filter(|free| !free).count();
                let (coefficients, explained, share) = dense(&matrix, &vector, is_free);
                let found = DVector::from_row_slice(&fit.coefficients);
                assert!((found - coefficients).amax() < 1e-9);
                assert!((fit.explained - explained).abs() < 1e-9);
                let (last, last_share) = fit.last().expect("its column is there");
                assert!(
                    (last - fit.coefficients[N - 1]).abs() < 1e-12 && (last_share / share - 1.0).abs() < 1e-9
                );
            }
        }
        assert!(left_out > 20, "{left_out}");
    }

    /// Its pivot is none, not a division by zero.
    #[test]
    fn a_column_of_nothing_has_no_coefficient() {
        let (mut matrix, mut vector) = normal_equations(1);
        (0..N).for_each(|i| (matrix[N - 1][i], matrix[i][N - 1]) = (0.0, 0.0));
        vector[N - 1] = 0.0;
        let fit = LeakFit::of(&matrix, &vector, &[false; N]);
        assert!(fit.last().is_none() && fit.explained.is_finite());
    }

    /// Blocks of the balance with scatter of so many declared standard deviations; from the middle one on
    /// more flows, in standard deviations of a block, steadily or as much as the load pressure is of its
    /// mean.
    fn waiting(scatter: f64, more: f64, by_pressure: bool, seed: u64) -> Waiting<f64> {
        let mut waiting = Waiting::new(&Cylinder::paper(), &Sensors::paper());
        let mut noise = white_noise(seed);
        for k in 0..WAITING {
            let mut block = Block { fed: [true; 2], time_square_s2: [2.5e-3; 2], ..Block::default() };
            let pressure_mpa = 2.0 + noise.next().expect("no end");
            let std_m = f64::sqrt(waiting.variance * 2.5e-3);
            let share = if by_pressure { pressure_mpa / 2.0 } else { 1.0 };
            let more = if k > WAITING / 2 { more * share } else { 0.0 };
            block.sums[RawSum::Time as usize] = 0.25;
            block.sums[RawSum::PressureA as usize] = 0.25 * (3.0 + pressure_mpa);
            block.sums[RawSum::PressureB as usize] = 0.25 * 3.0;
            let left_m = std_m * (scatter * noise.next().expect("no end") + more);
            block.sums[RawSum::ResidualA as usize] = left_m * waiting.area_m2[0];
            waiting.add(&block);
        }
        waiting
    }

    /// By what the blocks scatter, and no less than the meters' noise as declared, a flow shows that is large
    /// beside it.
    #[test]
    fn a_change_is_one_beside_the_noise() {
        let shows = |scatter: f64, more: f64, by_pressure: bool| {
            (0..40).filter(|seed| waiting(scatter, more, by_pressure, *seed).change().is_some()).count()
        };
        for by_pressure in [false, true] {
            assert!(shows(1.0, 0.0, by_pressure) <= 2);
            assert!(shows(0.01, 1.0, by_pressure) == 0);
            assert!(shows(10.0, 8.0, by_pressure) <= 2);
            assert!(shows(1.0, 10.0, by_pressure) == 40);
        }
    }

    /// A leak flows more where the pressure across it jumps, and is the same leak.
    #[test]
    fn a_leak_that_follows_its_pressure_is_no_change() {
        for leak in 0..3 {
            let calm = waiting(1.0, 0.0, false, 7);
            let mut waiting = Waiting::new(&Cylinder::paper(), &Sensors::paper());
            for (k, mut block) in calm.blocks().iter().copied().enumerate() {
                let jump_mpa = if k > WAITING / 2 { 0.25 * 5.0 } else { 0.0 };
                let raised = if leak == 2 { RawSum::PressureB } else { RawSum::PressureA };
                block.sums[raised as usize] += jump_mpa;
                let [pa, pb] = [RawSum::PressureA, RawSum::PressureB].map(|raw| block.sums[raw as usize]);
                let left_m = 40.0 * f64::sqrt(waiting.variance * 2.5e-3) * [pb - pa, pa, pb][leak];
                block.sums[RawSum::ResidualA as usize] += left_m * waiting.area_m2[0];
                waiting.add(&block);
            }
            assert_eq!(waiting.change(), None, "{leak}");
        }
    }

    /// The block of the change is named; of a block whose flows are not measured nobody knows.
    #[test]
    fn a_change_has_its_block() {
        let mut waiting = waiting(0.5, 12.0, false, 1);
        assert_eq!(waiting.change(), Some(WAITING / 2));
        let mut unfed = *waiting.blocks().last().expect("a block");
        unfed.fed = [true, false];
        waiting.release(1);
        waiting.add(&unfed);
        assert_eq!(waiting.change(), None);
    }

    /// A leak out of chamber B empties it where the valve is shut: its flow falls with the pressure within a block. A change that
    /// follows nothing, or the load pressure, would be found a block too soon, and the pressure before that leak be held against it.
    #[test]
    fn a_leak_that_empties_its_chamber_has_its_block() {
        let calm = waiting(1.0, 0.0, false, 3);
        let mut waiting = Waiting::new(&Cylinder::paper(), &Sensors::paper());
        let opens = WAITING - LEAST_SIDE;
        for (k, mut block) in calm.blocks().iter().copied().enumerate() {
            let pressure_mpa = [4.1, 0.6, 0.36][usize::from(k >= opens) + usize::from(k > opens)];
            block.sums[RawSum::PressureA as usize] = 0.25 * (pressure_mpa + 1.9);
            block.sums[RawSum::PressureB as usize] = 0.25 * pressure_mpa;
            let flow = if k >= opens { 50.0 * pressure_mpa } else { 0.0 };
            let left_m = f64::sqrt(waiting.variance * 2.5e-3) * flow;
            block.sums[RawSum::ResidualA as usize] += left_m * waiting.area_m2[0];
            waiting.add(&block);
        }
        assert_eq!(waiting.change(), Some(opens - 1));
    }
}
