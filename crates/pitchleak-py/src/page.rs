//! Reports as pages for a browser.

use crate::errors::{output_error, value_error};
use crate::rig::Rig;
use crate::signals::Signals;
use crate::source::Source;
use pitchleak::output::Inputs;
use pitchleak_view::page::{History, Page, PageError, PageFile};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Replays a trace again and makes the page of it; the report's JSON comes first.
#[pyfunction]
pub fn replay_page(
    py: Python<'_>,
    source: Source<'_>,
    rig: &Rig,
    estimator: Option<&str>,
    strict: bool,
) -> PyResult<(String, String)> {
    let rig = rig.with_estimator(estimator)?;
    let mut signals = Signals::new(None);
    let (report, html) = source.read(py, &rig, strict, |mut reader| {
        let mut history = History::default();
        let report = pitchleak::replay::replay(&mut reader, &rig, |replay, record, renewed| {
            history.add(replay, record, renewed);
            signals.heed()
        })?;
        let html = Page::of_replay(&report, &rig, &history).to_html();
        Ok((report, html))
    })?;
    Ok((report.to_json().map_err(value_error)?, html))
}

/// Checks a trace again and makes the page of it; the report's JSON comes first.
#[pyfunction]
pub fn check_page(py: Python<'_>, source: Source<'_>, rig: &Rig, strict: bool) -> PyResult<(String, String)> {
    let mut signals = Signals::new(None);
    let (report, html) = source.read(py, &rig.0, strict, |mut reader| {
        let mut history = History::default();
        let report = pitchleak::check::check(&mut reader, &rig.0, |replay, record, renewed| {
            history.add(replay, record, renewed);
            signals.heed()
        })?;
        let html = Page::of_check(&report, &rig.0, &history).to_html();
        Ok((report, html))
    })?;
    Ok((report.to_json().map_err(value_error)?, html))
}

/// Writes a page to `path`, whole or not at all, and never over one of `inputs`.
#[pyfunction]
pub fn write_page(py: Python<'_>, path: PathBuf, html: &str, inputs: Vec<PathBuf>) -> PyResult<()> {
    let written = py.detach(|| PageFile::create(path, &Inputs::of(inputs))?.finish_html(html));
    written.map_err(|error| match error {
        PageError::Output(error) => output_error(py, &error),
        error @ PageError::Kind(_) => value_error(error),
    })
}
