use crate::errors::value_error;
use crate::rig::Rig;
use crate::signals::{Signals, detached};
use crate::table::Source;
use pitchleak::diagnose::{
    Declared, Equation, PerEquation, Roles, Series, Traces, diagnose as engine_diagnose,
};
use pitchleak_view::page::Page;
use pitchleak_view::{Palette, Text};
use pyo3::prelude::*;
use std::cell::Cell;
use std::path::PathBuf;

/// What is left of each equation over time: name, time in s, residual in SI.
type Residuals = Vec<(&'static str, Vec<f64>, Vec<f64>)>;

/// JSON, text, page, the rig with the effects found, residuals before and after, and warnings.
type Found = (String, String, String, Rig, Residuals, Residuals, Vec<String>);

/// Fits traces of one rig together. `progress` is called with the fits done and NaN.
#[pyfunction]
#[pyo3(signature = (train, test, rig, strict, progress = None))]
pub fn diagnose(
    py: Python<'_>,
    train: Vec<Source<'_>>,
    test: Vec<Source<'_>>,
    rig: &Rig,
    strict: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Found> {
    let roles = Roles::of(&paths(&train), &paths(&test)).map_err(value_error)?;
    let names: Vec<String> = train.iter().chain(&test).map(Source::name).collect();
    let read_all = |sources: &[Source<'_>], once: &[PathBuf]| -> PyResult<Vec<Series>> {
        let (mut traces, mut once) = (Traces::default(), once.iter().peekable());
        for source in sources {
            if let Source::Path(path) = source
                && once.next_if_eq(&path).is_none()
            {
                continue;
            }
            let mut signals = Signals::new(None);
            source
                .read(py, &rig.0, strict, |mut reader| traces.read(&mut reader, &rig.0, || signals.heed()))?;
        }
        Ok(traces.into_series())
    };
    let (train, test) = (read_all(&train, &roles.fitted)?, read_all(&test, &roles.judged)?);
    let declared = Declared::of(&rig.0);
    let diagnosis = detached(py, progress, move |caller| {
        let fits = Cell::new(0.0);
        engine_diagnose(&train, &test, &declared, &|| {
            fits.set(fits.get() + 1.0);
            // How many there will be, nobody knows.
            caller.at(fits.get(), f64::NAN);
        })
    })?;
    let json = serde_json::to_string(&diagnosis).map_err(value_error)?;
    let saved = Rig(diagnosis.rig(&rig.0));
    let text = format!("rig {}\n{}", rig.0.name, diagnosis.to_text(&Palette::PLAIN));
    let page = Page::of_diagnosis(&diagnosis, &rig.0, &names).to_html();
    Ok((
        json,
        text,
        page,
        saved,
        residuals(&diagnosis.before.residual_over_time),
        residuals(&diagnosis.after.residual_over_time),
        roles.repeated.iter().map(ToString::to_string).collect(),
    ))
}

fn paths(sources: &[Source<'_>]) -> Vec<PathBuf> {
    let path = |source: &Source<'_>| if let Source::Path(path) = source { Some(path.clone()) } else { None };
    sources.iter().filter_map(path).collect()
}

fn residuals(over_time: &PerEquation<Vec<(f64, f64)>>) -> Residuals {
    let series = |(equation, points): (Equation, &Vec<(f64, f64)>)| {
        let (t_s, residual) = points.iter().copied().unzip();
        (equation.id_with_unit(), t_s, residual)
    };
    over_time.iter().map(series).collect()
}
