use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::{Offset, TimeZone};
use std::fmt;

/// The zone of a clock: `Europe/Berlin`, `CET`, `+01:00`.
#[derive(Clone, Debug, PartialEq)]
pub struct Zone {
    name: String,
    pub(super) zone: TimeZone,
}

/// Abbreviations that mean one offset only, h. CST, IST and BST mean several.
const ABBREVIATIONS: [(&str, i8); 22] = [
    ("Z", 0),
    ("UTC", 0),
    ("GMT", 0),
    ("WET", 0),
    ("WEST", 1),
    ("CET", 1),
    ("MEZ", 1),
    ("CEST", 2),
    ("MESZ", 2),
    ("EET", 2),
    ("EEST", 3),
    ("MSK", 3),
    ("JST", 9),
    ("AEST", 10),
    ("AEDT", 11),
    ("EST", -5),
    ("EDT", -4),
    ("CDT", -5),
    ("MST", -7),
    ("MDT", -6),
    ("PST", -8),
    ("PDT", -7),
];

impl Zone {
    /// Coordinated universal time.
    pub const UTC: Self = Self { name: String::new(), zone: TimeZone::UTC };

    /// The zone of this name, abbreviation or offset.
    pub fn by_name(name: &str) -> Option<Self> {
        let name = name.trim();
        let zone = match offset(name) {
            Some(offset) => TimeZone::fixed(offset),
            None if name.contains('/') => TimeZone::get(name).ok()?,
            None => return None,
        };
        Some(Self { name: name.to_owned(), zone })
    }

    /// The instant at which clocks there show `civil`, ns since 1970; of two the first that is after the last.
    pub(super) fn instant_ns(&self, civil: DateTime, last_ns: Option<i128>) -> Option<i128> {
        let ambiguous = self.zone.to_ambiguous_timestamp(civil);
        let twice = ambiguous.is_ambiguous();
        let first = ambiguous.compatible().ok()?.as_nanosecond();
        if !twice || last_ns.is_none_or(|last_ns| first > last_ns) {
            return Some(first);
        }
        let second: Option<Timestamp> = ambiguous.later().ok();
        second.map(Timestamp::as_nanosecond)
    }
}

/// As it was named.
impl fmt::Display for Zone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.name.is_empty() { "UTC" } else { &self.name })
    }
}

/// `Z`, `CET`, `+01:00`, `+0100`, `+01`, `UTC+1`.
pub(super) fn offset(text: &str) -> Option<Offset> {
    if let Some((_, hours)) = ABBREVIATIONS.iter().find(|(name, _)| *name == text) {
        return Offset::from_hours(*hours).ok();
    }
    let text = text.strip_prefix("UTC").or_else(|| text.strip_prefix("GMT")).unwrap_or(text);
    let (sign, digits) = match text.split_at_checked(1)? {
        ("+", digits) => (1, digits),
        ("-" | "\u{2212}", digits) => (-1, digits),
        _ => return None,
    };
    let (hours, minutes) = match (digits.split_once(':'), digits.len()) {
        (Some(parts), _) => parts,
        (None, 1 | 2) => (digits, "0"),
        (None, 4) => digits.split_at_checked(2)?,
        _ => return None,
    };
    let number =
        |text: &str| text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse::<i32>().ok())?;
    let (hours, minutes) = (number(hours)?, number(minutes)?);
    if hours > 14 || minutes > 59 {
        return None;
    }
    Offset::from_seconds(sign * (hours * 3600 + minutes * 60)).ok()
}
