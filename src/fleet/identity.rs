//! What a trace's path tells: the cylinder, and when it was recorded.

use jiff::Timestamp;
use jiff::civil::{Date, DateTime, Time};
use jiff::tz::TimeZone;
use std::path::{Component, Path};

/// Which cylinder a trace is of, and when it begins.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct TraceIdentity {
    /// Name of the cylinder.
    pub cylinder: String,
    /// Begin of the trace; a time without zone is UTC.
    pub begins: Option<Timestamp>,
}

/// Keys of folders that say when, not what.
const TIMES: [&str; 6] = ["date", "day", "month", "year", "hour", "week"];

impl TraceIdentity {
    /// Folders `key=value`, as partitioned tables have them, name the cylinder by their values: `turbine=T7/blade=B2` is
    /// `T7/B2`. Elsewhere it is the path without ending, date and time: `farm/T7/B2/2026-05-01.csv.gz` is `farm/T7/B2`,
    /// `T7-B2_20260501T0600.csv` is `T7-B2`.
    pub fn of(path: &Path) -> Self {
        let texts: Vec<_> = path.components().filter_map(text).collect();
        let Some((name, folders)) = texts.split_last() else { return Self::default() };
        let stem = without_ending(name);
        let (rest, dated) = split_date(stem);
        let pairs: Vec<_> = folders.iter().filter_map(|folder| folder.split_once('=')).collect();
        let folder_date =
            pairs.iter().find(|(key, _)| *key == "date").and_then(|(_, value)| split_date(value).1);
        let begins = dated.or(folder_date);
        let values: Vec<_> =
            pairs.iter().filter(|(key, _)| !TIMES.contains(key)).map(|(_, value)| *value).collect();
        if !values.is_empty() {
            return Self { cylinder: values.join("/"), begins };
        }
        let folder = path.parent().map(|folder| folder.display().to_string()).unwrap_or_default();
        let cylinder = match (folder.as_str(), rest.as_str()) {
            ("", "") => stem.to_owned(),
            (folder, "") => folder.to_owned(),
            ("", rest) => rest.to_owned(),
            (folder, rest) => format!("{}/{rest}", folder.trim_end_matches('/')),
        };
        Self { cylinder, begins }
    }
}

fn text(component: Component<'_>) -> Option<&str> {
    match component {
        Component::Normal(text) => text.to_str(),
        _ => None,
    }
}

/// A file's name before `.csv`, `.csv.gz`, …
fn without_ending(name: &str) -> &str {
    let is_packed = |(_, ending): &(&str, &str)| ending.eq_ignore_ascii_case("gz");
    let name = name.rsplit_once('.').filter(is_packed).map_or(name, |(packed, _)| packed);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// A name without the date in it, and the date, with the time of day that follows it.
fn split_date(name: &str) -> (String, Option<Timestamp>) {
    let at = |from: usize| {
        let before = name.get(..from)?;
        let after_digit = before.ends_with(|c: char| c.is_ascii_digit());
        let (date, length) = if after_digit { None } else { date(name.get(from..)?) }?;
        let rest = name.get(from + length..)?;
        let (time, length) = time(rest).unwrap_or((Time::midnight(), 0));
        let begins = TimeZone::UTC.to_timestamp(DateTime::from_parts(date, time)).ok()?;
        Some((before, rest.get(length..)?, begins))
    };
    let Some((before, after, begins)) = (0..name.len()).find_map(at) else { return (name.to_owned(), None) };
    let separator = |c: char| "-_. ".contains(c);
    let parts = [before.trim_end_matches(separator), after.trim_start_matches(separator)];
    let parts: Vec<_> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    (parts.join("_"), Some(begins))
}

/// `2026-05-01` or `20260501` at the beginning, and its length.
fn date(text: &str) -> Option<(Date, usize)> {
    let dashed = text.get(4..5) == Some("-") && text.get(7..8) == Some("-");
    let (month, day, length) = if dashed { (5..7, 8..10, 10) } else { (4..6, 6..8, 8) };
    let date = Date::new(number(text.get(..4)?)?, number(text.get(month)?)?, number(text.get(day)?)?).ok()?;
    let more = text.get(length..).is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    ((1950..2150).contains(&date.year()) && !more).then_some((date, length))
}

/// `T06:30:00Z`, `_0630`, `-06-30` at the beginning, and its length.
fn time(text: &str) -> Option<(Time, usize)> {
    let rest = text.strip_prefix(['T', 't', '_', '-', ' '])?;
    let mut fields = Vec::new();
    let mut at = 0;
    while fields.len() < 3 {
        let from = at + usize::from(!fields.is_empty() && rest.get(at..)?.starts_with([':', '-', '.']));
        let Some(field) = rest.get(from..from + 2).and_then(number::<i8>) else { break };
        fields.push(field);
        at = from + 2;
    }
    let more = rest.get(at..)?.starts_with(|c: char| c.is_ascii_alphanumeric() && c != 'Z');
    let time = match fields[..] {
        [hour, minute] => Time::new(hour, minute, 0, 0),
        [hour, minute, second] => Time::new(hour, minute, second, 0),
        _ => return None,
    };
    let zone = usize::from(rest.get(at..)?.starts_with('Z'));
    time.ok().filter(|_| !more).map(|time| (time, 1 + at + zone))
}

/// Digits alone: no sign.
fn number<T: std::str::FromStr>(digits: &str) -> Option<T> {
    digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_names_cylinder_and_date() {
        let known = [
            ("T7.csv", "T7", None),
            ("farm/T7/B2.csv.gz", "farm/T7/B2", None),
            ("farm/T7/B2/2026-05-01.csv.gz", "farm/T7/B2", Some("2026-05-01T00:00:00Z")),
            ("B1/2026-05-01.CSV.GZ", "B1", Some("2026-05-01T00:00:00Z")),
            ("/farm/T7-B2_20260501T063000Z.csv", "/farm/T7-B2", Some("2026-05-01T06:30:00Z")),
            ("2026-05-01_06-30 T7.parquet", "T7", Some("2026-05-01T06:30:00Z")),
            ("2026-05-01.csv", "2026-05-01", Some("2026-05-01T00:00:00Z")),
            ("T7_2026-13-01.csv", "T7_2026-13-01", None),
            ("serial120260501.csv", "serial120260501", None),
            ("p/turbine=T7/blade=B2/date=2026-05-01/part-0.parquet", "T7/B2", Some("2026-05-01T00:00:00Z")),
            ("ü/größe.csv", "ü/größe", None),
        ];
        for (path, cylinder, begins) in known {
            let found = TraceIdentity::of(Path::new(path));
            let begins = begins.map(|text| text.parse().unwrap());
            assert_eq!(found, TraceIdentity { cylinder: cylinder.to_owned(), begins }, "{path}");
        }
    }

    #[test]
    fn no_path_breaks_it() {
        for path in ["", "/", "..", ".", "2", "2026-05-0é", "=", "a=/b=2/x", "20260501T25", "20260501_é"] {
            let _ = TraceIdentity::of(Path::new(path));
        }
    }
}
