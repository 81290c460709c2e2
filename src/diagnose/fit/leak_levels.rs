//! The leaks of a fit, where they change along the traces.

use super::gauss_newton::Fit;
use crate::diagnose::equation::Equation;
use crate::diagnose::weak_form::{LeakChange, Term};
use nalgebra::{Matrix6, Vector6};
use pitchleak_core::{Estimate, Leak};

/// What a row says of leaks that grow, beside a fit: products of their whitened columns (the three leaks, and these times the time), and of
/// these with what the fit leaves.
#[derive(Clone, Copy, Default)]
pub(crate) struct LeakProducts {
    pub(crate) gram: Matrix6<f64>,
    pub(crate) pull: Vector6<f64>,
}

impl Fit<'_> {
    /// By row. The leaks' columns are of length one over all rows, the time runs from 0 to 1 over them.
    pub(crate) fn leak_products(&self) -> Vec<LeakProducts> {
        let rows = self.rows();
        let mut all = vec![LeakProducts::default(); rows.rows.len()];
        let places = Leak::ALL.map(|leak| self.problem.place(Term::of_leak(leak)));
        for equation in [Equation::ChamberA, Equation::ChamberB] {
            for (entry, left) in self.regression.innovations_by_entry(rows, &self.free, equation) {
                let row = rows.entries[entry].row;
                let column = |place: Option<usize>| {
                    place.and_then(|place| self.regression.columns[place].get(entry)).copied().unwrap_or(0.0)
                };
                let [internal, a, b] = places.map(column);
                let time = row as f64 / rows.rows.len() as f64;
                let columns = Vector6::new(internal, a, b, time * internal, time * a, time * b);
                all[row].gram += columns * columns.transpose();
                all[row].pull += columns * left;
            }
        }
        all
    }

    /// The rows at which a leak changes, in order.
    pub(crate) fn rows_of_change(&self, leak: Leak) -> Vec<usize> {
        let mut rows: Vec<usize> = self.changes_of(leak).map(|(_, change)| change.row).collect();
        rows.sort_unstable();
        rows.dedup();
        rows
    }

    /// A leak's coefficient at a row.
    pub(crate) fn leak_at(&self, leak: Leak, row: usize) -> Estimate<f64> {
        let at = self.rows().rows.get(row);
        self.leak_with(leak, |change| at.map_or(0.0, |row| change.at_row(row)))
    }

    /// A leak's mean coefficient over the traces.
    pub(crate) fn mean_leak(&self, leak: Leak) -> Estimate<f64> {
        let rows = &self.rows().rows;
        self.leak_with(leak, |change| {
            rows.iter().map(|row| change.at_row(row)).sum::<f64>() / rows.len().max(1) as f64
        })
    }

    /// The leak at its begin and so much of each of its changes.
    fn leak_with(&self, leak: Leak, share: impl Fn(&LeakChange) -> f64) -> Estimate<f64> {
        let first = self.problem.place(Term::of_leak(leak)).map(|place| (place, 1.0));
        let changes = self.changes_of(leak).map(|(place, change)| (place, share(&change)));
        let parts: Vec<(usize, f64)> = first.into_iter().chain(changes).collect();
        let value =
            |(place, factor): &(usize, f64)| factor * self.estimate(*place).map_or(0.0, |own| own.value);
        let variance = self.regression.variance_of(&self.bounded, &parts);
        Estimate { value: parts.iter().map(value).sum(), std: variance.max(0.0).sqrt() }
    }

    /// The changes that are fitted, with their places.
    pub(crate) fn leak_changes(&self) -> impl Iterator<Item = (usize, LeakChange)> {
        self.problem.leak_changes().filter(|(place, _)| self.active().contains(place))
    }

    /// How many traces there are.
    pub(crate) fn traces(&self) -> usize {
        self.rows().rows.last().map_or(0, |row| row.trace() + 1)
    }

    /// Whether a leak changes along the traces.
    pub(crate) fn has_leak_changes(&self) -> bool {
        self.leak_changes().next().is_some()
    }

    fn changes_of(&self, leak: Leak) -> impl Iterator<Item = (usize, LeakChange)> {
        self.leak_changes().filter(move |(_, change)| change.leak == leak)
    }
}
