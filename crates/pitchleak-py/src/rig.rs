//! Rigs for Python, from files and from keyword arguments: each is a key of a rig file, its value what would stand there.

use crate::errors::{RigError, rig_error, value_error};
use pitchleak::Rig as EngineRig;
use pitchleak::rig::{EstimatorKind, Fault, RigError as EngineRigError};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyMapping};
use std::path::PathBuf;
use toml::{Table, Value};

/// A rig file: the cylinder, its oil, its sensors, its alarms.
///
/// Arguments are the keys of a rig file: ``area_a``, ``area_b``, ``stroke``, ``moving_mass``, ``dead_volume_a``,
/// ``dead_volume_b``; ``bulk_modulus``, ``bulk_modulus_std``; the sensors' data sheets ``flow`` (or ``flow_a``,
/// ``flow_b``), ``pressure``, ``position``, ``force`` as dicts, ``accuracy`` for all of them; ``estimator``, ``alarms``,
/// ``columns``, ``csv``, ``effects`` as dicts; ``name`` for messages. A quantity is a text with its unit or a
/// number in SI. Raises :class:`RigError`, which names the argument. See also :meth:`paper`, :meth:`load`, :meth:`parse`
/// and :meth:`replace`; a rig never changes.
///
/// >>> import pitchleak as pl
/// >>> rig = pl.Rig(
/// ...     area_a="12.6 cm^2", area_b="9.4 cm^2", stroke="200 mm", moving_mass="20 kg",
/// ...     bulk_modulus="0.8 GPa", pressure={"full_scale": "160 bar", "accuracy": "0.5 %"},
/// ... )
/// >>> rig.stroke_m, rig.bulk_modulus_pa
/// (0.2, 800000000.0)
#[pyclass(frozen, eq, module = "pitchleak")]
#[derive(Clone, PartialEq)]
pub struct Rig(pub EngineRig);

#[pymethods]
impl Rig {
    #[new]
    #[pyo3(signature = (**arguments))]
    fn new(arguments: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        rig(arguments).map(Self)
    }

    /// This rig with other values: arguments as for :class:`Rig`. Entries of a dict are put into the one that is there,
    /// None takes out what a rig file may leave out. Where more changes than how a trace is read, so does the name.
    ///
    /// >>> import pitchleak as pl
    /// >>> better = pl.Rig.paper().replace(stroke="250 mm", accuracy="0.1 %")
    /// >>> better.stroke_m, better.name
    /// (0.25, 'wu2011, changed')
    #[pyo3(signature = (**arguments))]
    fn replace(&self, arguments: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        replaced(&self.0, arguments).map(Self)
    }

    /// The rig of Wu et al. (2011), Section III.
    #[staticmethod]
    fn paper() -> Self {
        Self(EngineRig::paper())
    }

    /// Reads a rig file.
    ///
    /// Raises :class:`RigError` (file, line, key, values allowed) or ``OSError``.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        EngineRig::load(path).map(Self).map_err(|error| rig_error(py, &error))
    }

    /// Reads the text of a rig file; ``name`` stands in messages and results.
    ///
    /// >>> import pitchleak as pl
    /// >>> pl.Rig.parse(pl.Rig.paper().to_toml(), "copy").name
    /// 'copy'
    #[staticmethod]
    #[pyo3(signature = (text, name = "rig"))]
    fn parse(py: Python<'_>, text: &str, name: &str) -> PyResult<Self> {
        EngineRig::parse(text, name).map(Self).map_err(|error| rig_error(py, &error))
    }

    /// The rig for a trace file: ``rig.toml`` beside it, else :meth:`paper`.
    #[staticmethod]
    fn beside(py: Python<'_>, trace: PathBuf) -> PyResult<Self> {
        EngineRig::beside(&trace).map(Self).map_err(|error| rig_error(py, &error))
    }

    /// The text of a rig file that reads back to the same numbers.
    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    /// Path of the file, or ``wu2011``.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Piston area A_A, m².
    #[getter]
    fn area_a_m2(&self) -> f64 {
        self.0.cylinder.area_a_m2
    }

    /// Rod-side area A_B, m².
    #[getter]
    fn area_b_m2(&self) -> f64 {
        self.0.cylinder.area_b_m2
    }

    /// Stroke L, m.
    #[getter]
    fn stroke_m(&self) -> f64 {
        self.0.cylinder.stroke_m
    }

    /// Moving mass m, kg.
    #[getter]
    fn moving_mass_kg(&self) -> f64 {
        self.0.cylinder.moving_mass_kg
    }

    /// Volume of port and hose A, m³.
    #[getter]
    fn dead_volume_a_m3(&self) -> f64 {
        self.0.cylinder.dead_volume_a_m3
    }

    /// Volume of port and hose B, m³.
    #[getter]
    fn dead_volume_b_m3(&self) -> f64 {
        self.0.cylinder.dead_volume_b_m3
    }

    /// Bulk modulus β, best guess before any data, Pa.
    #[getter]
    fn bulk_modulus_pa(&self) -> f64 {
        self.0.fluid.bulk_modulus_pa
    }

    /// Standard deviation of that guess, Pa.
    #[getter]
    fn bulk_modulus_std_pa(&self) -> f64 {
        self.0.fluid.bulk_modulus_std_pa
    }

    /// ``rls`` or ``paper``.
    #[getter]
    fn estimator(&self) -> &'static str {
        self.0.estimator.kind.name()
    }

    /// Leak flows at which an alarm is raised, L/min: internal, external_a, external_b.
    #[getter]
    fn alarm_thresholds_lpm(&self) -> [f64; 3] {
        let threshold = self.0.alarms.threshold_m3s.map(|flow| flow * pitchleak::units::LPM_PER_M3S);
        [threshold.internal, threshold.external_a, threshold.external_b]
    }

    /// Sizes of the effects beyond the model that the file declares (``[effects]``), SI, by id.
    #[getter]
    fn effects(&self) -> std::collections::BTreeMap<&'static str, f64> {
        self.0.effect_set().iter().map(|active| (active.effect.spec().id, active.value)).collect()
    }

    fn __repr__(&self) -> String {
        let cylinder = &self.0.cylinder;
        format!(
            "<Rig {}: areas {:.4} and {:.4} cm², stroke {:.4} m, bulk modulus {:.3} ± {:.3} GPa>",
            self.0.name,
            cylinder.area_a_m2 * 1e4,
            cylinder.area_b_m2 * 1e4,
            cylinder.stroke_m,
            self.0.fluid.bulk_modulus_pa / 1e9,
            self.0.fluid.bulk_modulus_std_pa / 1e9,
        )
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("pitchleak._html")?.call_method1("rig", (slf,))
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<(Py<PyAny>, (String, String))> {
        let this = slf.get();
        Ok((slf.get_type().getattr("parse")?.unbind(), (this.to_toml(), this.0.name.clone())))
    }
}

impl Rig {
    /// The engine's rig, with another estimator where one is named.
    pub fn with_estimator(&self, name: Option<&str>) -> PyResult<EngineRig> {
        let mut rig = self.0.clone();
        if let Some(name) = name {
            rig.estimator.kind = EstimatorKind::by_name(name).ok_or_else(|| {
                let names = EstimatorKind::NAMES.join(" or ");
                PyValueError::new_err(format!("estimator `{name}`: must be {names}"))
            })?;
        }
        Ok(rig)
    }
}

/// Keys that are arguments of their own, by their section.
const KEYS: [(&str, &[&str]); 3] = [
    ("cylinder", &["area_a", "area_b", "stroke", "moving_mass", "dead_volume_a", "dead_volume_b"]),
    ("fluid", &["bulk_modulus", "bulk_modulus_std"]),
    ("sensors", &["flow", "flow_a", "flow_b", "pressure", "position", "force"]),
];
/// The accuracy of every sensor.
const ACCURACY: &str = "accuracy";
/// Arguments whose texts are names, not quantities.
const OF_NAMES: [&str; 4] = ["columns", "csv", "name", "estimator"];
/// Arguments that say how a trace is read, and nothing of the cylinder.
const OF_THE_TRACE: [&str; 2] = ["columns", "csv"];

/// The rig that these arguments describe; what they leave out is the rig file's default.
pub fn rig(arguments: Option<&Bound<'_, PyDict>>) -> PyResult<EngineRig> {
    let mut arguments = Arguments::of(arguments)?;
    let accuracy = arguments.take(ACCURACY);
    let name = arguments.name()?.unwrap_or_else(|| "rig".to_owned());
    let rig = read(&arguments.put_into(Table::new())?, &name)?;
    match accuracy {
        None => Ok(rig),
        Some(accuracy) => read(&with_accuracy(table(&rig)?, &accuracy, &name)?, &name),
    }
}

/// `rig` with what the arguments say.
pub fn replaced(rig: &EngineRig, arguments: Option<&Bound<'_, PyDict>>) -> PyResult<EngineRig> {
    let mut arguments = Arguments::of(arguments)?;
    let name = arguments.name()?;
    let same = arguments.0.iter().all(|(key, _)| OF_THE_TRACE.contains(&key.as_str()));
    let name = name.unwrap_or_else(|| rig.name.clone() + if same { "" } else { ", changed" });
    let mut table = table(rig)?;
    if let Some(accuracy) = arguments.take(ACCURACY) {
        table = with_accuracy(table, &accuracy, &name)?;
    }
    read(&arguments.put_into(table)?, &name)
}

/// Names and values, in the order given; none is a value that is taken out.
struct Arguments(Vec<(String, Option<Value>)>);

impl Arguments {
    fn of(given: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let one = |(key, given): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let key: String = key.extract()?;
            let value = value(&key, &given)?;
            Ok((key, value))
        };
        given.into_iter().flat_map(|given| given.iter()).map(one).collect::<PyResult<_>>().map(Self)
    }

    fn take(&mut self, key: &str) -> Option<Value> {
        let place = self.0.iter().position(|(other, _)| other == key)?;
        self.0.remove(place).1
    }

    fn name(&mut self) -> PyResult<Option<String>> {
        match self.take("name") {
            None => Ok(None),
            Some(Value::String(name)) => Ok(Some(name)),
            Some(_) => Err(PyTypeError::new_err("`name` must be a text")),
        }
    }

    fn put_into(self, mut rig: Table) -> PyResult<Table> {
        for (key, value) in self.0 {
            let (section, value) = match KEYS.iter().find(|(_, keys)| keys.contains(&key.as_str())) {
                Some((name, _)) => (section(&mut rig, name)?, value),
                None if key == "estimator" => (&mut rig, value.map(estimator)),
                None => (&mut rig, value),
            };
            // A rig that is there has a sheet for each meter.
            if key == "flow" && section.contains_key("flow_a") {
                put(section, "flow_a", value.clone());
                put(section, "flow_b", value);
            } else {
                put(section, &key, value);
            }
        }
        Ok(rig)
    }
}

/// `"paper"` stands for `{ kind = "paper" }`.
fn estimator(value: Value) -> Value {
    match value {
        Value::String(_) => Value::Table(Table::from_iter([("kind".to_owned(), value)])),
        other => other,
    }
}

/// Entries of a table are put into the one that is there.
fn put(section: &mut Table, key: &str, value: Option<Value>) {
    match (section.get_mut(key), value) {
        (_, None) => drop(section.remove(key)),
        (Some(Value::Table(there)), Some(Value::Table(more))) => there.extend(more),
        (_, Some(value)) => drop(section.insert(key.to_owned(), value)),
    }
}

fn section<'a>(rig: &'a mut Table, name: &str) -> PyResult<&'a mut Table> {
    let section = rig.entry(name).or_insert_with(|| Value::Table(Table::new()));
    section.as_table_mut().ok_or_else(|| PyTypeError::new_err(format!("`{name}` must be a dict")))
}

/// The same with this accuracy for every sensor; what is wrong with it is told of the argument, not of the first sensor.
fn with_accuracy(mut rig: Table, accuracy: &Value, name: &str) -> PyResult<Table> {
    if accuracy.is_table() {
        return Err(PyTypeError::new_err(
            "`accuracy`: dict is no quantity; give one share for all sensors, such as \"0.5 %\"",
        ));
    }
    for (_, sheet) in section(&mut rig, "sensors")?.iter_mut() {
        if let Value::Table(sheet) = sheet {
            sheet.insert(ACCURACY.to_owned(), accuracy.clone());
        }
    }
    match parsed(&rig, name) {
        Err(EngineRigError::Content { fault: Fault::Impossible { key, value, allowed }, .. })
            if key.ends_with(".accuracy") =>
        {
            Err(RigError::new_err(format!(
                "`{ACCURACY}` is {value}; it must be {allowed}, such as \"0.5 %\""
            )))
        }
        _ => Ok(rig),
    }
}

/// As TOML has it; none for None.
fn value(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<Option<Value>> {
    if given.is_none() {
        return Ok(None);
    }
    if let Ok(flag) = given.cast::<PyBool>() {
        return Ok(Some(Value::Boolean(flag.is_true())));
    }
    if let Ok(text) = given.extract::<String>() {
        return with_unit(argument, text).map(|text| Some(Value::String(text)));
    }
    if let Ok(entries) = given.cast::<PyMapping>() {
        let mut table = Table::new();
        for entry in entries.items()?.iter() {
            let (key, given): (String, Bound<'_, PyAny>) = entry.extract()?;
            let value = value(&format!("{argument}.{key}"), &given)?;
            table.extend(value.map(|value| (key, value)));
        }
        return Ok(Some(Value::Table(table)));
    }
    given.extract().map(|number| Some(Value::Float(number))).map_err(|_| no_quantity(argument, given))
}

/// A quantity as a text has its unit: a number alone, `"12.6"`, would be in SI, which is not what was meant.
fn with_unit(argument: &str, text: String) -> PyResult<String> {
    let root = argument.split('.').next().unwrap_or(argument);
    let is_bare = text.trim().parse::<f64>().is_ok_and(|number| number != 0.0);
    if !is_bare || OF_NAMES.contains(&root) {
        return Ok(text);
    }
    Err(RigError::new_err(format!(
        "`{argument}`: \"{text}\" has no unit; write it (\"12.6 cm^2\", \"0.5 %\", …), or give a number in SI"
    )))
}

fn no_quantity(argument: &str, given: &Bound<'_, PyAny>) -> PyErr {
    let kind = given.get_type();
    let kind = kind.name().map_or_else(|_| "this".to_owned(), |name| name.to_string());
    let is_key = argument == ACCURACY || KEYS[..2].iter().any(|(_, keys)| keys.contains(&argument));
    let wanted = if argument.contains('.') || is_key {
        "is no quantity; give a number in SI, or a text with its unit such as \"12.6 cm^2\""
    } else {
        "is none; give a dict of what stands in this section of a rig file"
    };
    PyTypeError::new_err(format!("`{argument}`: {kind} {wanted}"))
}

/// All that a rig is, as its file has it.
fn table(rig: &EngineRig) -> PyResult<Table> {
    rig.to_toml().parse().map_err(value_error)
}

fn parsed(table: &Table, name: &str) -> Result<EngineRig, EngineRigError> {
    EngineRig::parse(&table.to_string(), name)
}

fn read(table: &Table, name: &str) -> PyResult<EngineRig> {
    parsed(table, name).map_err(|error| match error {
        EngineRigError::Content { fault: Fault::UnknownKey { key, allowed }, .. } if !key.contains('.') => {
            let sections = allowed.split(", ").filter(|section| KEYS.iter().all(|(name, _)| name != section));
            let keys = KEYS.iter().flat_map(|(_, keys)| keys.iter().copied());
            let names: Vec<_> = keys.chain([ACCURACY]).chain(sections).chain(["name"]).collect();
            PyTypeError::new_err(format!("unknown argument `{key}`; there are {}", names.join(", ")))
        }
        // No file, so neither place nor section.
        EngineRigError::Content { fault, .. } => {
            let text = KEYS
                .iter()
                .fold(fault.to_string(), |text, (section, _)| text.replace(&format!("`{section}."), "`"));
            RigError::new_err(text)
        }
        other => value_error(other),
    })
}
