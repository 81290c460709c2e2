//! Sampling times: time stamps as seconds since the first of a trace, in rows of text and in columns of numbers; and which times
//! follow, which leap, and which go back.

use super::columns::{Column, Layout};
use super::error::{BadReason, TraceFault};
use super::table_text::{TextRow, column};
use crate::header::shorten;
use crate::rig::{ColumnMap, Rig};
use crate::signal::Signal;
use crate::times::{self, TimeFault, TimeFormat, TimeKind};

/// A step this many times the usual one is a gap.
const GAP_FACTOR: f64 = 5.0;
/// A first step longer than this counts as a pause, s; the second then says how long steps are.
const LONGEST_FIRST_STEP_S: f64 = 1.0;
/// Times closer than this are the same, s.
const LEAST_STEP_S: f64 = 1e-9;

/// Whether two times, s, are the same.
pub(super) fn is_same(one_s: f64, other_s: f64) -> bool {
    (one_s - other_s).abs() < LEAST_STEP_S
}
/// So many rows in order, all before the last good one, are a clock that was set back.
const RESTART_ROWS: u32 = 10;
/// So many steps of a new length in a row are a new sampling rate.
const RATE_CHANGE_STEPS: u32 = 5;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    First,
    Next {
        dt_s: f64,
        regular: bool,
        gap: bool,
    },
    /// Not after the last good row.
    Back {
        last_s: f64,
    },
    /// As `Back`, but the clock has been running on from there for a while.
    Restart {
        usual_s: f64,
    },
}

/// Follows the time column in constant memory.
#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Clock {
    last_s: Option<f64>,
    usual_s: Option<f64>,
    unusual_steps: u32,
    rows_back: u32,
    last_back_s: f64,
    began_with_pause: bool,
}

impl Clock {
    /// Time of the last good row, s.
    pub(super) fn last_s(&self) -> Option<f64> {
        self.last_s
    }

    #[inline]
    pub(super) fn step(&mut self, t_s: f64) -> Step {
        let Some(last_s) = self.last_s else {
            self.last_s = Some(t_s);
            return Step::First;
        };
        let dt_s = t_s - last_s;
        if dt_s < LEAST_STEP_S || dt_s.is_nan() {
            return self.back(t_s, last_s);
        }
        self.rows_back = 0;
        self.last_s = Some(t_s);
        if self.usual_s.is_none() && dt_s > LONGEST_FIRST_STEP_S && !self.began_with_pause {
            self.began_with_pause = true;
            return Step::Next { dt_s, regular: false, gap: true };
        }
        let usual_s = *self.usual_s.get_or_insert(dt_s);
        let regular = dt_s < 1.5 * usual_s && usual_s < 1.5 * dt_s;
        let gap = dt_s > GAP_FACTOR * usual_s;
        self.learn(dt_s, usual_s, regular);
        Step::Next { dt_s, regular, gap }
    }

    fn back(&mut self, t_s: f64, last_s: f64) -> Step {
        let goes_on = self.rows_back > 0 && t_s > self.last_back_s;
        self.rows_back = if goes_on { self.rows_back + 1 } else { 1 };
        self.last_back_s = t_s;
        if self.rows_back < RESTART_ROWS {
            return Step::Back { last_s };
        }
        self.rows_back = 0;
        self.last_s = Some(t_s);
        Step::Restart { usual_s: self.usual_s.unwrap_or(0.0) }
    }

    #[inline]
    fn learn(&mut self, dt_s: f64, usual_s: f64, regular: bool) {
        if regular {
            self.unusual_steps = 0;
            self.usual_s = Some(usual_s + 0.05 * (dt_s - usual_s));
        } else {
            self.unusual_steps += 1;
            if self.unusual_steps >= RATE_CHANGE_STEPS {
                self.unusual_steps = 0;
                self.usual_s = Some(dt_s);
            }
        }
    }
}

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

    fn steps(times: impl IntoIterator<Item = f64>) -> Vec<Step> {
        let mut clock = Clock::default();
        times.into_iter().map(|t| clock.step(t)).collect()
    }

    fn gaps(steps: &[Step]) -> usize {
        steps.iter().filter(|step| matches!(step, Step::Next { gap: true, .. })).count()
    }

    #[test]
    fn a_pause_is_a_gap_and_a_lost_sample_is_not() {
        let times = (0..100).filter(|i| *i != 20 && !(50..70).contains(i)).map(|i| f64::from(i) * 0.01);
        assert_eq!(gaps(&steps(times)), 1);
    }

    #[test]
    fn a_gap_at_the_very_start_does_not_hide_the_rate() {
        let times = std::iter::once(0.0).chain((0..100).map(|i| 10.0 + f64::from(i) * 0.01));
        let steps = steps(times.chain([12.0]));
        assert_eq!(gaps(&steps), 2);
    }

    #[test]
    fn a_first_row_far_too_early_is_before_a_gap() {
        let times = std::iter::once(-3600.0).chain((0..100).map(|i| f64::from(i) * 0.01));
        let steps = steps(times);
        assert_eq!(steps.get(1), Some(&Step::Next { dt_s: 3600.0, regular: false, gap: true }));
        assert_eq!(gaps(&steps), 1);
    }

    #[test]
    fn a_slow_trace_is_one_all_the_same() {
        assert_eq!(gaps(&steps((0..100).map(|i| 10.0 * f64::from(i)))), 1);
    }

    #[test]
    fn no_step_is_so_short_that_speeds_overflow() {
        assert_eq!(steps([0.0, 5e-324, 1e-300]).get(2), Some(&Step::Back { last_s: 0.0 }));
    }

    #[test]
    fn a_new_rate_is_learnt() {
        let times = (0..100).map(|i| f64::from(i) * 0.01).chain((1..100).map(|i| 0.99 + f64::from(i)));
        assert_eq!(gaps(&steps(times)), RATE_CHANGE_STEPS as usize);
    }

    #[test]
    fn a_clock_set_back_loses_few_rows() {
        let times = (0..100).chain(0..100).map(|i| f64::from(i) * 0.01);
        let steps = steps(times);
        let lost = steps.iter().filter(|step| matches!(step, Step::Back { .. })).count();
        let restarts = steps.iter().filter(|step| matches!(step, Step::Restart { .. })).count();
        assert_eq!((lost, restarts), (RESTART_ROWS as usize - 1, 1));
    }

    #[test]
    fn a_repeated_time_is_lost() {
        let steps = steps([0.0, 0.01, 0.01, 0.02]);
        assert_eq!(steps.get(2), Some(&Step::Back { last_s: 0.01 }));
    }

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
