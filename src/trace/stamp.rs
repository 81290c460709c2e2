//! Time stamps in ISO 8601 as seconds since the first of a trace.

use super::quality::BadReason;
use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::TimeZone;

/// The first time stamp of a trace, from which its seconds count.
#[derive(Default)]
pub(super) struct Epoch {
    first: Option<Timestamp>,
}

impl Epoch {
    /// Goes on counting from a first stamp, ns since 1970.
    pub(super) fn since(first_ns: Option<i64>) -> Self {
        Self { first: first_ns.and_then(|ns| Timestamp::from_nanosecond(i128::from(ns)).ok()) }
    }

    /// The first stamp, ns since 1970.
    pub(super) fn first_ns(&self) -> Option<i64> {
        self.first.and_then(|first| i64::try_from(first.as_nanosecond()).ok())
    }

    /// Seconds since the first stamp read; NaN for an empty cell. A stamp without an offset is read
    /// as UTC, so that a day of 24 h has 24 h.
    pub(super) fn seconds(&mut self, cell: &[u8]) -> Result<f64, BadReason> {
        let cell = cell.trim_ascii();
        if cell.is_empty() {
            return Ok(f64::NAN);
        }
        let text = std::str::from_utf8(cell).map_err(|_| BadReason::NotATime)?;
        let stamp = parse(text).ok_or(BadReason::NotATime)?;
        let first = *self.first.get_or_insert(stamp);
        Ok(seconds_between(first.as_nanosecond(), stamp.as_nanosecond()))
    }
}

/// Seconds from one time to another, both in ns since any one instant.
pub fn seconds_between(from_ns: i128, to_ns: i128) -> f64 {
    let nanoseconds = to_ns - from_ns;
    // Whole seconds apart, so that a trace of a year still has its nanoseconds.
    let (whole, rest) = (nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
    whole as f64 + rest as f64 / 1e9
}

fn parse(text: &str) -> Option<Timestamp> {
    text.parse::<Timestamp>().ok().or_else(|| {
        let civil: DateTime = text.parse().ok()?;
        TimeZone::UTC.to_timestamp(civil).ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_count_from_the_first_stamp() {
        let mut epoch = Epoch::default();
        let stamps = [
            ("2026-11-20T22:10:31.5Z", 0.0),
            ("2026-11-20 22:10:31.51", 0.01),
            ("2026-11-20T23:10:32+01:00", 0.5),
            ("2026-11-21T22:10:31.5Z", 86_400.0),
        ];
        for (text, seconds) in stamps {
            assert_eq!(epoch.seconds(text.as_bytes()), Ok(seconds), "{text}");
        }
        for text in ["yesterday", "12", "2026-13-01T00:00:00Z", "\u{0}"] {
            assert_eq!(epoch.seconds(text.as_bytes()), Err(BadReason::NotATime), "{text}");
        }
        assert!(epoch.seconds(b"  ").is_ok_and(f64::is_nan));
    }
}
