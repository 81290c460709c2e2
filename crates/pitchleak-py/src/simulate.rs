//! Simulated traces, and the paper's experiment on them.

use crate::errors::{output_error, value_error};
use crate::rig::Rig;
use crate::signals::{Signals, Stopped, detached};
use numpy::{IntoPyArray, PyArray1};
use pitchleak::core::PerLeak;
use pitchleak::output::make_folder;
use pitchleak::simulate::{EffectSize, Followed, LeakCourse, Plan, RecordingError, share_of_full_scale};
use pitchleak::units::{self, Dimension};
use pitchleak::wind::{Emulation, Wind};
use pitchleak_reproduce::{Progress, ReproduceError, reproduce as engine_reproduce};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::str::FromStr;

/// A number in SI, or a quantity with its unit.
#[derive(FromPyObject)]
pub enum Quantity {
    Si(f64),
    Text(String),
}

impl Quantity {
    pub fn si(&self, name: &str, dimension: Dimension) -> PyResult<f64> {
        let value = match self {
            Self::Si(value) => Ok(*value),
            Self::Text(text) => units::parse(text, dimension),
        };
        let value = value.map_err(|error| value_error(format!("{name}: {error}")))?;
        if value >= 0.0 { Ok(value) } else { Err(value_error(format!("{name}: must not be negative"))) }
    }

    /// As text that the engine's own parsers read; Rust writes floats so that they read back the same.
    fn text(&self) -> String {
        match self {
            Self::Si(value) => value.to_string(),
            Self::Text(text) => text.clone(),
        }
    }

    fn parsed<T: FromStr<Err: Display>>(&self, name: &str) -> PyResult<T> {
        parsed(name, &self.text())
    }
}

/// What is to be simulated, as the Python function `simulate` takes it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Order {
    wind: Option<String>,
    position: Option<Quantity>,
    load: Option<Quantity>,
    leak_internal: Quantity,
    leak_external_a: Quantity,
    leak_external_b: Quantity,
    onset: Quantity,
    oil_temp: Option<Quantity>,
    shut: Option<String>,
    valve: Vec<String>,
    effects: BTreeMap<String, f64>,
    noise: Quantity,
    bias: Quantity,
    faults: Vec<String>,
    seed: u64,
    duration: Option<Quantity>,
    start: Option<Quantity>,
    sample_rate: Quantity,
    load_scale: Option<f64>,
    position_scale: Option<f64>,
    blade_inertia: Option<f64>,
}

/// Header and values of each column.
type Arrays<'py> = Vec<(&'static str, Bound<'py, PyArray1<f64>>)>;

/// Simulates a rig; gives the truth as JSON, warnings, and the columns of the trace, or none where it is
/// written to `out`. `progress` is called with the share that is done and 1, now and then and at the end.
#[pyfunction]
#[pyo3(signature = (order, rig, out, progress = None))]
pub fn simulate<'py>(
    py: Python<'py>,
    order: Order,
    rig: &Rig,
    out: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Vec<String>, Arrays<'py>)> {
    let plan = order.plan()?;
    let recording = py.detach(|| plan.recording(rig.0.clone())).map_err(value_error)?;
    let (mut signals, mut asked) = (Signals::new(None), None);
    let tell = |py: Python<'_>, share: f64| match &progress {
        Some(progress) => progress.call1(py, (share, 1.0)).map(|_| ()),
        None => Ok(()),
    };
    let go_on = |share| match signals.heed_and(|py| tell(py, share)) {
        Err(Stopped::Asked(error)) => {
            asked = Some(error);
            ControlFlow::Break(())
        }
        _ => ControlFlow::Continue(()),
    };
    let made = py.detach(|| match &out {
        None => recording.columns(go_on),
        Some(path) => recording.write(path, go_on).map(|truth| (Vec::new(), truth)),
    });
    let (columns, truth) = match (made, asked) {
        (_, Some(error)) => return Err(error),
        (Err(RecordingError::Output(error)), _) => return Err(output_error(py, &error)),
        (made, _) => made.map_err(value_error)?,
    };
    tell(py, 1.0)?;
    let columns = columns.into_iter().map(|(header, values)| (header, values.into_pyarray(py))).collect();
    Ok((serde_json::to_string(&truth).map_err(value_error)?, recording.warnings(), columns))
}

fn parsed<T: FromStr<Err: Display>>(name: &str, text: &str) -> PyResult<T> {
    text.parse().map_err(|error| value_error(format!("{name}: {error}")))
}

impl Order {
    fn followed(&self) -> PyResult<Followed> {
        match (&self.wind, &self.position, &self.load) {
            (Some(wind), None, None) => {
                let Ok(wind) = wind.parse::<Wind>();
                Ok(Followed::Wind(wind, self.emulation()))
            }
            (None, Some(position), Some(load)) => {
                Ok(Followed::Given { position: position.text(), load: load.text() })
            }
            _ => Err(value_error("give either wind, or both position and load")),
        }
    }

    fn emulation(&self) -> Emulation {
        let paper = Emulation::paper();
        Emulation {
            load_scale: self.load_scale.unwrap_or(paper.load_scale),
            position_scale: self.position_scale.unwrap_or(paper.position_scale),
            blade_inertia_kgm2: self.blade_inertia.unwrap_or(paper.blade_inertia_kgm2),
            ..paper
        }
    }

    fn plan(&self) -> PyResult<Plan> {
        let effect = |(id, value): (&String, &f64)| EffectSize::new(id, *value).map_err(value_error);
        let leak = |name, size: &Quantity| size.parsed::<LeakCourse>(name);
        let time = |name, time: &Option<Quantity>| {
            time.as_ref().map(|time| time.si(name, Dimension::Time)).transpose()
        };
        Ok(Plan {
            followed: self.followed()?,
            leaks: PerLeak {
                internal: leak("leak_internal", &self.leak_internal)?,
                external_a: leak("leak_external_a", &self.leak_external_a)?,
                external_b: leak("leak_external_b", &self.leak_external_b)?,
            },
            onset_s: self.onset.si("onset", Dimension::Time)?,
            oil_temperature: self.oil_temp.as_ref().map(Quantity::text),
            shut: self.shut.as_deref().map(|shut| parsed("shut", shut)).transpose()?,
            effects: self.effects.iter().map(effect).collect::<PyResult<_>>()?,
            valve_flaws: self.valve.iter().map(|flaw| parsed("valve", flaw)).collect::<PyResult<_>>()?,
            noise: self.noise.parsed("noise")?,
            bias_share: share_of_full_scale(&self.bias.text())
                .map_err(|error| value_error(format!("bias: {error}")))?,
            sensor_faults: self
                .faults
                .iter()
                .map(|fault| fault.parse().map_err(value_error))
                .collect::<PyResult<_>>()?,
            seed: self.seed,
            start_s: time("start", &self.start)?,
            duration_s: time("duration", &self.duration)?,
            sample_rate_hz: self.sample_rate.si("sample_rate", Dimension::Frequency)?,
        })
    }
}

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
