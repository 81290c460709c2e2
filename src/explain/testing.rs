//! What unit tests of columns and readings share: a block of readings as raw sums.

use super::readings::Combination;
use pitchleak_core::continuity::{BlockSums, Row};
use pitchleak_core::{Cylinder, Fluid, Sample};

/// Raw sums of the second block of readings at `step_s`, which know the time.
pub(super) fn sums(cylinder: &Cylinder<f64>, step_s: f64, read: impl Fn(u32) -> Sample<f64>) -> Combination {
    let mut blocks = BlockSums::new(cylinder, &Fluid::paper());
    let step_s = |k: u32| if k == 0 { 0.0 } else { step_s };
    let rows = (0..60).map(|k| Row::read(step_s(k), &read(k)));
    rows.filter_map(|row| blocks.push(&row)).nth(1).expect("two blocks").sums
}

pub(super) fn dot(combination: &Combination, sums: &Combination) -> f64 {
    combination.iter().zip(sums).map(|(by, sum)| by * sum).sum()
}
