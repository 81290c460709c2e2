//! Whole traces: replay, its estimates over time, check.

use crate::errors::value_error;
use crate::rig::Rig;
use crate::signals::{Signals, Stop};
use crate::source::Source;
use numpy::{IntoPyArray, PyArray1};
use pitchleak::replay::EstimateRow;
use pitchleak_view::{Palette, Text};
use pyo3::prelude::*;

/// A report for programs (JSON) and for people.
pub type Report = (String, String);

/// Replays a trace.
#[pyfunction]
#[pyo3(signature = (source, rig, estimator, strict, stop = None))]
pub fn replay(
    py: Python<'_>,
    source: Source<'_>,
    rig: &Rig,
    estimator: Option<&str>,
    strict: bool,
    stop: Option<&Stop>,
) -> PyResult<Report> {
    let rig = rig.with_estimator(estimator)?;
    let mut signals = Signals::new(stop);
    let report = source.read(py, &rig, strict, |mut reader| {
        pitchleak::replay::replay(&mut reader, &rig, |_, _, _| signals.heed())
    })?;
    Ok((report.to_json().map_err(value_error)?, report.to_text(&Palette::PLAIN)))
}

/// Columns of estimates over time, as `replay --out` writes them.
type Columns<'py> = Vec<(&'static str, Bound<'py, PyArray1<f64>>)>;

/// Replays a trace again and keeps the estimates after each sample; the report's JSON comes with them.
#[pyfunction]
pub fn over_time<'py>(
    py: Python<'py>,
    source: Source<'py>,
    rig: &Rig,
    estimator: Option<&str>,
    strict: bool,
) -> PyResult<(String, Columns<'py>)> {
    let rig = rig.with_estimator(estimator)?;
    let mut columns: [Vec<f64>; EstimateRow::COLUMNS.len()] = std::array::from_fn(|_| Vec::new());
    let mut signals = Signals::new(None);
    let report = source.read(py, &rig, strict, |mut reader| {
        pitchleak::replay::replay(&mut reader, &rig, |replay, record, _| {
            for (column, value) in columns.iter_mut().zip(replay.estimate_row(record).values()) {
                column.push(value);
            }
            signals.heed()
        })
    })?;
    let columns =
        EstimateRow::COLUMNS.into_iter().zip(columns.map(|column| column.into_pyarray(py))).collect();
    Ok((report.to_json().map_err(value_error)?, columns))
}

/// Data quality, excitation, what a trace can and cannot identify.
#[pyfunction]
pub fn check(py: Python<'_>, source: Source<'_>, rig: &Rig, strict: bool) -> PyResult<Report> {
    let mut signals = Signals::new(None);
    let report = source.read(py, &rig.0, strict, |mut reader| {
        pitchleak::check::check(&mut reader, &rig.0, |_, _, _| signals.heed())
    })?;
    Ok((report.to_json().map_err(value_error)?, report.to_text(&Palette::PLAIN)))
}
