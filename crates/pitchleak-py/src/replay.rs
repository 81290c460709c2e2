//! Whole traces: replay, its estimates over time, check, proof, calibration, diagnosis, and their pages; what a verdict weighs.

use crate::errors::{output_error, trace_error, value_error};
use crate::rig::Rig;
use crate::signals::{Signals, Stop, Stopped, detached};
use crate::simulate::Quantity;
use crate::table::Source;
use numpy::{IntoPyArray, PyArray1};
use pitchleak::core::{Leak, PerLeak};
use pitchleak::diagnose::{
    Declared, Equation, PerEquation, Roles, Series, Traces, diagnose as engine_diagnose,
};
use pitchleak::output::Inputs;
use pitchleak::prove::ProveError;
use pitchleak::replay::EstimateRow;
use pitchleak::units::{Dimension, LPM_PER_M3S};
use pitchleak::valve::{CalibrationError, Calibrator, LeaksThen};
use pitchleak_view::page::{History, Page, PageError, PageFile};
use pitchleak_view::{Palette, Text};
use pyo3::prelude::*;
use std::cell::{Cell, RefCell};
use std::path::PathBuf;

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

/// Mean flows to put in, of each leak; of usual sizes where there is none at all.
type Sizes = [Vec<Quantity>; 3];

/// Puts leaks into a trace, one at a time; gives JSON, the text for people and the page.
#[pyfunction]
pub fn prove(
    py: Python<'_>,
    source: Source<'_>,
    rig: &Rig,
    strict: bool,
    sizes: Sizes,
) -> PyResult<(String, String, String)> {
    let sizes_lpm = in_lpm(&sizes)?;
    let proof = source.read_again(py, &rig.0, strict, |open| {
        let signals = RefCell::new(Signals::new(None));
        let heeded = || signals.borrow_mut().heed_now().and_then(|()| open());
        pitchleak::prove::prove(heeded, &rig.0, &sizes_lpm, || ())
    })?;
    let html = Page::of_proof(&proof, &rig.0).to_html();
    Ok((proof.to_json().map_err(value_error)?, proof.to_text(&Palette::PLAIN), html))
}

fn in_lpm([internal, external_a, external_b]: &Sizes) -> PyResult<PerLeak<Vec<f64>>> {
    let of = |leak: Leak, sizes: &[Quantity]| {
        let name = format!("leak_{}", leak.id());
        let lpm = |size: &Quantity| match size.si(&name, Dimension::Flow)? {
            0.0 => Err(value_error(format!("{name}: a leak that is put in is more than none"))),
            m3s => Ok(m3s * LPM_PER_M3S),
        };
        sizes.iter().map(lpm).collect::<PyResult<Vec<f64>>>()
    };
    Ok(PerLeak {
        internal: of(Leak::Internal, internal)?,
        external_a: of(Leak::ExternalA, external_a)?,
        external_b: of(Leak::ExternalB, external_b)?,
    })
}

impl From<ProveError> for Stopped {
    fn from(error: ProveError) -> Self {
        match error {
            ProveError::Replay(error) => Self::Failed(error),
            error => Self::Asked(value_error(error)),
        }
    }
}

/// Learns the valve of a rig from traces of it; gives the file's text, and the text for people.
#[pyfunction]
pub fn calibrate(
    py: Python<'_>,
    traces: Vec<Source<'_>>,
    rig: &Rig,
    leaks: &str,
    evidence: Option<Source<'_>>,
) -> PyResult<(String, String, Vec<String>)> {
    let leaks = LeaksThen::by_name(leaks)
        .ok_or_else(|| value_error(format!("leaks: `{leaks}` is neither zero nor unknown")))?;
    let told = |error: CalibrationError| match &error {
        CalibrationError::Trace(error) => trace_error(py, error),
        error => value_error(error),
    };
    let rig = rig.0.uncalibrated();
    let mut calibrator = Calibrator::new(&rig, leaks).map_err(told)?;
    let mut warnings = Vec::new();
    if let Some(hold) = evidence {
        let report = hold.read(py, &rig, false, |mut reader| {
            pitchleak::replay::replay(&mut reader, &rig, |_, _, _| Ok::<_, Stopped>(()))
        })?;
        match calibrator.rest_on(&report) {
            Err(aside @ CalibrationError::UnknownInSpiteOfEvidence) => warnings.push(aside.to_string()),
            rests => rests.map_err(told)?,
        }
    }
    let roles = Roles::of(&paths(&traces), &[]).map_err(value_error)?;
    warnings.extend(roles.repeated.iter().map(ToString::to_string));
    for trace in each_once(&traces, &roles.fitted) {
        trace.read(py, &rig, false, |mut reader| Ok(calibrator.read(&mut reader)))?.map_err(told)?;
    }
    let found = calibrator.finish().map_err(told)?;
    Ok((found.to_toml().map_err(told)?, found.to_text(&Palette::PLAIN), warnings))
}

/// Id, kind, prior share within its kind, what it says, what to do, and ids that no trace tells it from.
type Entry = (&'static str, &'static str, f64, &'static str, &'static str, Vec<&'static str>);

/// Every explanation.
#[pyfunction]
pub fn explanations() -> Vec<Entry> {
    let entry = |entry: &pitchleak::explain::Entry| {
        (entry.id, entry.kind.name(), entry.share, entry.text, entry.remedy, entry.alike.to_vec())
    };
    pitchleak::explain::explanations().iter().map(entry).collect()
}

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
        let mut traces = Traces::default();
        for source in each_once(sources, once) {
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

/// The sources without paths that were given before.
fn each_once<'s, 'py>(
    sources: &'s [Source<'py>],
    once: &'s [PathBuf],
) -> impl Iterator<Item = &'s Source<'py>> {
    let mut once = once.iter().peekable();
    sources.iter().filter(move |source| match source {
        Source::Path(path) => once.next_if_eq(&path).is_some(),
        Source::Table(_) => true,
    })
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
