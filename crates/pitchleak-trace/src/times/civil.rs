//! Dates and times of day as people and loggers write them.

use super::zone::offset;
use super::{DateOrder, Reading};
use jiff::civil::{DateTime, Time};

const NS_PER_S: i128 = 1_000_000_000;
const DAY_NS: i128 = 86_400 * NS_PER_S;

/// `20.11.2026 22:10:31,5`, `11/20/26 10:10:31 PM`, `20-Nov-2026`, each with or without an offset or zone behind it.
pub(super) fn read_date(text: &str, order: DateOrder) -> Option<Reading> {
    let mut scan = Scan(text);
    let date = scan.date()?;
    let (year, month, day) = date.in_order(order)?;
    scan.skip(|c| matches!(c, ' ' | 'T' | ','));
    let time = if scan.0.is_empty() { Clock::default() } else { scan.clock()? };
    scan.skip(|c| c == ' ');
    if time.hour > 23 {
        return None;
    }
    let (hour, minute, second) = (time.hour as i8, time.minute as i8, time.second as i8);
    let civil = DateTime::new(year, month, day, hour, minute, second, time.ns as i32).ok()?;
    if scan.0.is_empty() {
        return Some(Reading::Civil(civil));
    }
    let zone = scan.0.split(['[', ' ']).next().unwrap_or_default();
    let stamp = offset(zone)?.to_timestamp(civil).ok()?;
    Some(Reading::Instant(stamp.as_nanosecond()))
}

/// `22:10:31.5`, `10:10:31 PM`, `0:00:00,01`; hours beyond 23 are time that has passed.
pub(super) fn read_of_day(text: &str) -> Option<i128> {
    if let Some(ns) = minutes_and_seconds(text) {
        return Some(ns);
    }
    let mut scan = Scan(text);
    let time = scan.clock().filter(|time| time.has_seconds)?;
    scan.0.is_empty().then(|| since_midnight_ns([time.hour, time.minute, time.second], time.ns))
}

/// `12:34,5`, as a spreadsheet shows a time that it was given to the tenth of a second; within the hour.
fn minutes_and_seconds(text: &str) -> Option<i128> {
    let (minutes, rest) = text.split_once(':')?;
    let (seconds, fraction) = rest.split_once([',', '.'])?;
    let number = |text: &str, most: usize| {
        let is_number = (1..=most).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
        is_number.then(|| text.parse::<u32>().ok()).flatten()
    };
    let [minute, second] = [number(minutes, 2)?, number(seconds, 2)?];
    let ns = number(fraction, 9)? * 10_u32.pow(9 - fraction.len() as u32);
    (minute < 60 && second < 60).then(|| since_midnight_ns([0, minute, second], ns))
}

pub(super) fn ns_of(time: Time) -> i128 {
    since_midnight_ns([time.hour(), time.minute(), time.second()], time.subsec_nanosecond())
}

fn since_midnight_ns(hours_minutes_seconds: [impl Into<i128>; 3], ns: impl Into<i128>) -> i128 {
    hours_minutes_seconds.into_iter().fold(0, |sum, part| 60 * sum + part.into()) * NS_PER_S + ns.into()
}

/// A time of day on the day of the last one, or the next where it would be half a day back.
pub(super) fn after_midnights(ns: i128, last_ns: Option<i128>) -> i128 {
    let Some(last_ns) = last_ns.filter(|_| ns < DAY_NS) else { return ns };
    let same_day = last_ns.div_euclid(DAY_NS) * DAY_NS + ns;
    if last_ns - same_day > DAY_NS / 2 { same_day + DAY_NS } else { same_day }
}

/// The first two numbers of a date, where they may be day and month in either order; none where the date says which.
pub(super) fn open_order(text: &str) -> Option<[u32; 2]> {
    match Scan(text).date()?.parts {
        [Part::Number(first, _), Part::Number(second, _), _] => Some([first, second]),
        _ => None,
    }
}

/// Whether a date begins with the year, has points between its numbers, or a month by name: then its order is plain.
pub(super) fn plain_order(text: &str) -> Option<DateOrder> {
    let date = Scan(text).date()?;
    match date.parts {
        [Part::Number(_, 4), ..] => Some(DateOrder::YearMonthDay),
        [Part::Month(_), ..] => Some(DateOrder::MonthDayYear),
        [_, Part::Month(_), _] => Some(DateOrder::DayMonthYear),
        [_, _, Part::Number(_, 4)] if date.points => Some(DateOrder::DayMonthYear),
        _ => None,
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Part {
    /// A number, and how many digits it has.
    Number(u32, usize),
    Month(i8),
}

struct Date {
    parts: [Part; 3],
    /// Points stand between them.
    points: bool,
}

impl Date {
    fn in_order(&self, order: DateOrder) -> Option<(i16, i8, i8)> {
        let [a, b, c] = self.parts;
        let year_first = matches!(a, Part::Number(_, 4));
        let (year, month, day) = match (order, a, b) {
            _ if year_first => (a, b, c),
            (_, Part::Month(_), _) | (DateOrder::MonthDayYear, _, Part::Number(..)) => (c, a, b),
            (DateOrder::DayMonthYear, ..) | (_, _, Part::Month(_)) => (c, b, a),
            (DateOrder::YearMonthDay, ..) => (a, b, c),
        };
        let year = match year {
            Part::Number(year, 4) => year,
            Part::Number(year, 2) => 2000 + year,
            _ => return None,
        };
        let month = match month {
            Part::Number(month, 1 | 2) => i8::try_from(month).ok()?,
            Part::Month(month) => month,
            Part::Number(..) => return None,
        };
        let Part::Number(day, 1 | 2) = day else { return None };
        Some((i16::try_from(year).ok()?, month, i8::try_from(day).ok()?))
    }
}

#[derive(Default)]
struct Clock {
    hour: u32,
    minute: u32,
    second: u32,
    ns: u32,
    has_seconds: bool,
}

/// English and German, by their first three letters.
const MONTHS: [&[&str]; 12] = [
    &["jan", "jän"],
    &["feb"],
    &["mar", "mär", "mrz"],
    &["apr"],
    &["may", "mai"],
    &["jun"],
    &["jul"],
    &["aug"],
    &["sep"],
    &["oct", "okt"],
    &["nov"],
    &["dec", "dez"],
];

/// What is left to read.
struct Scan<'a>(&'a str);

impl<'a> Scan<'a> {
    fn take(&mut self, fits: impl Fn(char) -> bool) -> &'a str {
        let end = self.0.find(|c| !fits(c)).unwrap_or(self.0.len());
        let (taken, rest) = self.0.split_at_checked(end).unwrap_or((self.0, ""));
        self.0 = rest;
        taken
    }

    fn skip(&mut self, fits: impl Fn(char) -> bool) {
        self.take(fits);
    }

    fn number(&mut self) -> Option<(u32, usize)> {
        let digits = self.take(|c| c.is_ascii_digit());
        (1..=4).contains(&digits.len()).then(|| digits.parse().ok().map(|value| (value, digits.len())))?
    }

    fn part(&mut self) -> Option<Part> {
        if self.0.starts_with(|c: char| c.is_ascii_digit()) {
            return self.number().map(|(value, digits)| Part::Number(value, digits));
        }
        let name: String = self.take(char::is_alphabetic).to_lowercase().chars().take(3).collect();
        let month = MONTHS.iter().position(|names| names.contains(&name.as_str()))?;
        i8::try_from(month + 1).ok().map(Part::Month)
    }

    fn date(&mut self) -> Option<Date> {
        let first = self.part()?;
        let between = self.take(|c| matches!(c, '.' | '/' | '-' | ' ' | ','));
        let second = self.part()?;
        let again = self.take(|c| matches!(c, '.' | '/' | '-' | ' ' | ','));
        let third = self.part()?;
        let between_is_short = (1..=2).contains(&between.len()) && (1..=2).contains(&again.len());
        let points = between == "." && again == ".";
        between_is_short.then_some(Date { parts: [first, second, third], points })
    }

    fn clock(&mut self) -> Option<Clock> {
        let (hour, _) = self.number()?;
        let mut clock = Clock { hour, ..Clock::default() };
        self.0 = self.0.strip_prefix(':')?;
        clock.minute = self.number().filter(|(minute, digits)| *minute < 60 && *digits == 2)?.0;
        if let Some(rest) = self.0.strip_prefix(':') {
            self.0 = rest;
            clock.has_seconds = true;
            clock.second = self.number().filter(|(second, digits)| *second < 60 && *digits == 2)?.0;
            if self.0.starts_with(['.', ',', ':']) {
                self.0 = self.0.get(1..)?;
                let digits = self.take(|c| c.is_ascii_digit());
                let kept = digits.get(..digits.len().min(9)).filter(|kept| !kept.is_empty())?;
                clock.ns = kept.parse::<u32>().ok()? * 10_u32.pow(9 - kept.len() as u32);
            }
        }
        let half = self.0.trim_start();
        let half_is = |name: &str| half.get(..2).is_some_and(|word| word.eq_ignore_ascii_case(name));
        if half_is("am") || half_is("pm") {
            if !(1..=12).contains(&clock.hour) {
                return None;
            }
            clock.hour = clock.hour % 12 + if half_is("pm") { 12 } else { 0 };
            self.0 = half.get(2..)?;
        }
        Some(clock)
    }
}
