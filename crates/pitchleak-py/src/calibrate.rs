use crate::errors::{trace_error, value_error};
use crate::rig::Rig;
use crate::source::Source;
use pitchleak::valve::{CalibrationError, Calibrator, LeaksThen};
use pitchleak_view::{Palette, Text};
use pyo3::prelude::*;

/// Learns the valve of a rig from traces of it; gives the file's text, and the text for people.
#[pyfunction]
pub fn calibrate(
    py: Python<'_>,
    traces: Vec<Source<'_>>,
    rig: &Rig,
    leaks: &str,
    evidence: Option<String>,
) -> PyResult<(String, String)> {
    let leaks = match leaks {
        "zero" => LeaksThen::Zero,
        "unknown" => LeaksThen::Unknown,
        other => return Err(value_error(format!("leaks: `{other}` is neither zero nor unknown"))),
    };
    let told = |error: CalibrationError| match &error {
        CalibrationError::Trace(error) => trace_error(py, error),
        error => value_error(error),
    };
    let mut calibrator = Calibrator::new(&rig.0, leaks).map_err(told)?;
    for trace in traces {
        trace.read(py, &rig.0, false, |mut reader| Ok(calibrator.read(&mut reader)))?.map_err(told)?;
    }
    let found = calibrator.finish(evidence).map_err(told)?;
    Ok((found.to_toml().map_err(told)?, found.to_text(&Palette::PLAIN)))
}
