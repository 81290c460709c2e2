use super::{ForeignColumn, Instrument, Rig};
use crate::signal::Signal;
use crate::units::Dimension;
use std::fmt::Write;

/// A quantity that reads back to the same number.
fn quantity(value: f64, dimension: Dimension) -> String {
    toml_text(format!("{value} {}", dimension.si()).trim_end())
}

fn toml_text(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn instrument(key: &str, sheet: &Instrument, dimension: Dimension) -> String {
    let Instrument { full_scale, accuracy, bias, gain } = sheet;
    let full_scale = quantity(*full_scale, dimension);
    format!(
        "{key} = {{ full_scale = {full_scale}, accuracy = {accuracy:?}, bias = {bias:?}, gain = {gain:?} }}\n"
    )
}

impl Rig {
    /// The rig as a file that reads back to the same numbers. Comments of the file it came from
    /// are not kept.
    pub fn to_toml(&self) -> String {
        let mut out = String::new();
        self.write_machine(&mut out);
        self.write_settings(&mut out);
        self.write_columns(&mut out);
        self.write_effects(&mut out);
        out
    }

    fn write_machine(&self, out: &mut String) {
        let cylinder = &self.cylinder;
        let keys = [
            ("area_a", cylinder.area_a_m2, Dimension::Area),
            ("area_b", cylinder.area_b_m2, Dimension::Area),
            ("stroke", cylinder.stroke_m, Dimension::Length),
            ("moving_mass", cylinder.moving_mass_kg, Dimension::Mass),
            ("dead_volume_a", cylinder.dead_volume_a_m3, Dimension::Volume),
            ("dead_volume_b", cylinder.dead_volume_b_m3, Dimension::Volume),
        ];
        out.push_str("[cylinder]\n");
        put(out, &keys.map(|(key, value, dimension)| (key, Some(quantity(value, dimension)))));
        out.push_str("\n[fluid]\n");
        put(
            out,
            &[
                ("bulk_modulus", Some(quantity(self.fluid.bulk_modulus_pa, Dimension::Pressure))),
                ("bulk_modulus_std", Some(quantity(self.fluid.bulk_modulus_std_pa, Dimension::Pressure))),
            ],
        );
        let sheets = &self.instruments;
        out.push_str("\n[sensors]\n");
        out.push_str(&instrument("flow_a", &sheets.flow_a, Dimension::Flow));
        out.push_str(&instrument("flow_b", &sheets.flow_b, Dimension::Flow));
        out.push_str(&instrument("pressure", &sheets.pressure, Dimension::Pressure));
        out.push_str(&instrument("position", &sheets.position, Dimension::Length));
        out.push_str(&instrument("force", &sheets.force, Dimension::Force));
    }

    fn write_settings(&self, out: &mut String) {
        let estimator = &self.estimator;
        let seconds = |value: Option<f64>| value.map(|v| quantity(v, Dimension::Time));
        let number = |value: Option<f64>| value.map(|v| format!("{v:?}"));
        out.push_str("\n[estimator]\n");
        put(
            out,
            &[
                ("kind", Some(toml_text(estimator.kind.name()))),
                ("forgetting_time", seconds(estimator.forgetting_time_s)),
                ("filter_cutoff", estimator.filter_cutoff_hz.map(|v| quantity(v, Dimension::Frequency))),
                ("block_time", seconds(estimator.block_time_s)),
                ("gains.lambda", number(estimator.lambda_per_s)),
                ("gains.gamma", number(estimator.gamma)),
            ],
        );
        let threshold = self.alarms.threshold_m3s;
        let flow = |value| Some(quantity(value, Dimension::Flow));
        out.push_str("\n[alarms]\n");
        put(
            out,
            &[
                ("internal", flow(threshold.internal)),
                ("external_a", flow(threshold.external_a)),
                ("external_b", flow(threshold.external_b)),
                ("hysteresis", number(Some(1.0 - self.alarms.clear_share))),
                ("hold_time", seconds(Some(self.alarms.hold_time_s))),
            ],
        );
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

    fn write_effects(&self, out: &mut String) {
        if self.effects.is_empty() {
            return;
        }
        out.push_str("\n[effects]\n");
        for (effect, size) in &self.effects {
            let std = size.std.map_or(String::new(), |std| format!(", std = {std:?}"));
            let _ = write!(out, "{effect} = {{ value = {:?}{std}", size.value);
            for parameter in effect.constants() {
                let _ = write!(out, ", {} = {:?}", parameter.spec().id, size.constants.get(*parameter));
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
        if (self.scale - 1.0).abs() > 0.0 {
            let _ = write!(out, ", scale = {:?}", self.scale);
        }
        if let Some(dimension) = signal.dimension().filter(|_| self.offset.abs() > 0.0) {
            let _ = write!(out, ", offset = {}", quantity(self.offset, dimension));
        }
        out + " }"
    }
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
