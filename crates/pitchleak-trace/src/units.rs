//! Quantities in text ("12.6 cm^2", "20 L/min", "1 %") and the units of trace columns, to SI.
//!
//! Every unit but those of inch and pound converts by a factor or a divisor that a double holds exactly, with one
//! rounding: the same quantity in two units differs by at most two units in the last place.

pub use pitchleak_core::LPM_PER_M3S;

/// 1 m³/(s·Pa) in L/min/bar.
pub const LPM_PER_BAR: f64 = LPM_PER_M3S * 1e5;

/// Seconds of a day.
pub const S_PER_DAY: f64 = 86_400.0;

/// Factor from the SI unit of an effect's value to the unit that people use, and that unit.
pub fn effect_unit(si: &str) -> (f64, &str) {
    match si {
        "1" => (100.0, "%"),
        "Pa" => (1e-5, "bar"),
        "m" => (1e3, "mm"),
        "m/s" => (1e3, "mm/s"),
        "m2" => (1e6, "mm²"),
        "m3" => (1e6, "ml"),
        "m3/s" => (LPM_PER_M3S, "L/min"),
        "m3/(s*Pa)" => (LPM_PER_BAR, "L/min/bar"),
        "m3/(s*Pa*K)" => (LPM_PER_BAR, "L/min/bar/K"),
        "m3/(s*Pa*s)" => (3600.0 * LPM_PER_BAR, "L/min/bar/h"),
        "m3/s2" => (3600.0 * LPM_PER_M3S, "L/min/h"),
        "m3/(s*sqrt(Pa))" => (LPM_PER_M3S * 1e5_f64.sqrt(), "L/min/√bar"),
        "Pa*s/m3" => (1e-5 / LPM_PER_M3S, "bar/(L/min)"),
        "s" => (1e3, "ms"),
        other => (1.0, other),
    }
}

/// What a quantity measures; each has its list of accepted units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// m²
    Area,
    /// m
    Length,
    /// m³
    Volume,
    /// kg
    Mass,
    /// Pa
    Pressure,
    /// m³/s
    Flow,
    /// N
    Force,
    /// m/s
    Speed,
    /// s
    Time,
    /// Hz
    Frequency,
    /// K
    Temperature,
    /// A plain number or a share of something, 1.
    Share,
    /// Position of a spool: a share of its stroke, 1; or a length, m, which the stroke makes a share.
    Spool,
}

/// One accepted unit: SI value = value · `factor` / `divisor` + `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// As written in a rig file, e.g. `L/min`.
    pub text: &'static str,
    /// As the suffix of a trace column, e.g. `lpm`; none where the contract has no such column.
    pub suffix: Option<&'static str>,
    factor: f64,
    divisor: f64,
    offset: f64,
}

impl Unit {
    /// A value in this unit, in SI.
    #[inline(always)]
    pub fn to_si(&self, value: f64) -> f64 {
        value * self.factor / self.divisor + self.offset
    }

    /// The unit of numbers that give `scale` times the quantity less `offset` (SI): what a column's own scale and
    /// offset make of its unit.
    #[must_use]
    pub fn scaled(self, scale: f64, offset: f64) -> Self {
        Self { factor: self.factor * scale, offset: self.offset * scale + offset, ..self }
    }

    /// How many of `other` one of this unit is; offsets do not count.
    pub fn over(&self, other: &Self) -> f64 {
        self.factor / self.divisor * (other.divisor / other.factor)
    }

    /// A value in SI, in this unit.
    pub fn from_si(&self, value: f64) -> f64 {
        (value - self.offset) * self.divisor / self.factor
    }

    /// Whether it is a length.
    pub fn is_length(&self) -> bool {
        LENGTH.iter().any(|length| length.text == self.text)
    }

    /// Whether the unit is the SI unit itself.
    #[allow(clippy::float_cmp)]
    pub(crate) fn is_si(&self) -> bool {
        self.factor == 1.0 && self.divisor == 1.0 && self.offset == 0.0
    }
}

/// Error returned by [`parse`] and [`unit()`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// The text does not start with a finite number.
    #[error("`{text}` is not a quantity; write a number and one of: {allowed}")]
    NotANumber {
        /// The whole text.
        text: String,
        /// The units accepted.
        allowed: String,
    },
    /// The unit is unknown, or measures something else.
    #[error("unit `{unit}` is not one of: {allowed}")]
    Unit {
        /// The unit as written.
        unit: String,
        /// The units accepted.
        allowed: String,
    },
}

const fn unit_of(
    text: &'static str,
    suffix: Option<&'static str>,
    factor: f64,
    divisor: f64,
    offset: f64,
) -> Unit {
    Unit { text, suffix, factor, divisor, offset }
}

const fn times(text: &'static str, suffix: Option<&'static str>, factor: f64) -> Unit {
    unit_of(text, suffix, factor, 1.0, 0.0)
}

const fn over(text: &'static str, suffix: Option<&'static str>, divisor: f64) -> Unit {
    unit_of(text, suffix, 1.0, divisor, 0.0)
}

const AREA: &[Unit] = &[times("m^2", None, 1.0), over("cm^2", None, 1e4), over("mm^2", None, 1e6)];
const LENGTH: &[Unit] = &[
    times("m", Some("m"), 1.0),
    over("cm", None, 1e2),
    over("mm", Some("mm"), 1e3),
    times("in", None, 0.0254),
];
const VOLUME: &[Unit] = &[
    times("m^3", None, 1.0),
    over("dm^3", None, 1e3),
    over("L", None, 1e3),
    over("cm^3", None, 1e6),
    over("mL", None, 1e6),
];
const MASS: &[Unit] = &[times("kg", None, 1.0), over("g", None, 1e3), times("t", None, 1e3)];
const PRESSURE: &[Unit] = &[
    times("Pa", Some("pa"), 1.0),
    times("kPa", Some("kpa"), 1e3),
    times("MPa", Some("mpa"), 1e6),
    times("GPa", None, 1e9),
    times("bar", Some("bar"), 1e5),
    times("mbar", None, 1e2),
    // Pound-force (4.4482216152605 N, exact) per square inch.
    times("psi", Some("psi"), 4.448_221_615_260_5 / (0.0254 * 0.0254)),
];
const FLOW: &[Unit] = &[
    times("m^3/s", Some("m3s"), 1.0),
    over("L/min", Some("lpm"), 60e3),
    over("L/s", None, 1e3),
    over("cm^3/s", None, 1e6),
    over("mL/min", None, 60e6),
    over("m^3/h", Some("m3h"), 3600.0),
    // A US gallon is 231 cubic inches.
    unit_of("gal/min", Some("gpm"), 231.0 * 0.0254 * 0.0254 * 0.0254, 60.0, 0.0),
];
const FORCE: &[Unit] = &[times("N", Some("n"), 1.0), times("kN", Some("kn"), 1e3), times("MN", None, 1e6)];
const SPEED: &[Unit] = &[times("m/s", Some("mps"), 1.0), over("mm/s", Some("mmps"), 1e3)];
const TIME: &[Unit] = &[
    times("s", Some("s"), 1.0),
    over("ms", Some("ms"), 1e3),
    over("us", Some("us"), 1e6),
    times("min", None, 60.0),
    times("h", None, 3600.0),
];
const FREQUENCY: &[Unit] = &[times("Hz", None, 1.0), times("kHz", None, 1e3)];
const TEMPERATURE: &[Unit] = &[times("K", Some("k"), 1.0), unit_of("°C", Some("c"), 1.0, 1.0, 273.15)];
const SHARE: &[Unit] = &[times("1", None, 1.0), over("%", Some("percent"), 1e2)];
const SPOOL: &[Unit] = &[SHARE[0], SHARE[1], LENGTH[2]];

impl Dimension {
    /// The accepted units, SI first.
    pub fn units(self) -> &'static [Unit] {
        match self {
            Self::Area => AREA,
            Self::Length => LENGTH,
            Self::Volume => VOLUME,
            Self::Mass => MASS,
            Self::Pressure => PRESSURE,
            Self::Flow => FLOW,
            Self::Force => FORCE,
            Self::Speed => SPEED,
            Self::Time => TIME,
            Self::Frequency => FREQUENCY,
            Self::Temperature => TEMPERATURE,
            Self::Share => SHARE,
            Self::Spool => SPOOL,
        }
    }

    /// The SI unit as text; empty for a plain number.
    pub fn si(self) -> &'static str {
        match self {
            Self::Share | Self::Spool => "",
            other => other.units().first().map_or("", |unit| unit.text),
        }
    }

    fn allowed(self) -> String {
        join(self.units().iter().map(|unit| unit.text))
    }

    /// The unit of this name, as the tables have it.
    pub(crate) fn by_text(self, text: &str) -> Option<Unit> {
        self.units().iter().find(|unit| unit.text == text).copied()
    }

    /// The unit with this column suffix.
    pub fn by_suffix(self, suffix: &str) -> Option<Unit> {
        self.units().iter().find(|unit| unit.suffix == Some(suffix)).copied()
    }

    /// The column suffixes accepted, e.g. `pa, kpa, mpa, bar`.
    pub fn suffixes(self) -> String {
        join(self.units().iter().filter_map(|unit| unit.suffix))
    }

    /// The unit that people read it in.
    pub fn for_people(self) -> Option<Unit> {
        let text = match self {
            Self::Length => "mm",
            Self::Pressure => "bar",
            Self::Flow => "L/min",
            Self::Speed => "mm/s",
            Self::Temperature => "°C",
            Self::Share | Self::Spool => "%",
            other => other.si(),
        };
        self.by_text(text)
    }

    /// The unit that people read a difference of two values in: 5 K more are not 5 °C.
    pub(crate) fn difference_for_people(self) -> Option<Unit> {
        self.for_people().filter(|unit| unit.offset.abs() <= 0.0)
    }

    /// A difference in SI, rounded to [`FEW_DIGITS`] in the unit that people read it in.
    pub fn rounded_difference(self, value: f64) -> f64 {
        let unit = self.difference_for_people();
        unit.map_or(value, |unit| unit.to_si(rounded(unit.from_si(value), FEW_DIGITS)))
    }
}

/// More digits than anybody knows of a sensor, and fewer than arithmetic leaves.
pub const FEW_DIGITS: usize = 9;

/// The number of so many significant digits that is next to `value`.
pub fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value)
}

/// More than this is told by its power of ten: no further digit would count.
const MOST_PLAIN: f64 = 1e15;

/// A number for people: so many significant digits at the most, and no trailing zeros.
pub fn readable(value: f64, digits: i32) -> String {
    if value.abs() < f64::MIN_POSITIVE || !value.is_finite() {
        return "0".to_owned();
    }
    if value.abs() > MOST_PLAIN {
        return format!("{:e}", rounded(value, digits.unsigned_abs() as usize));
    }
    let places = (digits - 1 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.places$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// A span of time in the unit that people would take.
pub fn duration(time_s: f64) -> String {
    const UNITS: [(f64, &str); 3] = [(S_PER_DAY, "days"), (3600.0, "h"), (60.0, "min")];
    let unit = UNITS.into_iter().find(|(unit_s, _)| time_s >= 2.0 * unit_s);
    let (unit_s, name) = unit.unwrap_or((1.0, "s"));
    format!("{:.0} {name}", time_s / unit_s)
}

fn join<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}

/// Spelled as in the tables: `cm²` → `cm^2`, `l/min` → `L/min`.
fn canonical(unit: &str) -> String {
    let unit = unit.replace('²', "^2").replace('³', "^3").replace("m3", "m^3").replace("m2", "m^2");
    match unit.as_str() {
        "l" | "ltr" => "L".to_owned(),
        "l/min" | "lpm" => "L/min".to_owned(),
        "l/s" => "L/s".to_owned(),
        "ml" => "mL".to_owned(),
        "ml/min" => "mL/min".to_owned(),
        "m^3s" => "m^3/s".to_owned(),
        "inch" => "in".to_owned(),
        "C" | "degC" => "°C".to_owned(),
        _ => unit,
    }
}

/// The unit of this name in a rig file; a column suffix (`lpm`, `mpa`) does as well.
pub fn unit(name: &str, dimension: Dimension) -> Result<Unit, UnitError> {
    dimension
        .by_text(&canonical(name))
        .or_else(|| dimension.by_suffix(name))
        .ok_or_else(|| UnitError::Unit { unit: name.to_owned(), allowed: dimension.allowed() })
}

/// Reads a quantity such as `"12.6 cm^2"`; a bare number is SI. The result is finite and in SI.
pub fn parse(text: &str, dimension: Dimension) -> Result<f64, UnitError> {
    let not_a_number =
        || UnitError::NotANumber { text: text.trim().to_owned(), allowed: dimension.allowed() };
    let trimmed = text.trim();
    let (value, length) =
        fast_float2::parse_partial::<f64, _>(trimmed.as_bytes()).map_err(|_| not_a_number())?;
    let name = trimmed.get(length..).ok_or_else(not_a_number)?.trim();
    let si = match name {
        "" => value,
        _ => unit(name, dimension)?.to_si(value),
    };
    if si.is_finite() { Ok(si) } else { Err(not_a_number()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    #[allow(clippy::float_cmp)]
    fn rig_file_quantities_are_exact() {
        let cases = [
            ("12.6 cm^2", Dimension::Area, 1.26e-3),
            ("12.6 cm²", Dimension::Area, 1.26e-3),
            ("0.8 GPa", Dimension::Pressure, 0.8e9),
            ("20 L/min", Dimension::Flow, 20.0 / 60_000.0),
            ("20l/min", Dimension::Flow, 20.0 / 60_000.0),
            ("1 %", Dimension::Share, 0.01),
            ("75 mm", Dimension::Length, 0.075),
            ("0.02 l", Dimension::Volume, 0.02e-3),
            ("10 kN", Dimension::Force, 10e3),
            (" 1.5e-3 ", Dimension::Area, 1.5e-3),
            ("25 °C", Dimension::Temperature, 298.15),
        ];
        for (text, dimension, si) in cases {
            assert_eq!(parse(text, dimension), Ok(si), "{text}");
        }
    }

    #[test]
    fn people_read_few_digits() {
        let cases = [
            (83_091_022.899_999_99, "83091023"),
            (830.910_228_999, "830.91"),
            (-0.25, "-0.25"),
            (1e15, "1000000000000000"),
            (-1.234_567e302, "-1.2346e302"),
            (1e-9, "0.000000001"),
            (0.0, "0"),
        ];
        for (value, text) in cases {
            assert_eq!(readable(value, 5), text);
        }
        for dimension in [Dimension::Pressure, Dimension::Length, Dimension::Flow, Dimension::Temperature] {
            let unit = dimension.for_people().unwrap();
            assert!((unit.to_si(unit.from_si(300.0)) - 300.0).abs() < 1e-9);
        }
    }

    #[test]
    fn errors_name_the_units_allowed() {
        let error = parse("12.6 cm", Dimension::Area).unwrap_err();
        assert_eq!(error.to_string(), "unit `cm` is not one of: m^2, cm^2, mm^2");
        for text in ["", "cm^2", "nan", "inf m", "1e999", "-", "1 2 m"] {
            assert!(parse(text, Dimension::Length).is_err(), "{text:?}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_a_value_or_an_error(text in ".{0,20}") {
            if let Ok(value) = parse(&text, Dimension::Flow) {
                prop_assert!(value.is_finite());
            }
        }

        #[test]
        fn every_unit_scales(value in 1e-6..1e6f64) {
            for dimension in [Dimension::Area, Dimension::Volume, Dimension::Pressure, Dimension::Flow] {
                for unit in dimension.units() {
                    let si = parse(&format!("{value:e} {}", unit.text), dimension).unwrap();
                    let twice = parse(&format!("{:e} {}", 2.0 * value, unit.text), dimension).unwrap();
                    prop_assert!((twice - 2.0 * si).abs() <= 1e-15 * twice);
                }
            }
        }
    }
}
