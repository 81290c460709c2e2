use super::bound::{self, Bound};
use super::{CsvSettings, DecisionSettings, ForeignColumn, Instrument, Rig, effects};
use crate::signal::Signal;
use crate::units::{self, Dimension, FEW_DIGITS, rounded};
use pitchleak_core::EffectSet;
use std::collections::BTreeSet;
use std::fmt::Write;
use toml_edit::{DocumentMut, Item, TableLike};

/// A quantity that reads back to the same number.
fn quantity(value: f64, dimension: Dimension) -> String {
    toml_text(format!("{value} {}", dimension.si()).trim_end())
}

/// A quantity as text, within what the reader takes.
fn within(value: f64, dimension: Dimension, bound: Bound) -> String {
    quantity(bound.nearest(value), dimension)
}

/// As [`within`], in the unit that people read it in where few digits say the same number there.
fn for_people(value: f64, dimension: Dimension, bound: Bound) -> String {
    let si = bound.nearest(value);
    let text = dimension.difference_for_people().and_then(|unit| {
        let text = format!("{} {}", rounded(unit.from_si(si), FEW_DIGITS), unit.text);
        let read = units::parse(&text, dimension).ok()?;
        (read.to_bits() == si.to_bits()).then(|| toml_text(&text))
    });
    text.unwrap_or_else(|| quantity(si, dimension))
}

fn toml_text(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn instrument(key: &str, sheet: &Instrument, dimension: Dimension, scale: Bound) -> String {
    let full_scale = within(sheet.full_scale, dimension, scale);
    format!("{key} = {{ full_scale = {full_scale}, {} }}\n", shares(sheet))
}

fn shares(sheet: &Instrument) -> String {
    let [accuracy, bias, gain] =
        [sheet.accuracy, sheet.bias, sheet.gain].map(|share| bound::SHARE.nearest(share));
    let drift = bound::DRIFT_PER_HOUR.nearest(sheet.drift);
    format!("accuracy = {accuracy:?}, bias = {bias:?}, gain = {gain:?}, drift = {drift:?}")
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
        let mut out = String::new();
        self.write_machine(&mut out);
        self.write_settings(&mut out);
        self.write_decision(&mut out);
        self.write_columns(&mut out);
        self.write_csv(&mut out);
        self.write_effects(&mut out);
        self.write_valve(&mut out);
        out
    }

    fn write_machine(&self, out: &mut String) {
        let cylinder = &self.cylinder;
        let keys = [
            ("area_a", cylinder.area_a_m2, Dimension::Area, bound::AREA),
            ("area_b", cylinder.area_b_m2, Dimension::Area, bound::AREA),
            ("stroke", cylinder.stroke_m, Dimension::Length, bound::STROKE),
            ("moving_mass", cylinder.moving_mass_kg, Dimension::Mass, bound::MOVING_MASS),
            ("dead_volume_a", cylinder.dead_volume_a_m3, Dimension::Volume, bound::DEAD_VOLUME),
            ("dead_volume_b", cylinder.dead_volume_b_m3, Dimension::Volume, bound::DEAD_VOLUME),
        ];
        out.push_str("[cylinder]\n");
        put(out, &keys.map(|(key, value, dimension, bound)| (key, Some(within(value, dimension, bound)))));
        out.push_str("\n[fluid]\n");
        let pressure = |value, bound| Some(within(value, Dimension::Pressure, bound));
        put(
            out,
            &[
                ("bulk_modulus", pressure(self.fluid.bulk_modulus_pa, bound::BULK_MODULUS)),
                ("bulk_modulus_std", pressure(self.fluid.bulk_modulus_std_pa, bound::BULK_MODULUS_STD)),
            ],
        );
        let sheets = &self.instruments;
        out.push_str("\n[sensors]\n");
        out.push_str(&instrument("flow_a", &sheets.flow_a, Dimension::Flow, bound::FLOW_SCALE));
        out.push_str(&instrument("flow_b", &sheets.flow_b, Dimension::Flow, bound::FLOW_SCALE));
        out.push_str(&instrument("pressure", &sheets.pressure, Dimension::Pressure, bound::PRESSURE_SCALE));
        out.push_str(&instrument("position", &sheets.position, Dimension::Length, bound::POSITION_SCALE));
        out.push_str(&instrument("force", &sheets.force, Dimension::Force, bound::FORCE_SCALE));
        if self.valve.is_some() {
            let supply = instrument("supply", &sheets.supply, Dimension::Pressure, bound::PRESSURE_SCALE);
            let _ = writeln!(out, "{supply}spool = {{ {} }}", shares(&sheets.spool));
        }
    }

    fn write_settings(&self, out: &mut String) {
        let estimator = &self.estimator;
        let seconds = |value: Option<f64>, bound| value.map(|v| within(v, Dimension::Time, bound));
        let number = |value: Option<f64>, bound: Bound| value.map(|v| format!("{:?}", bound.nearest(v)));
        let cutoff = |v| within(v, Dimension::Frequency, bound::CUTOFF);
        out.push_str("\n[estimator]\n");
        put(
            out,
            &[
                ("kind", Some(toml_text(estimator.kind.name()))),
                ("forgetting_time", seconds(estimator.forgetting_time_s, bound::MEMORY)),
                ("filter_cutoff", estimator.filter_cutoff_hz.map(cutoff)),
                ("block_time", seconds(estimator.block_time_s, bound::MEMORY)),
                ("gains.lambda", number(estimator.lambda_per_s, bound::GAIN)),
                ("gains.gamma", number(estimator.gamma, bound::GAIN)),
            ],
        );
        let threshold = self.alarms.threshold_m3s;
        let most = bound::FLOW_SCALE.nearest(self.instruments.largest_flow_m3s());
        let flow = |value| Some(within(value, Dimension::Flow, bound::threshold(most)));
        out.push_str("\n[alarms]\n");
        put(
            out,
            &[
                ("internal", flow(threshold.internal)),
                ("external_a", flow(threshold.external_a)),
                ("external_b", flow(threshold.external_b)),
                ("hysteresis", number(Some(1.0 - self.alarms.clear_share), bound::SHARE)),
                ("hold_time", seconds(Some(self.alarms.hold_time_s), bound::HOLD_TIME)),
            ],
        );
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
        if self.csv == CsvSettings::default() {
            return;
        }
        let CsvSettings { delimiter, decimal, time, part: _ } = &self.csv;
        out.push_str("\n[csv]\n");
        put(
            out,
            &[
                ("delimiter", delimiter.map(|delimiter| toml_text(delimiter.name()))),
                ("decimal", decimal.map(|decimal| toml_text(decimal.name()))),
                ("time_format", time.as_ref().map(|time| toml_text(&time.kind.to_string()))),
                ("zone", time.as_ref().and_then(|time| Some(toml_text(&time.zone.as_ref()?.to_string())))),
            ],
        );
    }

    fn write_valve(&self, out: &mut String) {
        let Some(valve) = &self.valve else { return };
        let share = |value: f64| Some(format!("{value:?}"));
        let with = |value, dimension| Some(quantity(value, dimension));
        out.push_str("\n[valve]\n");
        put(
            out,
            &[
                ("rated_flow", with(valve.rated_flow_m3s, Dimension::Flow)),
                ("rated_drop", with(valve.rated_drop_pa, Dimension::Pressure)),
                ("gain_std", share(valve.gain_std)),
                ("lap", share(valve.lap)),
                ("lap_std", share(valve.lap_std)),
                ("null_leak", share(valve.null_leak)),
                ("stroke", valve.stroke_m.and_then(|stroke_m| with(stroke_m, Dimension::Length))),
                ("shut", valve.shut_below.map(|share| toml_text(&format!("below {share:?}")))),
                ("hysteresis", share(valve.hysteresis)),
                ("spool_lag", with(valve.spool_lag_s, Dimension::Time)),
                ("drift.gain", share(valve.drift.gain)),
                ("drift.lap", share(valve.drift.lap)),
                ("drift.null_leak", share(valve.drift.null_leak)),
                ("supply", valve.supply_pa.and_then(|pressure| with(pressure, Dimension::Pressure))),
                ("supply_std", with(valve.supply_std_pa, Dimension::Pressure)),
                ("tank", with(valve.tank_pa, Dimension::Pressure)),
                ("calibration", valve.calibration.as_deref().map(toml_text)),
            ],
        );
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
                (spec.id, Bound::between(spec.lower, spec.upper).nearest(size.constants.get(*constant)))
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
            let _ = write!(out, ", offset = {}", for_people(self.offset, dimension, bound::OFFSET));
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

fn put(out: &mut String, keys: &[(&str, Option<String>)]) {
    for (key, value) in keys {
        if let Some(value) = value {
            let _ = writeln!(out, "{key} = {value}");
        }
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
