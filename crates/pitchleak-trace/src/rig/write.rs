use super::keys::{Keys, inline, lines_of};
use super::settings::{alarm_keys, column_keys};
use super::{
    CsvSettings, DecisionSettings, EstimatorSettings, ForeignColumn, Instruments, Rig, ValveSheet,
    cylinder_keys, effects, fluid_keys,
};
use crate::signal::Signal;
use pitchleak_core::EffectSet;
use std::collections::BTreeSet;
use std::fmt::Write;
use toml_edit::{DocumentMut, Item, TableLike};

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
            let value = effects::size(*effect).nearest(size.value);
            let _ = match room.set(*effect, value, Default::default()) {
                Ok(()) => {
                    let lines = lines_of(&mut size.clone(), effects::keys(*effect));
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
