//! Time stamps as seconds since the first of a trace.

use super::quality::BadReason;
use crate::times::TimeFormat;

/// The first time stamp of a trace, from which its seconds count.
#[derive(Default)]
pub(super) struct Epoch {
    format: TimeFormat,
    first_ns: Option<i128>,
    last_ns: Option<i128>,
}

impl Epoch {
    /// Stamps in this format.
    pub(super) fn new(format: TimeFormat) -> Self {
        Self { format, first_ns: None, last_ns: None }
    }

    /// Goes on counting from a first stamp, ns since 1970.
    pub(super) fn since(first_ns: Option<i64>, format: TimeFormat) -> Self {
        Self { first_ns: first_ns.map(i128::from), ..Self::new(format) }
    }

    /// The first stamp, ns since 1970.
    pub(super) fn first_ns(&self) -> Option<i64> {
        self.first_ns.and_then(|first_ns| i64::try_from(first_ns).ok())
    }

    /// Seconds since the first stamp read; NaN for an empty cell. A stamp without an offset is read
    /// as UTC where no zone is known, so that a day of 24 h has 24 h.
    pub(super) fn seconds(&mut self, cell: &[u8]) -> Result<f64, BadReason> {
        let cell = cell.trim_ascii();
        if cell.is_empty() {
            return Ok(f64::NAN);
        }
        let text = std::str::from_utf8(cell).map_err(|_| BadReason::NotATime)?;
        let reading = self.format.kind.read(text).ok_or(BadReason::NotATime)?;
        let stamp_ns = self.format.instant_ns(reading, self.last_ns).ok_or(BadReason::NotATime)?;
        self.last_ns = Some(stamp_ns);
        let first_ns = *self.first_ns.get_or_insert(stamp_ns);
        Ok(seconds_between(first_ns, stamp_ns))
    }
}

/// Seconds from one time to another, both in ns since any one instant.
pub fn seconds_between(from_ns: i128, to_ns: i128) -> f64 {
    let nanoseconds = to_ns - from_ns;
    // Whole seconds apart, so that a trace of a year still has its nanoseconds.
    let (whole, rest) = (nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
    whole as f64 + rest as f64 / 1e9
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
