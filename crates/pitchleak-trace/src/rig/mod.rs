//! Rig files: the cylinder, its oil, its sensors, and how to watch it.

mod bound;
mod document;
mod instruments;
mod keys;
mod prior;
mod settings;
#[cfg(test)]
mod tests;

pub use document::{Fault, Place, RigError};
pub use instruments::{Instrument, Instruments, ValveDrift, ValveSheet};
pub use prior::{EffectMap, EffectValue, Odds, explanations};
pub use settings::{
    ColumnMap, CsvSettings, Decimal, DecisionSettings, Delimiter, EstimatorKind, EstimatorSettings,
    ForeignColumn,
};

use crate::signal::Signal;
use document::{Document, Section};
use keys::{Done, Keys, inline, lines_of};
use pitchleak_core::{AlarmSettings, Cylinder, EffectSet, Fluid, Sensors};
use settings::{alarm_keys, column_keys};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::io::{ErrorKind, Read};
use std::path::Path;
use toml::de::DeTable;
use toml_edit::{DocumentMut, Item, TableLike};

/// A rig file, read and checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The file's path as given, or `wu2011` for the built-in rig.
    pub name: String,
    /// Geometry and mass.
    pub cylinder: Cylinder<f64>,
    /// Prior of the bulk modulus.
    pub fluid: Fluid<f64>,
    /// Data sheets of the sensors.
    pub instruments: Instruments,
    /// `[estimator]`.
    pub estimator: EstimatorSettings,
    /// `[alarms]`.
    pub alarms: AlarmSettings<f64>,
    /// `[decision]`.
    pub decision: DecisionSettings,
    /// `[columns]`.
    pub columns: ColumnMap,
    /// `[csv]`.
    pub csv: CsvSettings,
    /// `[effects]`: what a diagnosis found.
    pub effects: EffectMap,
    /// `[valve]`: the data sheet of the valve between supply and cylinder.
    pub valve: Option<ValveSheet>,
    /// What nobody declared.
    pub assumed: Assumed,
}

/// What is the paper's because nobody said otherwise.
#[derive(Clone, Copy, Debug, Default)]
pub struct Assumed {
    /// All of it: no rig file was given, nor stood beside the trace.
    pub rig: bool,
    /// The sensors: the rig file has no `[sensors]`.
    pub sensors: bool,
}

/// Rigs of the same numbers are the same rig, whoever gave them.
impl PartialEq for Assumed {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Rig {
    /// Name of the built-in rig.
    pub const PAPER_NAME: &'static str = "wu2011";

    /// The rig of Wu et al. (2011), Section III.
    pub fn paper() -> Self {
        let cylinder = Cylinder::paper();
        Self {
            name: Self::PAPER_NAME.to_owned(),
            instruments: Instruments::paper(&cylinder),
            cylinder,
            fluid: Fluid::paper(),
            estimator: EstimatorSettings::default(),
            alarms: AlarmSettings::default(),
            decision: DecisionSettings::default(),
            columns: ColumnMap::new(),
            csv: CsvSettings::default(),
            effects: EffectMap::new(),
            valve: None,
            assumed: Assumed::default(),
        }
    }

    /// Reads a rig file.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, RigError> {
        let file = path.as_ref().display().to_string();
        match read_bounded(path.as_ref()) {
            Ok(text) => Self::parse(&text, &file),
            Err(source) => Err(RigError::Read { file, source }),
        }
    }

    /// The same without its valve's calibration: a new one does not rest on it.
    #[must_use]
    pub fn uncalibrated(&self) -> Self {
        let valve = self.valve.clone().map(|sheet| ValveSheet { calibration: None, ..sheet });
        Self { valve, ..self.clone() }
    }

    /// The rig for a trace: `rig.toml` beside it, else the built-in one. Beside standard input (`-`)
    /// there is nothing.
    pub fn beside(trace: &Path) -> Result<Self, RigError> {
        let neighbour = trace.with_file_name("rig.toml");
        if trace != Path::new("-") && neighbour.is_file() {
            return Self::load(neighbour);
        }
        Ok(Self { assumed: Assumed { rig: true, sensors: true }, ..Self::paper() })
    }

    /// The file it was read from; none of the built-in one.
    pub fn file(&self) -> Option<&Path> {
        (self.name != Self::PAPER_NAME).then_some(Path::new(&self.name))
    }

    /// Reads the text of a rig file; `file` is its name for messages.
    pub fn parse(text: &str, file: &str) -> Result<Self, RigError> {
        let text = text.trim_start_matches('\u{feff}');
        let document = Document { file, text };
        let table = DeTable::parse(text).map_err(|error| {
            let message = error.message().replace('\n', " ");
            document.fail(error.span().map(|span| span.start), Fault::Syntax(message))
        })?;
        let root = Section::root(&document, table.get_ref());
        root.allow(&SECTIONS.split(' ').collect::<Vec<_>>())?;
        let cylinder = root.section("cylinder")?.read(Cylinder::paper(), cylinder_keys)?;
        let instruments = Instruments::read(&root.section("sensors")?, &cylinder)?;
        Ok(Self {
            name: file.to_owned(),
            cylinder,
            fluid: root.section("fluid")?.read(Fluid::paper(), fluid_keys)?,
            instruments,
            estimator: root
                .section("estimator")?
                .read(EstimatorSettings::default(), EstimatorSettings::keys)?,
            alarms: root.section("alarms")?.read(AlarmSettings::default(), |keys, alarms| {
                settings::alarm_keys(keys, alarms, &instruments)
            })?,
            decision: root.section("decision")?.read(DecisionSettings::default(), DecisionSettings::keys)?,
            columns: settings::read_columns(&root.section("columns")?)?,
            csv: root.section("csv")?.read(CsvSettings::default(), CsvSettings::keys)?,
            effects: prior::read_effects(&root.section("effects")?)?,
            valve: ValveSheet::read(&root.section("valve")?)?,
            assumed: Assumed { rig: false, sensors: !root.section("sensors")?.is_present() },
        })
    }

    /// The effects of `[effects]`, switched on.
    pub fn effect_set(&self) -> EffectSet<f64> {
        prior::effect_set(&self.effects)
    }

    /// The spread of every sensor as the estimators use it.
    pub fn sensors(&self) -> Sensors<f64> {
        self.instruments.spread()
    }
}

/// What a rig file may have.
const SECTIONS: &str = "cylinder fluid sensors estimator alarms decision columns csv effects valve";

/// No rig file is longer, bytes; a device or a trace given for one may have no end.
const LONGEST_FILE: u64 = 1 << 20;

fn read_bounded(path: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    std::fs::File::open(path)?.take(LONGEST_FILE + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LONGEST_FILE {
        return Err(std::io::Error::new(ErrorKind::InvalidData, "longer than a megabyte: no rig file"));
    }
    Ok(text)
}

fn cylinder_keys(keys: &mut Keys<'_>, cylinder: &mut Cylinder<f64>) -> Done {
    keys.needed("area_a", bound::AREA, &mut cylinder.area_a_m2)?;
    keys.needed("area_b", bound::AREA, &mut cylinder.area_b_m2)?;
    keys.needed("stroke", bound::STROKE, &mut cylinder.stroke_m)?;
    keys.needed("moving_mass", bound::MOVING_MASS, &mut cylinder.moving_mass_kg)?;
    keys.number("dead_volume_a", bound::DEAD_VOLUME, &mut cylinder.dead_volume_a_m3, 0.0)?;
    keys.number("dead_volume_b", bound::DEAD_VOLUME, &mut cylinder.dead_volume_b_m3, 0.0)
}

/// A prior of a quarter of β where the file gives none, as for the paper's rig.
fn fluid_keys(keys: &mut Keys<'_>, fluid: &mut Fluid<f64>) -> Done {
    keys.needed("bulk_modulus", bound::BULK_MODULUS, &mut fluid.bulk_modulus_pa)?;
    let usual_pa = fluid.bulk_modulus_pa / 4.0;
    keys.number("bulk_modulus_std", bound::BULK_MODULUS_STD, &mut fluid.bulk_modulus_std_pa, usual_pa)
}

impl Rig {
    /// The rig file `text` with this rig's numbers: what differs is written anew, and all else stays as somebody wrote it,
    /// with comments, units and order. A text that can't be brought to say the same is replaced as a whole.
    pub fn to_toml_over(&self, text: &str) -> String {
        let fresh = self.to_toml();
        let mut text = text.trim_start_matches('\u{feff}').to_owned();
        // What the text leaves out may follow from what was changed: the spread of the bulk modulus is a share of it.
        for _ in 0..3 {
            let said = Self::parse(&text, &self.name).ok().map(|rig| rig.to_toml());
            if said.as_ref() == Some(&fresh) {
                return text;
            }
            match said.and_then(|said| changed(&text, &said, &fresh)) {
                Some(changed) => text = changed,
                None => break,
            }
        }
        fresh
    }

    /// The rig as a file that reads back to the same numbers; of a rig made by hand, to the nearest that a file may
    /// have.
    pub fn to_toml(&self) -> String {
        let mut rig = self.clone();
        let mut out = String::new();
        put(&mut out, "cylinder", lines_of(&mut rig.cylinder, cylinder_keys));
        put(&mut out, "fluid", lines_of(&mut rig.fluid, fluid_keys));
        let mut sensors = lines_of(&mut rig.instruments, Instruments::keys);
        if self.valve.is_some() {
            sensors.extend(lines_of(&mut rig.instruments, Instruments::valve_keys));
        }
        put(&mut out, "sensors", sensors);
        put(&mut out, "estimator", lines_of(&mut rig.estimator, EstimatorSettings::keys));
        let alarms = |keys: &mut Keys<'_>, alarms: &mut _| alarm_keys(keys, alarms, &self.instruments);
        put(&mut out, "alarms", lines_of(&mut rig.alarms, alarms));
        if rig.decision != DecisionSettings::default() {
            put(&mut out, "decision", lines_of(&mut rig.decision, DecisionSettings::keys));
        }
        self.write_columns(&mut out);
        self.write_csv(&mut out);
        self.write_effects(&mut out);
        if let Some(valve) = &mut rig.valve {
            put(&mut out, "valve", lines_of(valve, ValveSheet::keys));
        }
        out
    }

    fn write_columns(&self, out: &mut String) {
        if self.columns.is_empty() {
            return;
        }
        out.push_str("\n[columns]\n");
        for (signal, column) in &self.columns {
            let _ = writeln!(out, "{} = {}", signal.name(), column.to_toml(*signal));
        }
    }

    pub(crate) fn write_csv(&self, out: &mut String) {
        put(out, "csv", lines_of(&mut self.csv.clone(), CsvSettings::keys));
    }

    fn write_effects(&self, out: &mut String) {
        if self.effects.is_empty() {
            return;
        }
        out.push_str("\n[effects]\n");
        let mut room = EffectSet::default();
        for (effect, size) in &self.effects {
            let value = prior::effect_size(*effect).nearest(size.value);
            let _ = match room.set(*effect, value, Default::default()) {
                Ok(()) => {
                    let lines = lines_of(&mut size.clone(), prior::effect_keys(*effect));
                    writeln!(out, "{effect} = {}", inline(lines))
                }
                Err(_) => writeln!(out, "# {effect}: no room for more"),
            };
        }
    }
}

impl ForeignColumn {
    /// The entry of `[columns]`, e.g. `{ name = "Head pressure", unit = "bar" }`; scale and offset where they do
    /// anything.
    pub fn to_toml(&self, signal: Signal) -> String {
        inline(lines_of(&mut self.clone(), column_keys(signal)))
    }
}

/// `text` with what differs between two rigs as this program writes them.
fn changed(text: &str, before: &str, after: &str) -> Option<String> {
    let mut document: DocumentMut = text.parse().ok()?;
    let (before, after): (DocumentMut, DocumentMut) = (before.parse().ok()?, after.parse().ok()?);
    let sections: BTreeSet<&str> = before.iter().chain(after.iter()).map(|(name, _)| name).collect();
    for name in sections {
        let [was, is] = [&before, &after].map(|rig| rig.get(name).and_then(Item::as_table_like));
        let keys = [was, is].into_iter().flatten().flat_map(|table| table.iter().map(|(key, _)| key));
        for key in keys.collect::<BTreeSet<_>>() {
            let [was, is] = [was, is].map(|table| table.and_then(|table| table.get(key)));
            if was.map(Item::to_string) != is.map(Item::to_string) {
                let section = document.entry(name).or_insert(toml_edit::table()).as_table_like_mut()?;
                set(section, key, is);
            }
        }
    }
    Some(document.to_string())
}

/// Sets or takes out a key; the comment behind it stays.
fn set(section: &mut dyn TableLike, key: &str, item: Option<&Item>) {
    let Some(item) = item else {
        section.remove(key);
        return;
    };
    let mut item = item.clone();
    if let (Some(new), Some(old)) = (item.as_value_mut(), section.get(key).and_then(Item::as_value)) {
        *new.decor_mut() = old.decor().clone();
    }
    section.insert(key, item);
}

/// Writes a section, where there is anything in it.
fn put(out: &mut String, section: &str, lines: Vec<(String, String)>) {
    if lines.is_empty() {
        return;
    }
    let _ = writeln!(out, "{}[{section}]", if out.is_empty() { "" } else { "\n" });
    for (key, value) in lines {
        let _ = writeln!(out, "{key} = {value}");
    }
}

/// A rig travels as its name and the text of its file.
impl serde::Serialize for Rig {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (&self.name, self.to_toml()).serialize(serializer)
    }
}

impl<'de> serde::Deserialize<'de> for Rig {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (name, text) = <(String, String)>::deserialize(deserializer)?;
        Self::parse(&text, &name).map_err(serde::de::Error::custom)
    }
}
