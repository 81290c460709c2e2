//! Many traces: which there are, one judged, all as a table.

use crate::errors::{output_error, rig_error, value_error};
use crate::rig::Rig;
use crate::signals::{Signals, Stop, Stopped};
use crate::table::{NOT_A_TIME, Source};
use numpy::PyArray1;
use pitchleak::fleet::{
    FleetColumn, FleetError, FleetFile, FleetNights as Nights, FleetOdds, FleetReport, FleetRig,
    FleetRow as Row, FleetTable, FleetTrace, TraceIdentity, judge_opened,
};
use pitchleak::output::Inputs;
use pitchleak_view::page::Page;
use pitchleak_view::{Palette, Text};
use pyo3::exceptions::{PyFileNotFoundError, PyIsADirectoryError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::ffi::OsString;
use std::path::PathBuf;

/// What is known of a cylinder from one trace; what Python makes of it is in `python/pitchleak/_fleet.py`.
#[pyclass(frozen, eq, module = "pitchleak._pitchleak")]
#[derive(Clone, PartialEq)]
pub struct FleetRow(Row);

#[pymethods]
impl FleetRow {
    /// A trace that could not be judged.
    #[staticmethod]
    fn failed(cylinder: String, begins: Option<&str>, path: String, error: String) -> PyResult<Self> {
        Ok(Self(Row::failed(&identity(cylinder, begins)?, path, error)))
    }

    /// The row that pickle took apart.
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        Row::from_bytes(bytes).map(Self).map_err(value_error)
    }

    /// Why the trace could not be judged; None where it was.
    #[getter]
    fn error(&self) -> Option<&str> {
        self.0.error.as_deref()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = slf.get().0.to_bytes().map_err(value_error)?;
        Ok((slf.get_type().getattr("from_bytes")?, (PyBytes::new(slf.py(), &bytes),)))
    }
}

/// Path, cylinder, begin and rig file (None: the built-in rig) of each trace that paths and patterns name.
type Found = Vec<(OsString, String, Option<String>, Option<OsString>)>;

/// The traces that there are, and a sentence for each file that is judged as another of them. `rigs` is a rig file for all
/// or a table of them.
#[pyfunction]
pub fn fleet_traces(
    py: Python<'_>,
    patterns: Vec<String>,
    rigs: Option<PathBuf>,
) -> PyResult<(Found, Vec<String>)> {
    let found = py.detach(|| FleetTrace::find(&patterns, &FleetRig::from_file(rigs)));
    let found = found.map_err(|error| fleet_error(py, &error))?;
    let doubles = FleetTrace::doubles(&found).collect();
    let one = |FleetTrace { path, identity, rig_file, .. }| {
        let TraceIdentity { cylinder, begins } = identity;
        let begins = begins.map(|begins| begins.to_string());
        (path.into_os_string(), cylinder, begins, rig_file.map(PathBuf::into_os_string))
    };
    Ok((found.into_iter().map(one).collect(), doubles))
}

/// Judges one trace. A trace that can't be read is a row too.
#[pyfunction]
#[pyo3(signature = (source, cylinder, begins, rig, stop = None))]
pub fn fleet_row(
    py: Python<'_>,
    source: Source<'_>,
    cylinder: String,
    begins: Option<&str>,
    rig: &Rig,
    stop: Option<&Stop>,
) -> PyResult<FleetRow> {
    let (name, identity) = (source.name(), identity(cylinder, begins)?);
    let mut signals = Signals::new(stop);
    source.read_again(py, &rig.0, false, |open| {
        let opened = match open() {
            Err(Stopped::Failed(error)) => Err(error),
            opened => Ok(opened?),
        };
        let mut asked = None;
        let go_on = || signals.heed().map_err(|stopped| asked = stopped.asked()).is_ok();
        let judged = judge_opened(&name, &identity, &rig.0, opened, go_on);
        judged.map(FleetRow).map_err(|_| Stopped::Asked(asked.unwrap_or_else(Stopped::interrupted)))
    })
}

/// The table of all nights so far in a folder.
#[pyclass(module = "pitchleak._pitchleak")]
pub struct FleetNights(Option<Nights>);

#[pymethods]
impl FleetNights {
    #[new]
    fn new(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let nights = py.detach(|| Nights::open(&folder));
        Ok(Self(Some(nights.map_err(|error| fleet_error(py, &error))?)))
    }

    /// What `add` is to be told of a trace that is new or changed; None where a night has judged it.
    fn new_as(&self, trace: PathBuf, rig: Option<&Rig>) -> Option<String> {
        self.0.as_ref()?.new_as(&trace, rig.map(|rig| &rig.0))
    }

    /// Writes this night's rows, once, and gives those of all nights.
    fn add(
        &mut self,
        py: Python<'_>,
        seen: Vec<String>,
        rows: Vec<PyRef<'_, FleetRow>>,
    ) -> PyResult<Vec<FleetRow>> {
        let rows = cloned(&rows);
        let Some(nights) = self.0.take() else { return Ok(Vec::new()) };
        let all = py.detach(|| nights.add(seen, rows)).map_err(|error| fleet_error(py, &error))?;
        Ok(all.into_iter().map(FleetRow).collect())
    }
}

/// Rows as columns: header, kind (`numbers`, `texts`, `times`, `counts`, `flags`), values. Numbers are an array with NaN for
/// none, times an array of milliseconds since 1970 with the least integer for none, as numpy has it.
#[pyfunction]
pub fn fleet_table<'py>(
    py: Python<'py>,
    rows: Vec<PyRef<'py, FleetRow>>,
) -> PyResult<Vec<(String, &'static str, Bound<'py, PyAny>)>> {
    let table = FleetTable::of(&cloned(&rows));
    let column = |(name, column): &(String, FleetColumn)| {
        let (kind, values) = match column {
            FleetColumn::Texts(values) => ("texts", values.into_pyobject(py)?.into_any()),
            FleetColumn::Times(values) => {
                let milliseconds = values.iter().map(|time| time.map_or(NOT_A_TIME, |t| t.as_millisecond()));
                ("times", PyArray1::from_iter(py, milliseconds).into_any())
            }
            FleetColumn::Numbers(values) => {
                let numbers = values.iter().map(|number| number.unwrap_or(f64::NAN));
                ("numbers", PyArray1::from_iter(py, numbers).into_any())
            }
            FleetColumn::Counts(values) => ("counts", values.into_pyobject(py)?.into_any()),
            FleetColumn::Flags(values) => ("flags", values.into_pyobject(py)?.into_any()),
        };
        Ok((name.clone(), kind, values))
    };
    table.columns().iter().map(column).collect()
}

/// How often each explanation is true in the fleet: as JSON, and as lines of a rig file.
#[pyfunction]
pub fn fleet_odds(rows: Vec<PyRef<'_, FleetRow>>) -> PyResult<(String, Option<String>)> {
    let odds = FleetOdds::learn(&cloned(&rows));
    Ok((serde_json::to_string(&odds).map_err(value_error)?, odds.to_toml()))
}

/// Counts, cylinders, trends and rows as JSON.
#[pyfunction]
pub fn fleet_json(rows: Vec<PyRef<'_, FleetRow>>) -> PyResult<String> {
    FleetReport::of(&cloned(&rows)).to_json().map_err(value_error)
}

/// Counts, and the worst first, for people.
#[pyfunction]
pub fn fleet_text(rows: Vec<PyRef<'_, FleetRow>>) -> String {
    FleetReport::of(&cloned(&rows)).to_text(&Palette::PLAIN)
}

/// The page for a browser.
#[pyfunction]
pub fn fleet_page(rows: Vec<PyRef<'_, FleetRow>>) -> String {
    Page::of_fleet(&FleetReport::of(&cloned(&rows))).to_html()
}

/// Writes the table into a file.
#[pyfunction]
pub fn fleet_save(py: Python<'_>, rows: Vec<PyRef<'_, FleetRow>>, path: PathBuf) -> PyResult<()> {
    let table = FleetTable::of(&cloned(&rows));
    let written = py.detach(|| FleetFile::create(&path, &Inputs::default())?.write(&table));
    written.map_err(|error| fleet_error(py, &error))
}

fn cloned(rows: &[PyRef<'_, FleetRow>]) -> Vec<Row> {
    rows.iter().map(|row| row.0.clone()).collect()
}

fn identity(cylinder: String, begins: Option<&str>) -> PyResult<TraceIdentity> {
    let begins = begins.map(str::parse).transpose().map_err(value_error)?;
    Ok(TraceIdentity { cylinder, begins })
}

fn fleet_error(py: Python<'_>, error: &FleetError) -> PyErr {
    match error {
        FleetError::NoTrace(_) => PyFileNotFoundError::new_err(error.to_string()),
        FleetError::Folder(_) => PyIsADirectoryError::new_err(error.to_string()),
        FleetError::Rig(error) => rig_error(py, error),
        FleetError::Output(error) => output_error(py, error),
        _ => value_error(error),
    }
}
