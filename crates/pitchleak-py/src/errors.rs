//! The engine's errors as Python exceptions.

use pitchleak::output::OutputError;
use pitchleak::replay::ReplayError;
use pitchleak::rig::RigError as EngineRigError;
use pitchleak::trace::{BadRow, Counted, TraceError as EngineTraceError, TraceFault};
use pyo3::create_exception;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

create_exception!(
    pitchleak,
    TraceError,
    PyValueError,
    "A trace that cannot be used. Where one cell is to blame, ``column`` is its header and ``row`` its row in \
     the columns given, from 0 (of a file: ``line``, from 1); else they are None."
);
create_exception!(
    pitchleak,
    RigError,
    PyValueError,
    "A rig file with a mistake: file, line, key, what is allowed."
);

pub fn trace_error(py: Python<'_>, error: &EngineTraceError) -> PyErr {
    if let TraceFault::Open(source) = &error.fault {
        return file_error(py, &error.trace, source);
    }
    let (column, row, line) = match &error.fault {
        TraceFault::BadRow(bad) => place(bad),
        TraceFault::NoRows { first: Some(bad), .. } => place(bad),
        TraceFault::UnknownUnit { column, .. } | TraceFault::Length { column, .. } => {
            (Some(column), None, None)
        }
        _ => (None, None, None),
    };
    placed(py, error.to_string(), column, row, line)
}

/// Rows that are not in the order of time; `row` is the first that goes back.
pub fn out_of_order(py: Python<'_>, column: &String, row: usize, how_often: &str) -> PyErr {
    let text = format!(
        "rows are in no order of time: column `{column}` goes back {how_often}, first at row {row}; sort them by it \
         (rows of several cylinders: also name the column that tells them apart, as `group`)"
    );
    placed(py, text, Some(column), Some(row as u64), None)
}

fn placed(
    py: Python<'_>,
    text: String,
    column: Option<&String>,
    row: Option<u64>,
    line: Option<u64>,
) -> PyErr {
    let raised = TraceError::new_err(text);
    let value = raised.value(py);
    let set = value.setattr("column", column).and_then(|()| value.setattr("row", row));
    match set.and_then(|()| value.setattr("line", line)) {
        Ok(()) => raised,
        Err(failure) => failure,
    }
}

pub fn replay_error(py: Python<'_>, error: &ReplayError) -> PyErr {
    match error {
        ReplayError::Trace(error) => trace_error(py, error),
        ReplayError::Rig(_) | ReplayError::Valve(_) => value_error(error),
    }
}

fn place(bad: &BadRow) -> (Option<&String>, Option<u64>, Option<u64>) {
    match bad.counted {
        Counted::Rows => (bad.column.as_ref(), Some(bad.line), None),
        Counted::Lines => (bad.column.as_ref(), None, Some(bad.line)),
    }
}

pub fn rig_error(py: Python<'_>, error: &EngineRigError) -> PyErr {
    match error {
        EngineRigError::Read { file, source } => file_error(py, file, source),
        EngineRigError::Content { .. } => RigError::new_err(error.to_string()),
    }
}

/// `FileNotFoundError`, `PermissionError`, … with number and file name, as Python's own `open` raises it.
pub fn file_error(py: Python<'_>, file: &str, source: &std::io::Error) -> PyErr {
    let Some(number) = source.raw_os_error() else {
        return PyOSError::new_err(format!("{file}: {source}"));
    };
    let text = py.import("os").and_then(|os| os.call_method1("strerror", (number,)));
    match text {
        Ok(text) => PyOSError::new_err((number, text.unbind(), file.to_owned())),
        Err(failure) => failure,
    }
}

/// An output over an input is a `ValueError`.
pub fn output_error(py: Python<'_>, error: &OutputError) -> PyErr {
    match error {
        OutputError::OverInput { .. } => value_error(error),
        OutputError::Write { path, source } => file_error(py, &path.display().to_string(), source),
    }
}

/// A `ValueError` with the error's own words.
pub fn value_error(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}
