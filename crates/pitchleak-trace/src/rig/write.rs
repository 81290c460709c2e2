use super::bound::{self, Bound};
use super::keys::{Keys, lines_of, quantity, toml_text};
use super::settings::alarm_keys;
use super::{
    CsvSettings, DecisionSettings, EstimatorSettings, ForeignColumn, Instruments, Rig, ValveSheet,
    cylinder_keys, effects, fluid_keys,
};
use crate::signal::Signal;
use crate::units::{self, Dimension, FEW_DIGITS, rounded};
use pitchleak_core::EffectSet;
use std::collections::BTreeSet;
use std::fmt::Write;
use toml_edit::{DocumentMut, Item, TableLike};

/// A quantity as text, within what the reader takes: in the unit that people read it in where few digits say the same number
/// there.
fn for_people(value: f64, bound: Bound) -> String {
    let (si, dimension) = (bound.nearest(value), bound.dimension);
    let text = dimension.difference_for_people().and_then(|unit| {
        let text = format!("{} {}", rounded(unit.from_si(si), FEW_DIGITS), unit.text);
        let read = units::parse(&text, dimension).ok()?;
        (read.to_bits() == si.to_bits()).then(|| toml_text(&text))
    });
    text.unwrap_or_else(|| quantity(si, dimension))
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
        self.write_decision(&mut out);
        self.write_columns(&mut out);
        self.write_csv(&mut out);
        self.write_effects(&mut out);
        if let Some(valve) = &mut rig.valve {
            put(&mut out, "valve", lines_of(valve, ValveSheet::keys));
        }
        out
    }

    fn write_decision(&self, out: &mut String) {
        if self.decision != DecisionSettings::default() {
            let alpha = bound::ALPHA.nearest(self.decision.alpha);
            let _ = write!(out, "\n[decision]\nalpha = {alpha:?}\n");
            let odds: Vec<String> =
                self.decision.odds.iter().map(|(id, share)| format!("{id} = {share:?}")).collect();
            if !odds.is_empty() {
                let _ = writeln!(out, "odds = {{ {} }}", odds.join(", "));
            }
        }
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
            let value = effects::size(*effect).nearest(size.value);
            let constants = effect.constants().iter().map(|constant| {
                let spec = constant.spec();
                (
                    spec.id,
                    Bound::between(Dimension::Share, spec.lower, spec.upper)
                        .nearest(size.constants.get(*constant)),
                )
            });
            if room.set(*effect, value, Default::default()).is_err() {
                let _ = writeln!(out, "# {effect}: no room for more");
                continue;
            }
            let std = size.std.map(|std| ("std", bound::EFFECT_STD.nearest(std)));
            let _ = write!(out, "{effect} = {{ value = {value:?}");
            for (key, value) in std.into_iter().chain(constants) {
                let _ = write!(out, ", {key} = {value:?}");
            }
            out.push_str(" }\n");
        }
    }
}

impl ForeignColumn {
    /// The entry of `[columns]`, e.g. `{ name = "Head pressure", unit = "bar" }`; scale and offset where they do
    /// anything.
    pub fn to_toml(&self, signal: Signal) -> String {
        let mut out = format!("{{ name = {}", toml_text(&self.name));
        if let Some(unit) = self.unit {
            let _ = write!(out, ", unit = {}", toml_text(unit.text));
        }
        let scale = bound::SCALE.nearest(self.scale.abs()).copysign(self.scale);
        if (scale - 1.0).abs() > 0.0 {
            let _ = write!(out, ", scale = {scale:?}");
        }
        if let Some(dimension) = signal.dimension().filter(|_| self.offset.abs() > 0.0) {
            let _ = write!(out, ", offset = {}", for_people(self.offset, bound::offset(dimension)));
        }
        if let Some(format) = &self.format {
            let _ = write!(out, ", format = {}", toml_text(&format.to_string()));
        }
        if let Some(zone) = &self.zone {
            let _ = write!(out, ", zone = {}", toml_text(&zone.to_string()));
        }
        out + " }"
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
