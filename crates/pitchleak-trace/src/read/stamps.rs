//! Time stamps as seconds since the first of a trace, in rows of text and in columns of numbers.

use super::columns::{Column, Layout};
use super::error::{BadReason, TraceFault};
use super::table_text::{TextRow, column};
use crate::header::shorten;
use crate::rig::{ColumnMap, Rig};
use crate::signal::Signal;
use crate::times::{self, TimeFault, TimeFormat, TimeKind};

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

    /// As [`seconds`](Self::seconds), of a cell that holds a number; NaN where it is no stamp.
    pub(super) fn seconds_of(&mut self, number: f64) -> f64 {
        self.seconds(number.to_string().as_bytes()).unwrap_or(f64::NAN)
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

/// So many rows say how times are written.
pub(super) const ROWS: usize = 100;

/// A number as text; none is an empty cell.
pub(super) fn cell_text(value: &f64) -> String {
    if value.is_nan() { String::new() } else { value.to_string() }
}

/// The first cells of each column as rows, as those of a file of text are looked at.
pub(super) fn first_rows(columns: &[Vec<String>]) -> Vec<TextRow> {
    let rows = columns.iter().map(Vec::len).max().unwrap_or(0);
    let cells = |row: usize| columns.iter().map(move |cells| cells.get(row).cloned().unwrap_or_default());
    (0..rows).map(|row| TextRow { line: row as u64, cells: cells(row).collect() }).collect()
}

/// How the time stamps below these first rows are written: as the rig file or the command line says it, else as the cells
/// themselves do.
pub(super) fn time_format(
    rows: &[TextRow],
    layout: &Layout,
    foreign: &ColumnMap,
    rig: &Rig,
) -> Result<TimeFormat, TraceFault> {
    let Some(index) = layout.columns.iter().position(Column::is_timestamp) else {
        return Ok(TimeFormat::default());
    };
    let cells = &column(rows, index)[..];
    let entry = rig.columns.get(&Signal::Timestamp).or_else(|| foreign.get(&Signal::Timestamp));
    let zone = entry.and_then(|entry| entry.zone.clone());
    let zone = zone.or_else(|| rig.csv.time.as_ref().and_then(|time| time.zone.clone()));
    let kind = entry.and_then(|entry| entry.format.clone());
    let kind = kind.or_else(|| rig.csv.time.as_ref().map(|time| time.kind.clone()));
    if let Some(kind) = kind {
        return Ok(TimeFormat { kind, zone });
    }
    if cells.is_empty() {
        return Ok(TimeFormat { zone, ..TimeFormat::default() });
    }
    match times::guess(cells) {
        Ok(format) => Ok(TimeFormat { zone, ..format }),
        // Row by row it says which cells are bad.
        Err(TimeFault::Unknown(_)) if cells.iter().any(|cell| TimeKind::Iso.read(cell).is_some()) => {
            Ok(TimeFormat { zone, ..TimeFormat::default() })
        }
        Err(fault) => Err(unclear_time(&fault, layout)),
    }
}

fn unclear_time(fault: &TimeFault, layout: &Layout) -> TraceFault {
    let name = shorten(layout.header_of(Signal::Timestamp).unwrap_or_default(), 40);
    let line = |format: &str| format!("timestamp = {{ name = \"{name}\", format = \"{format}\" }}");
    let settle = match fault {
        TimeFault::DayOrMonth(_) | TimeFault::BothOrders { .. } => {
            format!(
                "--time-format dmy or mdy says which, or under [columns] of the rig file: {}",
                line("dmy")
            )
        }
        TimeFault::BareNumber(_) => format!(
            "under [columns] of the rig file say t = {{ name = \"{name}\", unit = \"s\" }}, or {}",
            line("excel")
        ),
        TimeFault::Unknown(_) => {
            format!(
                "--time-format says how it is written, or under [columns] of the rig file: {}",
                line("%d.%m.%Y %H:%M:%S%.f")
            )
        }
    };
    TraceFault::Ambiguous { what: format!("column `{name}`: {fault}"), settle }
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
