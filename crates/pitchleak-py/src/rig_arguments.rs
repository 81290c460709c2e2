//! A rig from keyword arguments: each is a key of a rig file, its value what would stand there.

use crate::errors::{RigError, value_error};
use pitchleak::Rig;
use pitchleak::rig::{Fault, RigError as EngineRigError};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyMapping};
use toml::{Table, Value};

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
pub fn rig(arguments: Option<&Bound<'_, PyDict>>) -> PyResult<Rig> {
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
pub fn replaced(rig: &Rig, arguments: Option<&Bound<'_, PyDict>>) -> PyResult<Rig> {
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
fn table(rig: &Rig) -> PyResult<Table> {
    rig.to_toml().parse().map_err(value_error)
}

fn parsed(table: &Table, name: &str) -> Result<Rig, EngineRigError> {
    Rig::parse(&table.to_string(), name)
}

fn read(table: &Table, name: &str) -> PyResult<Rig> {
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
