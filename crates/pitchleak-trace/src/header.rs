//! What a foreign header says: a signal by its name, a unit behind it.

use crate::signal::Signal;
use crate::units::{self, Dimension, Unit};
use pitchleak_core::ATMOSPHERE_PA;

/// A unit as it stands in a header.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeaderUnit {
    /// The unit.
    pub unit: Unit,
    /// What makes an absolute pressure a gauge pressure, Pa; else 0.
    pub offset_si: f64,
}

/// Other spellings of units, in small letters.
const SPELLINGS: [(&str, &[&str]); 11] = [
    ("s", &["sec", "secs", "second", "seconds", "sek", "sekunden"]),
    ("ms", &["msec", "millis", "milliseconds"]),
    ("us", &["µs", "μs", "usec", "microseconds"]),
    ("m", &["meter", "metre"]),
    ("mm", &["millimeter", "millimetre"]),
    ("Pa", &["pascal"]),
    ("L/min", &["ltr/min", "lit/min", "liter/min", "litre/min", "l/m"]),
    ("gpm", &["usgpm"]),
    ("N", &["newton"]),
    ("°C", &["deg c", "deg. c", "celsius", "℃"]),
    ("K", &["kelvin"]),
];

impl HeaderUnit {
    /// The unit of this spelling, capitals or not; pressures are gauge but where they say that they are absolute.
    pub fn by_name(text: &str, dimension: Dimension) -> Option<Self> {
        let text = text.trim();
        if let Some(unit) = spelt(text, dimension) {
            return Some(Self { unit, offset_si: 0.0 });
        }
        if dimension != Dimension::Pressure {
            return None;
        }
        let ends = [
            ("(g)", 0.0),
            ("(a)", 1.0),
            (" gauge", 0.0),
            (" rel", 0.0),
            (" abs", 1.0),
            ("g", 0.0),
            ("a", 1.0),
        ];
        ends.into_iter().find_map(|(end, absolute)| {
            let unit = spelt(text.strip_suffix(end)?.trim(), dimension)?;
            Some(Self { unit, offset_si: -absolute * ATMOSPHERE_PA })
        })
    }

    /// The unit of any dimension.
    pub fn is_known(text: &str) -> bool {
        let dimensions = Signal::ALL.into_iter().filter_map(Signal::dimension);
        dimensions.into_iter().any(|dimension| Self::by_name(text, dimension).is_some())
    }
}

fn spelt(text: &str, dimension: Dimension) -> Option<Unit> {
    if let Ok(unit) = units::unit(text, dimension) {
        return Some(unit);
    }
    let lower = text.to_lowercase();
    if let Some((known, _)) = SPELLINGS.iter().find(|(_, spellings)| spellings.contains(&lower.as_str())) {
        return units::unit(known, dimension).ok();
    }
    // Thousandths are no millions.
    if text.starts_with("mP") || text.starts_with("mN") {
        return None;
    }
    let same = |unit: &&Unit| unit.text.to_lowercase() == lower || unit.suffix == Some(lower.as_str());
    let lower_unit = || units::unit(&lower, dimension).ok();
    dimension.units().iter().find(same).copied().or_else(lower_unit)
}

/// A header that ends with a unit of `dimension`: what is before it, and the unit. `Pressure A [bar]`, `p_A / bar`,
/// `Pressure A, bar`, `pressure_a_bar`.
pub fn split(header: &str, dimension: Dimension) -> Option<(&str, HeaderUnit)> {
    parts(header).find_map(|(name, unit)| Some((name.trim(), HeaderUnit::by_name(unit, dimension)?)))
}

/// The ways to take a header for a name and a unit.
pub fn parts(header: &str) -> impl Iterator<Item = (&str, &str)> {
    let header = header.trim();
    let bracketed = |open: char, close: char| {
        let (name, unit) = header.strip_suffix(close)?.split_once(open)?;
        (!name.trim().is_empty()).then_some((name, unit))
    };
    let behind = |mark: &str| header.rsplit_once(mark);
    let ways = [
        bracketed('[', ']'),
        bracketed('(', ')'),
        bracketed('<', '>'),
        behind(" / "),
        behind(", "),
        behind(" in "),
        behind("_"),
        behind(" "),
    ];
    ways.into_iter().flatten()
}

/// What columns are called beside the names of the contract, letters and digits only, with blanks between the names.
const NAMES: [(Signal, &str); 14] = [
    (Signal::Time, "t time zeit elapsedtime relativetime timesincestart"),
    (Signal::Timestamp, "timestamp datetime dateandtime dateutime datumzeit datumuhrzeit zeitstempel"),
    (Signal::Position, "x position pistonposition cylinderposition kolbenposition kolbenweg"),
    (Signal::Speed, "v pistonspeed pistonvelocity kolbengeschwindigkeit"),
    (
        Signal::PressureA,
        "pa pressurea pressurechambera chamberapressure pressureinchambera drucka druckkammera",
    ),
    (
        Signal::PressureB,
        "pb pressureb pressurechamberb chamberbpressure pressureinchamberb druckb druckkammerb",
    ),
    (Signal::FlowA, "qa flowa flowratea flowintoa volumenstroma durchflussa"),
    (Signal::FlowB, "qb flowb flowrateb flowintob volumenstromb durchflussb"),
    (Signal::Force, "force loadforce"),
    (Signal::Spool, "spool spoolposition valvespool valvespoolposition schieberweg"),
    (Signal::Command, "valvecommand spoolcommand ventilsollwert"),
    (Signal::Supply, "ps supplypressure systempressure systemdruck versorgungsdruck"),
    (Signal::Tank, "pt tankpressure tankdruck"),
    (Signal::Temperature, "temp oiltemperature oiltemp öltemperatur"),
];

/// The signal that a name says without a doubt; its unit is not part of it.
pub fn signal(name: &str) -> Option<Signal> {
    let name = letters(name);
    NAMES.iter().find(|(_, names)| lists(names, &name)).map(|(signal, _)| *signal)
}

/// Whether a list of words, with blanks between them, has this one.
pub(crate) fn lists(words: &str, word: &str) -> bool {
    words.split(' ').any(|one| one == word)
}

/// Small letters and digits only.
pub(crate) fn letters(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// A text from a file as it may stand in a message: one line, and not endless.
pub fn shorten(text: &str, most: usize) -> String {
    let clean: String = text.chars().take(most).flat_map(char::escape_debug).collect();
    let clean = clean.replace("\\'", "'").replace("\\\"", "\"");
    if text.chars().nth(most).is_some() { clean + "…" } else { clean }
}

/// The name among `names` that `name` may be a slip of.
pub fn near<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let likeness =
        |other: &&str| strsim::normalized_damerau_levenshtein(&name.to_lowercase(), &other.to_lowercase());
    let best = names.filter(|other| !other.is_empty()).max_by(|a, b| likeness(a).total_cmp(&likeness(b)))?;
    (likeness(&best) >= 0.7).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_name_signal_and_unit() {
        let cases = [
            ("Pressure A [bar]", Signal::PressureA, "bar", 0.0),
            ("p_A / bar", Signal::PressureA, "bar", 0.0),
            ("Pressure B (MPa)", Signal::PressureB, "MPa", 0.0),
            ("Pressure A, bar", Signal::PressureA, "bar", 0.0),
            ("PRESSURE_A_BAR", Signal::PressureA, "bar", 0.0),
            ("Pressure B [bara]", Signal::PressureB, "bar", -ATMOSPHERE_PA),
            ("Pressure B [bar(g)]", Signal::PressureB, "bar", 0.0),
            ("Druck A in bar", Signal::PressureA, "bar", 0.0),
            ("Flow A [l/min]", Signal::FlowA, "L/min", 0.0),
            ("Flow rate B [m³/h]", Signal::FlowB, "m^3/h", 0.0),
            ("Time [sec]", Signal::Time, "s", 0.0),
            ("Position <mm>", Signal::Position, "mm", 0.0),
            ("Oil temperature [°C]", Signal::Temperature, "°C", 0.0),
        ];
        for (header, expected, unit, offset) in cases {
            let (name, found) =
                split(header, expected.dimension().unwrap()).unwrap_or_else(|| panic!("{header}"));
            assert_eq!((signal(name), found.unit.text), (Some(expected), unit), "{header}");
            assert!((found.offset_si - offset).abs() < 1e-9, "{header}");
        }
    }

    #[test]
    fn what_may_be_another_thing_is_none() {
        for name in ["Head pressure", "Pressure 1", "x_ref", "t_amb", "Ambient temperature", "Flow", "p"] {
            assert_eq!(signal(name), None, "{name}");
        }
        for unit in ["mPa", "atm", "kgf/cm²", "", "V"] {
            assert_eq!(HeaderUnit::by_name(unit, Dimension::Pressure), None, "{unit}");
        }
    }

    #[test]
    fn a_slip_has_a_near_name() {
        let names = ["Head pressure", "Rod pressure", "Flow"];
        assert_eq!(near("Head presure", names.into_iter()), Some("Head pressure"));
        assert_eq!(near("Temperature", names.into_iter()), None);
    }
}
