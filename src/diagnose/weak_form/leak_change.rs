//! A leak that changes along the traces: from a row on it is larger by the value of its term. The declared model has as many as it takes.

use super::rows::Rows;
use super::terms::Term;
use pitchleak_core::Leak;

/// From which row on which leak is another. Rows stand trace after trace, so that traces may differ, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LeakChange {
    pub(crate) leak: Leak,
    pub(crate) row: usize,
}

/// Rows before a change, and after it, whose test functions may hold some of both levels: those over the same samples, and one more as
/// the change is found to the next row only.
const BESIDE: usize = 2;

impl LeakChange {
    /// Whether two are of one leak and so near that no row lies between.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        self.leak == other.leak && self.row.abs_diff(other.row) <= 2 * BESIDE
    }

    /// Whether a row may be of both levels.
    fn touches(&self, row: usize) -> bool {
        (self.row.saturating_sub(BESIDE)..self.row + BESIDE).contains(&row)
    }
}

impl Rows {
    /// The columns of changes are those of their leaks from there on. Rows that touch one are of neither level.
    pub(super) fn add_leak_changes(&mut self, terms: &[Term]) {
        for (place, term) in terms.iter().enumerate() {
            let Term::LeakChange(change) = term else { continue };
            let leak = terms.iter().position(|other| *other == Term::of_leak(change.leak));
            let Some(own) = leak.and_then(|leak| self.columns.get(leak)) else { continue };
            let later = self.entries.iter().zip(own);
            let column = later.map(|(entry, value)| if entry.row >= change.row { *value } else { 0.0 });
            self.columns[place] = column.collect();
            let touched = self.rows.iter_mut().enumerate().filter(|(row, _)| change.touches(*row));
            touched.for_each(|(_, row)| row.has_leak_change = true);
        }
    }
}
