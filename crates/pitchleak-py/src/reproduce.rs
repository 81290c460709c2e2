use crate::errors::{output_error, value_error};
use crate::signals::detached;
use pitchleak::output::make_folder;
use pitchleak_reproduce::{Progress, ReproduceError, reproduce as engine_reproduce};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Reruns the paper's experiment; writes its figures and tables into a directory where one is given. `progress` is
/// called with the pieces done and their number, stage by stage. Gives the report's JSON, its text, and the page.
#[pyfunction]
#[pyo3(signature = (seeds, out, progress = None))]
pub fn reproduce(
    py: Python<'_>,
    seeds: u64,
    out: Option<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, String, String)> {
    if let Some(directory) = &out {
        make_folder(directory).map_err(|error| output_error(py, &error))?;
    }
    let done = detached(py, progress, move |caller| {
        engine_reproduce(seeds, |Progress { done, count, .. }| caller.at(done as f64, count as f64))
    })?;
    let done = done.map_err(value_error)?;
    let page = py.detach(|| {
        out.map(|directory| done.write(&directory)).transpose()?;
        pitchleak_reproduce::page(&done)
    });
    let page = page.map_err(|error| match error {
        ReproduceError::Output(error) => output_error(py, &error),
        error => value_error(error),
    })?;
    Ok((done.report.to_json().map_err(value_error)?, done.report.to_text(), page.to_html()))
}
