use crate::errors::value_error;
use crate::rig::Rig;
use numpy::{IntoPyArray, PyArray1};
use pitchleak::core::PerLeak;
use pitchleak::reference::{Reference, constant_or_file};
use pitchleak::simulate::{EffectSize, LeakSize, Plan, Recording, TruthFile, truth_path};
use pitchleak::units::{self, Dimension};
use pitchleak::wind::{Emulation, History, Wind};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A number in SI, or a quantity with its unit.
#[derive(FromPyObject)]
pub enum Quantity {
    Si(f64),
    Text(String),
}

impl Quantity {
    fn si(&self, name: &str, dimension: Dimension) -> PyResult<f64> {
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

    fn parsed<T: std::str::FromStr<Err: std::fmt::Display>>(&self, name: &str) -> PyResult<T> {
        self.text().parse().map_err(|error| value_error(format!("{name}: {error}")))
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
    effects: BTreeMap<String, f64>,
    noise: Quantity,
    bias: Quantity,
    seed: u64,
    duration: Option<Quantity>,
    start: Option<Quantity>,
    sample_rate: Quantity,
    load_scale: Option<f64>,
    position_scale: Option<f64>,
    blade_inertia: Option<f64>,
}

/// A simulated trace: the truth, and header and values of each column.
type Trace = (TruthFile, Vec<(String, Vec<f64>)>);

/// Header and values of each column.
type Columns<'py> = Vec<(String, Bound<'py, PyArray1<f64>>)>;

/// Simulates a rig; gives the truth as JSON, warnings, and the columns of the trace, or none where it is
/// written to `out`.
#[pyfunction]
pub fn simulate<'py>(
    py: Python<'py>,
    order: Order,
    rig: &Rig,
    out: Option<PathBuf>,
) -> PyResult<(String, Vec<String>, Columns<'py>)> {
    let (recording, name, warnings) = py.detach(|| order.recording(rig))?;
    let (truth, columns) = py.detach(|| match &out {
        None => in_memory(&recording, &name),
        Some(path) => to_file(&recording, &name, path).map(|truth| (truth, Vec::new())),
    })?;
    let columns = columns.into_iter().map(|(header, values)| (header, values.into_pyarray(py))).collect();
    Ok((serde_json::to_string(&truth).map_err(value_error)?, warnings, columns))
}

fn to_file(recording: &Recording, name: &str, path: &Path) -> PyResult<TruthFile> {
    let truth = recording.write(path, name, |_| ()).map_err(value_error)?;
    let text = serde_json::to_string_pretty(&truth).map_err(value_error)? + "\n";
    std::fs::write(truth_path(path), text)?;
    Ok(truth)
}

/// The numbers are those of the file that would have been written, with its rounding.
fn in_memory(recording: &Recording, name: &str) -> PyResult<Trace> {
    let (bytes, truth) =
        recording.record(|| Ok(Vec::new()), Path::new("memory"), name, |_| ()).map_err(value_error)?;
    let text = String::from_utf8(bytes).map_err(value_error)?;
    let mut lines = text.lines();
    let headers = lines.next().unwrap_or_default().split(',');
    let mut columns: Vec<_> = headers.map(|header| (header.to_owned(), Vec::new())).collect();
    for line in lines {
        for ((_, values), cell) in columns.iter_mut().zip(line.split(',')) {
            values.push(cell.parse().unwrap_or(f64::NAN));
        }
    }
    Ok((truth, columns))
}

impl Order {
    /// The recording, the name of what the rig follows, and warnings.
    fn recording(&self, rig: &Rig) -> PyResult<(Recording, String, Vec<String>)> {
        let (reference, name) = self.reference(rig)?;
        let clipped = 100.0 * reference.clipped_share;
        let warnings = if clipped > 0.0 {
            vec![format!("{name}: the position was held off the end stops for {clipped:.1} % of the time")]
        } else {
            Vec::new()
        };
        let recording = self.plan()?.recording(rig.0.clone(), reference).map_err(value_error)?;
        Ok((recording, name, warnings))
    }

    fn reference(&self, rig: &Rig) -> PyResult<(Reference, String)> {
        match (&self.wind, &self.position, &self.load) {
            (Some(wind), None, None) => self.wind_reference(wind, rig),
            (None, Some(position), Some(load)) => {
                let (position, load) = (position.text(), load.text());
                let x = constant_or_file(&position, "x", Dimension::Length).map_err(value_error)?;
                let force = constant_or_file(&load, "force", Dimension::Force).map_err(value_error)?;
                Ok((Reference::of(x, force), format!("position {position}, load {load}")))
            }
            _ => Err(value_error("give either wind, or both position and load")),
        }
    }

    fn wind_reference(&self, wind: &str, rig: &Rig) -> PyResult<(Reference, String)> {
        let wind: Wind = match wind.parse() {
            Ok(wind) => wind,
            Err(never) => match never {},
        };
        let paper = Emulation::paper();
        let emulation = Emulation {
            load_scale: self.load_scale.unwrap_or(paper.load_scale),
            position_scale: self.position_scale.unwrap_or(paper.position_scale),
            blade_inertia_kgm2: self.blade_inertia.unwrap_or(paper.blade_inertia_kgm2),
            ..paper
        };
        let history = History::of(&wind).map_err(value_error)?;
        let reference = emulation.reference(&history, rig.0.cylinder.stroke_m).map_err(value_error)?;
        Ok((reference, format!("wind {wind}")))
    }

    fn plan(&self) -> PyResult<Plan> {
        let effect = |(id, value): (&String, &f64)| EffectSize::new(id, *value).map_err(value_error);
        let leak = |name, size: &Quantity| size.parsed::<LeakSize>(name);
        let time = |name, time: &Option<Quantity>| {
            time.as_ref().map(|time| time.si(name, Dimension::Time)).transpose()
        };
        Ok(Plan {
            leaks: PerLeak {
                internal: leak("leak_internal", &self.leak_internal)?,
                external_a: leak("leak_external_a", &self.leak_external_a)?,
                external_b: leak("leak_external_b", &self.leak_external_b)?,
            },
            onset_s: self.onset.si("onset", Dimension::Time)?,
            effects: self.effects.iter().map(effect).collect::<PyResult<_>>()?,
            noise: self.noise.parsed("noise")?,
            bias_share: self.bias.si("bias", Dimension::Share)?,
            seed: self.seed,
            start_s: time("start", &self.start)?,
            duration_s: time("duration", &self.duration)?,
            sample_rate_hz: self.sample_rate.si("sample_rate", Dimension::Frequency)?,
        })
    }
}
