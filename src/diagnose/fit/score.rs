//! What one more term would bring, without a fit: the score test.

use super::regression::{Regression, Solution, normalised};
use crate::diagnose::thresholds::LEAST_NEW_SHARE;
use nalgebra::DVector;

/// What a further term would bring.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Score {
    pub(crate) term: usize,
    /// By how much the sum of squares falls.
    pub(crate) chi2_drop: f64,
    /// Its increment and standard deviation.
    pub(crate) value: f64,
    pub(crate) std: f64,
}

/// A column outside the regression, and what a solution's terms explain of it.
pub(crate) struct PartialColumn {
    unit: Vec<f64>,
    scale: f64,
    cross: DVector<f64>,
    explained: DVector<f64>,
    partial_variance: f64,
}

impl PartialColumn {
    /// Standard deviation of its size beside the solution's terms.
    pub(crate) fn std(&self) -> f64 {
        1.0 / self.partial_variance.sqrt() / self.scale
    }

    /// Correlation of what is new in two columns.
    pub(crate) fn correlation(&self, other: &Self) -> f64 {
        let product = self.unit.iter().zip(&other.unit).map(|(a, b)| a * b).sum::<f64>();
        (product - self.cross.dot(&other.explained)) / (self.partial_variance * other.partial_variance).sqrt()
    }
}

impl Regression {
    /// Score (Lagrange multiplier) test of one more term: Rao (1948).
    pub(crate) fn score(&self, solution: &Solution, term: usize) -> Option<Score> {
        if !self.shows(term) || solution.terms.contains(&term) {
            return None;
        }
        let y = self.columns.len();
        let cross = DVector::from_iterator(
            solution.terms.len(),
            solution.terms.iter().map(|other| self.total[(term, *other)]),
        );
        let products = (self.total[(term, term)], self.total[(term, y)]);
        self.score_of(solution, term, &cross, products, self.scale[term])
    }

    /// The same for a column that is not part of the regression.
    pub(crate) fn score_column(
        &self,
        solution: &Solution,
        term: usize,
        column: &PartialColumn,
    ) -> Option<Score> {
        self.score_of(solution, term, &column.cross, (1.0, self.with_y(column)), column.scale)
    }

    /// By how much the sum of squares falls with such a column.
    pub(crate) fn chi2_drop(&self, solution: &Solution, column: &PartialColumn) -> f64 {
        let pull = self.with_y(column) - column.cross.dot(&solution.scaled);
        pull * pull / column.partial_variance
    }

    fn with_y(&self, column: &PartialColumn) -> f64 {
        column.unit.iter().zip(&self.y).map(|(a, b)| a * b).sum()
    }

    /// A whitened column and its products with a solution's terms; none where it does not show.
    pub(crate) fn partial(&self, solution: &Solution, white: &[f64]) -> Option<PartialColumn> {
        let (unit, scale) = normalised(self.counting(white.to_vec()));
        if unit.is_empty() {
            return None;
        }
        let dot = |other: &[f64]| unit.iter().zip(other).map(|(a, b)| a * b).sum::<f64>();
        let cross = DVector::from_iterator(
            solution.terms.len(),
            solution.terms.iter().map(|other| dot(&self.columns[*other])),
        );
        let explained = &solution.inverse * &cross;
        let partial_variance = 1.0 - cross.dot(&explained);
        (partial_variance >= LEAST_NEW_SHARE).then_some(PartialColumn {
            unit,
            scale,
            cross,
            explained,
            partial_variance,
        })
    }

    fn score_of(
        &self,
        solution: &Solution,
        term: usize,
        cross: &DVector<f64>,
        (own, with_y): (f64, f64),
        scale: f64,
    ) -> Option<Score> {
        let partial_variance = own - cross.dot(&(&solution.inverse * cross));
        if partial_variance < LEAST_NEW_SHARE {
            return None;
        }
        let pull = with_y - cross.dot(&solution.scaled);
        Some(Score {
            term,
            chi2_drop: pull * pull / partial_variance,
            value: pull / partial_variance / scale,
            std: 1.0 / partial_variance.sqrt() / scale,
        })
    }
}
