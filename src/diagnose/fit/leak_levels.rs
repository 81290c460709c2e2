//! The leaks of a fit, where they change along the traces.

use super::gauss_newton::Fit;
use crate::diagnose::equation::Equation;
use crate::diagnose::weak_form::Term;
use nalgebra::{Matrix3, Vector3};
use pitchleak_core::{Estimate, Leak};

/// A leak coefficient from a row on.
pub(crate) struct LeakLevel {
    pub(crate) from_row: usize,
    /// m³/(s·Pa).
    pub(crate) coefficient: Estimate<f64>,
}

/// What a row says of the leaks beside a fit: products of their whitened columns, and of these with what the fit leaves.
#[derive(Clone, Copy, Default)]
pub(crate) struct LeakProducts {
    pub(crate) gram: Matrix3<f64>,
    pub(crate) pull: Vector3<f64>,
}

impl Fit<'_> {
    /// By row. The leaks' columns are of length one over all rows.
    pub(crate) fn leak_products(&self) -> Vec<LeakProducts> {
        let rows = self.rows();
        let mut all = vec![LeakProducts::default(); rows.rows.len()];
        let places = Leak::ALL.map(|leak| self.problem.place(Term::of_leak(leak)));
        for equation in [Equation::ChamberA, Equation::ChamberB] {
            for (entry, left) in self.regression.innovations_by_entry(rows, &self.free, equation) {
                let column = |place: Option<usize>| {
                    place.and_then(|place| self.regression.columns[place].get(entry)).copied().unwrap_or(0.0)
                };
                let columns = Vector3::from(places.map(column));
                let own = &mut all[rows.entries[entry].row];
                own.gram += columns * columns.transpose();
                own.pull += columns * left;
            }
        }
        all
    }

    /// The sum of fitted terms, each times a factor.
    fn combination(&self, parts: &[(usize, f64)]) -> Estimate<f64> {
        let value =
            |(place, factor): &(usize, f64)| factor * self.estimate(*place).map_or(0.0, |own| own.value);
        let variance = self.regression.variance_of(&self.bounded, parts);
        Estimate { value: parts.iter().map(value).sum(), std: variance.max(0.0).sqrt() }
    }

    /// The levels of a leak, in order of time; one where it does not change.
    pub(crate) fn leak_levels(&self, leak: Leak) -> Vec<LeakLevel> {
        let changes = self.changes_of(leak);
        let from_rows = std::iter::once(0).chain(changes.iter().map(|(_, row)| *row));
        from_rows
            .enumerate()
            .map(|(count, from_row)| {
                let so_far = changes.iter().take(count).map(|(place, _)| (*place, 1.0));
                LeakLevel { from_row, coefficient: self.leak_with(leak, so_far) }
            })
            .collect()
    }

    /// A leak's mean coefficient over the traces.
    pub(crate) fn mean_leak(&self, leak: Leak) -> Estimate<f64> {
        let rows = self.rows().rows.len().max(1) as f64;
        let changes = self.changes_of(leak);
        self.leak_with(leak, changes.iter().map(|(place, row)| (*place, 1.0 - *row as f64 / rows)))
    }

    /// Places and rows of its changes.
    fn changes_of(&self, leak: Leak) -> Vec<(usize, usize)> {
        let terms = self.problem.terms.iter().enumerate();
        terms
            .filter_map(|(place, term)| match term {
                Term::LeakChange(change) if change.leak == leak => Some((place, change.row)),
                _ => None,
            })
            .collect()
    }

    /// The leak at its first level and shares of its changes.
    fn leak_with(&self, leak: Leak, changes: impl Iterator<Item = (usize, f64)>) -> Estimate<f64> {
        let first = self.problem.place(Term::of_leak(leak)).map(|place| (place, 1.0));
        let parts: Vec<(usize, f64)> = first.into_iter().chain(changes).collect();
        self.combination(&parts)
    }
}
