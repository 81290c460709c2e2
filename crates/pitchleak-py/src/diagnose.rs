use crate::errors::value_error;
use crate::rig::Rig;
use crate::source::Source;
use crate::threads::detached;
use pitchleak::diagnose::{Declared, Equation, PerEquation, Series, diagnose as engine_diagnose};
use pyo3::prelude::*;

/// What is left of each equation over time: name, time in s, residual in SI.
type Residuals = Vec<(&'static str, Vec<f64>, Vec<f64>)>;

/// Fits traces of one rig together; gives JSON, text, the rig with the effects found, and residuals before
/// and after.
#[pyfunction]
pub fn diagnose(
    py: Python<'_>,
    train: Vec<Source<'_>>,
    test: Vec<Source<'_>>,
    rig: &Rig,
    strict: bool,
) -> PyResult<(String, String, Rig, Residuals, Residuals)> {
    let read_all = |sources: &[Source<'_>]| -> PyResult<Vec<Series>> {
        let read = |source: &Source<'_>| {
            source.read(py, &rig.0, strict, |mut reader| Ok(Series::read(&mut reader)?))
        };
        sources.iter().map(read).collect()
    };
    let (train, test) = (read_all(&train)?, read_all(&test)?);
    let diagnosis = detached(py, || engine_diagnose(&train, &test, &Declared::of(&rig.0), &|| ()))?;
    let json = serde_json::to_string(&diagnosis).map_err(value_error)?;
    let saved = Rig(diagnosis.rig(&rig.0));
    let text = format!("rig {}\n{}", rig.0.name, diagnosis.to_text());
    Ok((
        json,
        text,
        saved,
        residuals(&diagnosis.before.residual_over_time),
        residuals(&diagnosis.after.residual_over_time),
    ))
}

fn residuals(over_time: &PerEquation<Vec<(f64, f64)>>) -> Residuals {
    let series = |(equation, points): (Equation, &Vec<(f64, f64)>)| {
        let (t_s, residual) = points.iter().copied().unzip();
        (equation.id_with_unit(), t_s, residual)
    };
    over_time.iter().map(series).collect()
}
