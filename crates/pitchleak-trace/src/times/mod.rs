//! How a column says the time of day, and its reading: ISO 8601, dates in the order of a country, epochs, the serial
//! numbers of a spreadsheet, or any format with a pattern.
//!
//! Which format the cells of a column have, where they leave no doubt.

mod civil;
#[cfg(test)]
mod tests;
mod zone;

pub use zone::{Clock, Zone};

use crate::header::shorten;
use civil::{open_order, plain_order};
use jiff::Timestamp;
use jiff::civil::{DateTime, date};
use jiff::fmt::strtime::BrokenDownTime;
use std::fmt;

/// How the cells of a column of times are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeFormat {
    /// What stands in a cell.
    pub kind: TimeKind,
    /// Where cells without an offset count; UTC where none is known.
    pub zone: Option<Zone>,
}

/// What stands in a cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum TimeKind {
    /// `2026-11-20T22:10:31.5+01:00`, with or without offset.
    #[default]
    Iso,
    /// Three numbers and a time: `20.11.2026 22:10:31,5`, `11/20/2026 10:10:31.5 PM`, `20-Nov-2026 22:10:31`.
    Date(DateOrder),
    /// `22:10:31.5` without a date; past midnight it counts on.
    OfDay,
    /// A number since 1970: so many nanoseconds each.
    Epoch(u64),
    /// Days since 30 December 1899: the serial number of a spreadsheet.
    Excel,
    /// A pattern of strftime: `%d.%m.%Y %H:%M:%S%.f`.
    Pattern(String),
}

/// In which order a date is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DateOrder {
    /// 20.11.2026
    DayMonthYear,
    /// 11/20/2026
    MonthDayYear,
    /// 2026/11/20
    YearMonthDay,
}

/// A time as a cell says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// An instant, ns since 1970.
    Instant(i128),
    /// A date and a time on the clocks of some place.
    Civil(DateTime),
    /// ns since midnight.
    OfDay(i128),
}

/// Names of formats in rig files and on the command line, beside patterns.
const NAMES: [(&str, TimeKind); 11] = [
    ("iso", TimeKind::Iso),
    ("dmy", TimeKind::Date(DateOrder::DayMonthYear)),
    ("mdy", TimeKind::Date(DateOrder::MonthDayYear)),
    ("ymd", TimeKind::Date(DateOrder::YearMonthDay)),
    ("hms", TimeKind::OfDay),
    ("epoch", TimeKind::Epoch(1_000_000_000)),
    ("epoch s", TimeKind::Epoch(1_000_000_000)),
    ("epoch ms", TimeKind::Epoch(1_000_000)),
    ("epoch us", TimeKind::Epoch(1_000)),
    ("epoch ns", TimeKind::Epoch(1)),
    ("excel", TimeKind::Excel),
];

impl TimeKind {
    /// What [`by_name`](Self::by_name) takes, for messages.
    pub const ALLOWED: &'static str = "iso, dmy, mdy, ymd, hms, epoch s, epoch ms, epoch us, epoch ns, excel, \
                                       or a pattern such as %d.%m.%Y %H:%M:%S%.f";

    /// The kind of this name, or of this pattern.
    pub fn by_name(name: &str) -> Option<Self> {
        if name.contains('%') {
            return Some(Self::Pattern(name.to_owned()));
        }
        NAMES.into_iter().find(|(known, _)| *known == name).map(|(_, kind)| kind)
    }

    /// Reads a cell; none where it is no such time.
    pub fn read(&self, text: &str) -> Option<Reading> {
        match self {
            Self::Iso => read_iso(text),
            Self::Date(order) => civil::read_date(text, *order),
            Self::OfDay => civil::read_of_day(text).map(Reading::OfDay),
            Self::Epoch(ns) => read_epoch(text, *ns).map(Reading::Instant),
            Self::Excel => read_excel(text),
            Self::Pattern(pattern) => read_pattern(text, pattern),
        }
    }
}

/// As the name or pattern that gives it back.
impl fmt::Display for TimeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pattern(pattern) => f.write_str(pattern),
            kind => {
                f.write_str(NAMES.iter().rfind(|(_, known)| known == kind).map_or("epoch", |(name, _)| name))
            }
        }
    }
}

impl TimeFormat {
    /// Behind its kind, where the zone is known.
    pub(crate) fn zone_text(&self) -> String {
        self.zone.as_ref().map(|zone| format!(" in {zone}")).unwrap_or_default()
    }

    /// The instant of a reading, ns since 1970, or since the first midnight where there is no date; `last_ns` is the
    /// instant before. Where clocks were set back, an hour comes twice: then it is the one that is after the last.
    pub(crate) fn instant_ns(&self, reading: Reading, last_ns: Option<i128>) -> Option<i128> {
        match reading {
            Reading::Instant(ns) => Some(ns),
            Reading::OfDay(ns) => Some(civil::after_midnights(ns, last_ns)),
            Reading::Civil(civil) => match &self.zone {
                None => Zone::UTC.instant_ns(civil, last_ns),
                Some(zone) => zone.instant_ns(civil, last_ns),
            },
        }
    }
}

fn read_iso(text: &str) -> Option<Reading> {
    if let Ok(stamp) = text.parse::<Timestamp>() {
        return Some(Reading::Instant(stamp.as_nanosecond()));
    }
    text.parse().ok().map(Reading::Civil)
}

/// Digits as they stand: a double keeps the seconds of an epoch to a quarter of a microsecond only.
fn read_epoch(text: &str, unit_ns: u64) -> Option<i128> {
    if text.bytes().any(|byte| byte == b'e' || byte == b'E') {
        let value = fast_float2::parse::<f64, _>(text).ok().filter(|value| value.abs() < 1e20)?;
        return Some((value * unit_ns as f64).round() as i128);
    }
    let (whole, rest) = text.split_once(['.', ',']).unwrap_or((text, ""));
    let negative = whole.starts_with('-');
    let digits = whole.strip_prefix(['-', '+']).unwrap_or(whole);
    let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if digits.is_empty() || digits.len() > 20 || !is_digits(digits) || !is_digits(rest) {
        return None;
    }
    let fraction = rest.get(..rest.len().min(18)).unwrap_or_default();
    let fraction_ns = match fraction.parse::<i128>() {
        Ok(value) => value * i128::from(unit_ns) / 10_i128.pow(fraction.len() as u32),
        Err(_) => 0,
    };
    let ns = digits.parse::<i128>().ok()? * i128::from(unit_ns) + fraction_ns;
    (ns < i128::from(i64::MAX)).then_some(if negative { -ns } else { ns })
}

/// The clock of the place where it was written, to the microsecond: a double holds no more.
fn read_excel(text: &str) -> Option<Reading> {
    let text = text.replace(',', ".");
    let days = fast_float2::parse::<f64, _>(text.as_bytes())
        .ok()
        .filter(|days| (1.0..2_958_466.0).contains(days))?;
    let us = (days * 86_400e6).round() as i64;
    let first = date(1899, 12, 30).at(0, 0, 0, 0);
    first.checked_add(jiff::Span::new().try_microseconds(us).ok()?).ok().map(Reading::Civil)
}

fn read_pattern(text: &str, pattern: &str) -> Option<Reading> {
    let broken = BrokenDownTime::parse(pattern, text).or_else(|error| match text.rsplit_once(',') {
        // A decimal comma before the fraction of a second.
        Some((whole, fraction)) => BrokenDownTime::parse(pattern, format!("{whole}.{fraction}")),
        None => Err(error),
    });
    let broken = broken.ok()?;
    if broken.offset().is_some() {
        return broken.to_timestamp().ok().map(|stamp| Reading::Instant(stamp.as_nanosecond()));
    }
    match (broken.to_datetime(), broken.to_time()) {
        (Ok(civil), _) => Some(Reading::Civil(civil)),
        (Err(_), Ok(time)) => Some(Reading::OfDay(civil::ns_of(time))),
        _ => None,
    }
}

/// Why the cells of a column do not say how they are to be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TimeFault {
    /// 03/04/2026.
    #[error("`{0}` may be day/month or month/day")]
    DayOrMonth(String),
    /// Neither can be all of them.
    #[error("`{day_first}` is day/month and `{month_first}` month/day: no one order fits")]
    BothOrders {
        /// A date with a day above 12 first.
        day_first: String,
        /// A date with a day above 12 second.
        month_first: String,
    },
    /// A number that no epoch and no serial number has.
    #[error("`{0}` is a number that says neither its unit nor its epoch")]
    BareNumber(String),
    /// Nothing known.
    #[error("`{0}` is no time in a known format")]
    Unknown(String),
}

/// So much of the cells must fit: a few may be bad.
const MOST: f64 = 0.8;
/// Steps of a serial number are below this, days (4 s); those of seconds above.
const LONGEST_SERIAL_STEP: f64 = 5e-5;

/// The format of a column's first cells, none of which is empty.
///
/// # Errors
/// Where they do not say it.
pub fn guess(cells: &[&str]) -> Result<TimeFormat, TimeFault> {
    let kind = number(cells)
        .or_else(|| first_that_fits(cells).map(Ok))
        .or_else(|| date_order(cells))
        .unwrap_or_else(|| Err(TimeFault::Unknown(sample(cells))))?;
    Ok(TimeFormat { kind, zone: None })
}

fn sample(cells: &[&str]) -> String {
    cells.first().map_or_else(String::new, |cell| shorten(cell, 40))
}

fn fits(cells: &[&str], reads: impl Fn(&str) -> bool) -> bool {
    let good = cells.iter().filter(|cell| reads(cell)).count();
    good > 0 && good as f64 >= MOST * cells.len() as f64
}

fn first_that_fits(cells: &[&str]) -> Option<TimeKind> {
    [TimeKind::Iso, TimeKind::OfDay].into_iter().find(|kind| fits(cells, |cell| kind.read(cell).is_some()))
}

fn number(cells: &[&str]) -> Option<Result<TimeKind, TimeFault>> {
    let value = |cell: &&str| fast_float2::parse::<f64, _>(cell.replace(',', ".").as_bytes()).ok();
    if !fits(cells, |cell| value(&cell).is_some()) {
        return None;
    }
    let values: Vec<f64> = cells.iter().filter_map(value).collect();
    let (least, most) =
        values.iter().fold((f64::MAX, f64::MIN), |(least, most), v| (least.min(*v), most.max(*v)));
    // From 1973 to 2128, in four units that are a thousand apart.
    for unit_ns in [1_000_000_000, 1_000_000, 1_000, 1] {
        let per_s = 1e9 / unit_ns as f64;
        if least > 1e8 * per_s && most < 5e9 * per_s {
            return Some(Ok(TimeKind::Epoch(unit_ns)));
        }
    }
    // From 1954 to 2119.
    let mut steps: Vec<f64> = values
        .windows(2)
        .filter_map(|pair| Some(pair.get(1)? - pair.first()?))
        .filter(|step| *step > 0.0)
        .collect();
    steps.sort_by(f64::total_cmp);
    let step = steps.get(steps.len() / 2);
    if least > 20_000.0 && most < 80_000.0 && step.is_some_and(|step| *step < LONGEST_SERIAL_STEP) {
        return Some(Ok(TimeKind::Excel));
    }
    Some(Err(TimeFault::BareNumber(sample(cells))))
}

fn date_order(cells: &[&str]) -> Option<Result<TimeKind, TimeFault>> {
    if !fits(cells, |cell| open_order(cell).is_some() || plain_order(cell).is_some()) {
        return None;
    }
    let reads = |order| fits(cells, |cell| TimeKind::Date(order).read(cell).is_some());
    if let Some(order) = cells.iter().find_map(|cell| plain_order(cell)) {
        return reads(order).then_some(Ok(TimeKind::Date(order)));
    }
    let above_12 = |place: usize| {
        let number = |cell: &&&str| open_order(cell).and_then(|numbers| numbers.get(place).copied());
        cells.iter().find(|cell| number(cell).is_some_and(|number| (13..=31).contains(&number)))
    };
    let order = match (above_12(0), above_12(1)) {
        (Some(_), None) => DateOrder::DayMonthYear,
        (None, Some(_)) => DateOrder::MonthDayYear,
        (None, None) => match settled_by_midnight(cells) {
            Some(order) => order,
            None => return Some(Err(TimeFault::DayOrMonth(sample(cells)))),
        },
        (Some(day_first), Some(month_first)) => {
            let (day_first, month_first) = (sample(&[day_first]), sample(&[month_first]));
            return Some(Err(TimeFault::BothOrders { day_first, month_first }));
        }
    };
    reads(order).then_some(Ok(TimeKind::Date(order)))
}

/// Past a midnight one order goes on by a step, and the other leaps by a month.
fn settled_by_midnight(cells: &[&str]) -> Option<DateOrder> {
    const HOUR_NS: i128 = 3_600_000_000_000;
    let longest_step = |order| {
        let format = TimeFormat { kind: TimeKind::Date(order), zone: None };
        let read = |cell: &&str| format.instant_ns(format.kind.read(cell)?, None);
        let times: Vec<i128> = cells.iter().filter_map(read).collect();
        let step = |pair: &[i128]| Some((pair.get(1)? - pair.first()?).abs());
        times.windows(2).filter_map(step).max()
    };
    let (dmy, mdy) = (longest_step(DateOrder::DayMonthYear)?, longest_step(DateOrder::MonthDayYear)?);
    if dmy < HOUR_NS && mdy > 24 * HOUR_NS {
        Some(DateOrder::DayMonthYear)
    } else if mdy < HOUR_NS && dmy > 24 * HOUR_NS {
        Some(DateOrder::MonthDayYear)
    } else {
        None
    }
}
