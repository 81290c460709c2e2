use crate::errors::{trace_error, value_error};
use crate::rig::Rig;
use crate::signals::Stopped;
use crate::source::Source;
use pitchleak::replay::replay;
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
    evidence: Option<Source<'_>>,
) -> PyResult<(String, String)> {
    let leaks = LeaksThen::by_name(leaks)
        .ok_or_else(|| value_error(format!("leaks: `{leaks}` is neither zero nor unknown")))?;
    let told = |error: CalibrationError| match &error {
        CalibrationError::Trace(error) => trace_error(py, error),
        error => value_error(error),
    };
    let rig = rig.0.uncalibrated();
    let mut calibrator = Calibrator::new(&rig, leaks).map_err(told)?;
    if let Some(hold) = evidence {
        let report = hold
            .read(py, &rig, false, |mut reader| replay(&mut reader, &rig, |_, _, _| Ok::<_, Stopped>(())))?;
        calibrator.rest_on(&report).map_err(told)?;
    }
    for trace in traces {
        trace.read(py, &rig, false, |mut reader| Ok(calibrator.read(&mut reader)))?.map_err(told)?;
    }
    let found = calibrator.finish().map_err(told)?;
    Ok((found.to_toml().map_err(told)?, found.to_text(&Palette::PLAIN)))
}
