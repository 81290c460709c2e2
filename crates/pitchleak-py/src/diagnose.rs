use crate::errors::value_error;
use crate::rig::Rig;
use crate::source::Source;
use crate::threads::detached;
use pitchleak::diagnose::{Declared, Residual, Series, diagnose as engine_diagnose};
use pyo3::prelude::*;

/// What is left of each balance over time: name, time in s, residual in SI.
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
    Ok((json, text, saved, residuals(diagnosis.residual_before), residuals(diagnosis.residual)))
}

fn residuals(residual: Residual) -> Residuals {
    let Residual { chamber_a_m3s, chamber_b_m3s, force_n } = residual;
    let named = [("chamber_a_m3s", chamber_a_m3s), ("chamber_b_m3s", chamber_b_m3s), ("force_n", force_n)];
    named
        .into_iter()
        .map(|(name, points)| {
            let (t_s, left) = points.into_iter().unzip();
            (name, t_s, left)
        })
        .collect()
}
