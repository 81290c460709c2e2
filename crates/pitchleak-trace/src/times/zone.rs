use super::{TimeFormat, TimeKind};
use crate::header::lists;
use jiff::civil::DateTime;
use jiff::tz::{Offset, TimeZone};
use jiff::{SignedDuration, Timestamp, Zoned};
use serde::{Serialize, Serializer};
use std::fmt;

/// The zone of a clock: `Europe/Berlin`, `CET`, `+01:00`.
#[derive(Clone, Debug, PartialEq)]
pub struct Zone {
    name: String,
    pub(super) zone: TimeZone,
}

/// Abbreviations that mean one offset only, h; blanks between them. CST, IST and BST mean several.
const ABBREVIATIONS: [(i8, &str); 12] = [
    (0, "Z UTC GMT WET"),
    (1, "WEST CET MEZ"),
    (2, "CEST MESZ EET"),
    (3, "EEST MSK"),
    (9, "JST"),
    (10, "AEST"),
    (11, "AEDT"),
    (-4, "EDT"),
    (-5, "EST CDT"),
    (-6, "MDT"),
    (-7, "MST PDT"),
    (-8, "PST"),
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
    if let Some((hours, _)) = ABBREVIATIONS.iter().find(|(_, names)| lists(names, text)) {
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

/// The clock that a trace's time stamps are read from: what it shows where the trace's seconds begin, and later.
#[derive(Clone, Debug, PartialEq)]
pub struct Clock {
    start: Zoned,
    /// Whether it knows the date, and not only the time of day.
    dated: bool,
}

impl Clock {
    /// Of stamps in `format`, the first of them at `first_ns` since 1970 (without a date: since midnight); none beyond the
    /// calendar.
    pub fn new(first_ns: i64, format: &TimeFormat) -> Option<Self> {
        let instant = Timestamp::from_nanosecond(i128::from(first_ns)).ok()?;
        let dated = format.kind != TimeKind::OfDay;
        let zone = format.zone.clone().filter(|_| dated).unwrap_or(Zone::UTC);
        Some(Self { start: instant.to_zoned(zone.zone), dated })
    }

    /// The instant at which the trace's seconds begin; none where only the time of day is known.
    pub fn start(&self) -> Option<Timestamp> {
        self.dated.then(|| self.start.timestamp())
    }

    /// What it shows `t_s` later.
    fn at(&self, t_s: f64) -> Option<Zoned> {
        self.start.checked_add(SignedDuration::try_from_secs_f64(t_s).ok()?).ok()
    }

    /// The time of day `t_s` after the start, with the day where the trace's `duration_s` reaches into another one; to the
    /// minute where that is an hour or longer, else to the second.
    pub fn text(&self, t_s: f64, duration_s: f64) -> String {
        let (Some(at), Some(end)) = (self.at(t_s), self.at(duration_s)) else {
            return format!("{t_s:.1} s");
        };
        let time = if duration_s < 3600.0 { "%H:%M:%S" } else { "%H:%M" };
        let day = match (self.dated, self.start.date() == end.date()) {
            (_, true) => "",
            (true, false) => "%-d %b ",
            (false, false) if at.date() == self.start.date() => "",
            (false, false) => "next day ",
        };
        at.strftime(&format!("{day}{time}")).to_string()
    }

    /// The time of day at which the trace's seconds begin, s since midnight.
    pub fn since_midnight_s(&self) -> f64 {
        let time = self.start.time();
        let seconds =
            3600 * i32::from(time.hour()) + 60 * i32::from(time.minute()) + i32::from(time.second());
        f64::from(seconds) + f64::from(time.subsec_nanosecond()) / 1e9
    }

    /// When the trace's seconds begin, with date and zone where they are known.
    pub fn start_text(&self) -> String {
        let format = if self.dated { "%Y-%m-%d %H:%M:%S %Z" } else { "%H:%M:%S" };
        self.start.strftime(format).to_string()
    }
}

/// As RFC 3339 has it; a time of day alone as `08:14:20`.
impl Serialize for Clock {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let format = if self.dated { "%Y-%m-%dT%H:%M:%S%.f%:z" } else { "%H:%M:%S%.f" };
        serializer.collect_str(&self.start.strftime(format))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVENING_NS: i64 = 1_763_676_631_500_000_000;

    fn clock(format: TimeFormat, first_ns: i64) -> Clock {
        Clock::new(first_ns, &format).expect("a time of the calendar")
    }

    #[test]
    fn the_clock_of_the_place_is_shown() {
        let berlin = TimeFormat { zone: Zone::by_name("Europe/Berlin"), ..TimeFormat::default() };
        let clock = clock(berlin, EVENING_NS);
        assert_eq!(clock.start_text(), "2025-11-20 23:10:31 CET");
        assert_eq!(serde_json::to_string(&clock).unwrap(), "\"2025-11-20T23:10:31.5+01:00\"");
        assert_eq!(clock.text(60.0, 600.0), "23:11:31");
        assert_eq!(clock.text(3600.0, 86_400.0), "21 Nov 00:10");
    }

    #[test]
    fn a_time_of_day_has_no_date() {
        let format = TimeFormat { kind: TimeKind::OfDay, zone: None };
        let clock = clock(format, 23 * 3_600_000_000_000);
        assert_eq!(clock.start(), None);
        assert_eq!(serde_json::to_string(&clock).unwrap(), "\"23:00:00\"");
        assert_eq!([0.0, 7200.0].map(|t_s| clock.text(t_s, 7200.0)), ["23:00", "next day 01:00"]);
    }

    #[test]
    fn no_time_is_beyond_the_calendar() {
        let clock = clock(TimeFormat::default(), i64::MAX);
        assert_eq!(clock.text(1e300, 1e300), format!("{:.1} s", 1e300));
    }
}
