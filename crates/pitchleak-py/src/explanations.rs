//! What a verdict weighs.

use pyo3::prelude::*;

/// Id, kind, prior share within its kind, what it says, what to do, and ids that no trace tells it from.
type Entry = (&'static str, &'static str, f64, &'static str, &'static str, Vec<&'static str>);

/// Every explanation.
#[pyfunction]
pub fn explanations() -> Vec<Entry> {
    let entry = |entry: &pitchleak::explain::Entry| {
        (entry.id, entry.kind.name(), entry.share, entry.text, entry.remedy, entry.alike.to_vec())
    };
    pitchleak::explain::explanations().iter().map(entry).collect()
}
