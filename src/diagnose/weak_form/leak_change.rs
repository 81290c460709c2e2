//! Leaks that change along the traces: from a row on a leak is larger by the value of a term, or grows by it. The declared model has as many
//! of these as it takes.

use super::rows::{Row, Rows};
use super::terms::Term;
use pitchleak_core::Leak;

/// From which row on which leak is another. Rows stand trace after trace, so that traces may differ, too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LeakChange {
    pub(crate) leak: Leak,
    pub(crate) kind: ChangeKind,
    pub(crate) row: usize,
    /// The row's trace, and its time there, s.
    pub(crate) trace: usize,
    pub(crate) from_s: f64,
}

/// What a unit of a change is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChangeKind {
    /// m³/(s·Pa) more.
    Step,
    /// So much more in each second, to the trace's end, m³/(s·Pa)/s.
    Growth,
}

/// Rows before a step, and after it, whose test functions may hold some of both levels: those over the same samples, and one more as
/// it is found to the next row only.
const BESIDE: usize = 2;

impl LeakChange {
    /// Whether it cannot be told from another of its kind.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        (self.leak, self.kind) == (other.leak, other.kind) && self.row.abs_diff(other.row) <= 2 * BESIDE
    }

    /// By how much a unit of it changes the leak at a time of a trace.
    pub(crate) fn at(&self, trace: usize, t_s: f64) -> f64 {
        match self.kind {
            _ if trace < self.trace || trace == self.trace && t_s < self.from_s => 0.0,
            ChangeKind::Step => 1.0,
            ChangeKind::Growth if trace == self.trace => t_s - self.from_s,
            ChangeKind::Growth => 0.0,
        }
    }

    /// The same at a row.
    pub(crate) fn at_row(&self, row: &Row) -> f64 {
        self.at(row.trace(), row.t_s)
    }

    /// Whether a row may be of both levels.
    fn touches(&self, row: usize) -> bool {
        self.kind == ChangeKind::Step && (self.row.saturating_sub(BESIDE)..self.row + BESIDE).contains(&row)
    }
}

impl Rows {
    /// The columns of changes are made of those of their leaks. Rows that touch a step are of neither level.
    pub(super) fn add_leak_changes(&mut self, terms: &[Term]) {
        for (place, term) in terms.iter().enumerate() {
            let Term::LeakChange(change) = term else { continue };
            let leak = terms.iter().position(|other| *other == Term::of_leak(change.leak));
            let Some(own) = leak.and_then(|leak| self.columns.get(leak)) else { continue };
            let column = self.entries.iter().zip(own);
            let column = column.map(|(entry, leak)| change.at_row(&self.rows[entry.row]) * leak);
            self.columns[place] = column.collect();
            let touched = self.rows.iter_mut().enumerate().filter(|(row, _)| change.touches(*row));
            touched.for_each(|(_, row)| row.has_leak_change = true);
        }
    }
}
