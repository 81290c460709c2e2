//! Blocks that wait for their segment: where a leak changes at once a segment ends, at the block of the change.

// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::block_sums::{Block, RawSum};
use crate::number::Filled;
use crate::{Cylinder, Real, Sensors};

/// Blocks that wait at most: 6 s.
pub(super) const WAITING: usize = 24;
/// Blocks of a segment without a change: 4 s. Fewer cost the position its memory, as each segment's noise begins anew; chosen.
pub(super) const SEGMENT_BLOCKS: usize = 16;
/// Blocks on either side of a change at the least: as many as the regression has columns before it.
const LEAST_SIDE: usize = 4;
/// A change shows by so many standard deviations. A false one costs a border; chosen.
const CHANGE_SIGMAS: f64 = 5.0;
/// Constant flow, the leaks, and the change.
const REGRESSORS: usize = 5;
/// The sign of each in the balance where leaks let no oil in; none may have either. What falls with the pressure that a leak takes away
/// is the leak that opened, and no other one that lets oil in.
const SIGNS: [f64; REGRESSORS] = [0.0, -1.0, 1.0, 1.0, 0.0];
/// Keeps pressures that do not change solvable.
const RIDGE: f64 = 1e-6;

/// The waiting blocks.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Real",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
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
            for internal in [false, true] {
                let square = self.contrast(at, internal).unwrap_or(T::zero());
                if square > best.1 {
                    best = (Some(at), square);
                }
            }
        }
        best.0
    }

    /// Square of a change's size in its standard deviations, the block `at` itself left out: of a constant flow, or of one
    /// that follows the load pressure.
    fn contrast(&self, at: usize, internal: bool) -> Option<T> {
        let mut matrix = [[T::zero(); REGRESSORS]; REGRESSORS];
        let mut vector = [T::zero(); REGRESSORS];
        let (mut square, mut declared, mut rows) = (T::zero(), T::zero(), T::zero());
        for (place, block) in self.blocks().iter().enumerate().filter(|(place, _)| *place != at) {
            if block.fed != [true, true] {
                return None;
            }
            let (left, row) = self.balance(block, place > at, internal);
            for i in 0..REGRESSORS {
                for j in 0..=i {
                    matrix[i][j] += row[i] * row[j];
                }
                vector[i] += row[i] * left;
            }
            square += left * left;
            declared += self.variance * block.time_square_s2[0];
            rows += T::one();
        }
        let freedom = rows - T::lit(REGRESSORS as f64);
        let (last, variance_share, explained) = solve_last(&matrix, &vector)?;
        let variance = ((square - explained) / freedom).at_least(declared / rows);
        Some(last * last / (variance * variance_share))
    }

    /// The balance of a block, in metres of travel: its left side, and the regressors.
    fn balance(&self, block: &Block<T>, after: bool, internal: bool) -> (T, [T; REGRESSORS]) {
        let sum = |raw: RawSum| block.sums[raw as usize];
        let [a, b] = self.area_m2;
        let (pa, pb, time) = (sum(RawSum::PressureA), sum(RawSum::PressureB), sum(RawSum::Time));
        let changed = if internal { pa - pb } else { time };
        let changed = if after { changed } else { T::zero() };
        (sum(RawSum::ResidualA) / a + sum(RawSum::ResidualB) / b, [time, pa - pb, pa, pb, changed])
    }
}

/// Least squares: the last coefficient, its variance for unit noise, and how much of the squares is explained; without those whose sign
/// is wrong.
fn solve_last<T: Real>(
    matrix: &[[T; REGRESSORS]; REGRESSORS],
    vector: &[T; REGRESSORS],
) -> Option<(T, T, T)> {
    let mut is_free = [true; REGRESSORS];
    let mut found = Solution::of(matrix, vector, &is_free)?;
    while let Some(wrong) = (0..REGRESSORS).find(|i| T::lit(SIGNS[*i]) * found.coefficients[*i] < T::zero()) {
        is_free[wrong] = false;
        found = Solution::of(matrix, vector, &is_free)?;
    }
    let pivot = found.last_pivot;
    Some((found.coefficients[REGRESSORS - 1], T::one() / (pivot * pivot), found.explained))
}

/// Of normal equations.
struct Solution<T> {
    coefficients: [T; REGRESSORS],
    last_pivot: T,
    explained: T,
}

impl<T: Real> Solution<T> {
    fn of(
        matrix: &[[T; REGRESSORS]; REGRESSORS],
        vector: &[T; REGRESSORS],
        is_free: &[bool; REGRESSORS],
    ) -> Option<Self> {
        let mut factor = [[T::zero(); REGRESSORS]; REGRESSORS];
        let mut half = [T::zero(); REGRESSORS];
        let mut explained = T::zero();
        for i in 0..REGRESSORS {
            if !is_free[i] {
                factor[i][i] = T::one();
                continue;
            }
            for j in 0..=i {
                let mut value = if is_free[j] { matrix[i][j] } else { T::zero() };
                if i == j {
                    value += value * T::lit(RIDGE);
                }
                for k in 0..j {
                    value -= factor[i][k] * factor[j][k];
                }
                factor[i][j] = if i == j { value.at_least(T::zero()).sqrt() } else { value / factor[j][j] };
            }
            if factor[i][i] <= T::zero() {
                return None;
            }
            let mut value = vector[i];
            for k in 0..i {
                value -= factor[i][k] * half[k];
            }
            half[i] = value / factor[i][i];
            explained += half[i] * half[i];
        }
        let mut coefficients = [T::zero(); REGRESSORS];
        for i in (0..REGRESSORS).rev() {
            let mut value = half[i];
            for k in i + 1..REGRESSORS {
                value -= factor[k][i] * coefficients[k];
            }
            coefficients[i] = value / factor[i][i];
        }
        Some(Self { coefficients, last_pivot: factor[REGRESSORS - 1][REGRESSORS - 1], explained })
    }
}
