//! Rig files: the cylinder, its oil, its sensors, and how to watch it.

mod bound;
mod document;
mod effects;
mod instruments;
mod keys;
mod odds;
mod settings;
mod valve;
mod write;

pub use document::{Fault, Place, RigError};
pub use effects::{EffectMap, EffectValue};
pub use instruments::{Instrument, Instruments};
pub use odds::{Odds, explanations};
pub use settings::{
    ColumnMap, CsvSettings, Decimal, DecisionSettings, Delimiter, EstimatorKind, EstimatorSettings,
    ForeignColumn,
};

pub use valve::{ValveDrift, ValveSheet};

use document::{Document, Section};
use keys::{Done, Keys};
use pitchleak_core::{AlarmSettings, Cylinder, EffectSet, Fluid, Sensors};
use std::io::{ErrorKind, Read};
use std::path::Path;
use toml::de::DeTable;

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
            effects: effects::read(&root.section("effects")?)?,
            valve: ValveSheet::read(&root.section("valve")?)?,
            assumed: Assumed { rig: false, sensors: !root.section("sensors")?.is_present() },
        })
    }

    /// The effects of `[effects]`, switched on.
    pub fn effect_set(&self) -> EffectSet<f64> {
        effects::effect_set(&self.effects)
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

#[cfg(test)]
mod tests;
