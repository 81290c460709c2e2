//! Steps whose noise is block tridiagonal, made white one after the other: S = L Lᵀ with L of two block diagonals.

use super::edges::Signals;
use super::equations::{Slopes, Step};
use nalgebra::{Matrix2, Matrix2x5, Vector2};

/// A step whose noise is white and of variance 1.
pub(super) struct WhiteStep {
    pub residual: Vector2<f64>,
    pub by_unknowns: Slopes,
    by_first: Matrix2x5<f64>,
    by_last: Matrix2x5<f64>,
    /// L's block of this step, lower triangular, and its block with the step before.
    diagonal: Matrix2<f64>,
    below: Matrix2<f64>,
}

/// Whitens the steps of a stretch in the order of time.
pub(super) struct Whitening {
    variances: Signals,
    steps: Vec<WhiteStep>,
}

impl Whitening {
    pub fn new(variances: Signals, count: usize) -> Self {
        Self { variances, steps: Vec::with_capacity(count) }
    }

    /// Takes in the next step; none where its noise is no number.
    pub fn push(&mut self, step: &Step) -> Option<()> {
        let scaled = |slopes: &Matrix2x5<f64>| {
            Matrix2x5::from_fn(|row, column| slopes[(row, column)] * self.variances[column])
        };
        let own = scaled(&step.by_first) * step.by_first.transpose()
            + scaled(&step.by_last) * step.by_last.transpose();
        let (mut below, mut square) = (Matrix2::zeros(), own);
        let (mut residual, mut by_unknowns) = (step.residual_m3, step.by_unknowns);
        if let Some(last) = self.steps.last() {
            let shared = scaled(&step.by_first) * last.by_last.transpose();
            // L_k,k−1 L_k−1ᵀ = S_k,k−1.
            below = last.diagonal.solve_lower_triangular(&shared.transpose())?.transpose();
            square -= below * below.transpose();
            residual -= below * last.residual;
            by_unknowns -= below * last.by_unknowns;
        }
        let diagonal = square.cholesky()?.l();
        let inverse = diagonal.try_inverse()?;
        self.steps.push(WhiteStep {
            residual: inverse * residual,
            by_unknowns: inverse * by_unknowns,
            by_first: step.by_first,
            by_last: step.by_last,
            diagonal,
            below,
        });
        Some(())
    }

    pub fn steps(&self) -> &[WhiteStep] {
        &self.steps
    }

    /// By how much each node's signals are off, R Gᵀ S⁻¹ of what is left, where `left` is that of each step, whitened.
    pub fn corrections(&self, left: impl Fn(usize, &WhiteStep) -> Vector2<f64>) -> Option<Vec<Signals>> {
        let mut corrections = vec![Signals::zeros(); self.steps.len() + 1];
        let mut carried = Vector2::zeros();
        for (index, step) in self.steps.iter().enumerate().rev() {
            let pull = step.diagonal.tr_solve_lower_triangular(&(left(index, step) - carried))?;
            corrections[index] += step.by_first.transpose() * pull;
            corrections[index + 1] += step.by_last.transpose() * pull;
            carried = step.below.transpose() * pull;
        }
        corrections.iter_mut().for_each(|one| *one = one.component_mul(&self.variances));
        Some(corrections)
    }
}
