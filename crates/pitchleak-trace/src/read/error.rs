//! What is wrong with a trace or a row of it, and what a reader noticed.

use super::row::Record;
use crate::units::duration;
use pitchleak_core::Sample;
use std::{fmt, io};

/// Why a row is of no use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BadReason {
    /// A cell is not a finite number.
    NotANumber,
    /// A time stamp is not in the format of its column.
    NotATime,
    /// A cell that every row must have is empty.
    Missing,
    /// Fewer cells than the header.
    ShortRow,
    /// More cells than the header.
    LongRow,
    /// Not possible on this rig.
    OutOfRange,
    /// Time stands still or goes back.
    TimeBack,
}

impl BadReason {
    /// In the plural, as a count of rows.
    pub fn text(self) -> &'static str {
        match self {
            Self::NotANumber => "not a number",
            Self::NotATime => "not a time",
            Self::Missing => "missing value",
            Self::ShortRow => "too few cells",
            Self::LongRow => "too many cells",
            Self::OutOfRange => "out of physical range",
            Self::TimeBack => "time not rising",
        }
    }
}

/// How the rows of a trace are numbered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Counted {
    /// A file: lines, from 1.
    #[default]
    Lines,
    /// Columns in memory: rows, from 0.
    Rows,
}

/// One bad row.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BadRow {
    /// Number of the line or row.
    pub line: u64,
    /// Which of the two it is.
    pub counted: Counted,
    /// Header of the column, where one cell is to blame.
    pub column: Option<String>,
    /// Why.
    pub reason: BadReason,
    /// What was found and what was expected.
    pub detail: String,
}

impl fmt::Display for BadRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.counted {
            Counted::Lines => write!(f, "line {}", self.line)?,
            Counted::Rows => write!(f, "row {}", self.line)?,
        }
        if let Some(column) = &self.column {
            write!(f, ", column `{column}`")?;
        }
        write!(f, ": {}", self.detail)
    }
}

/// Error returned by [`TraceReader`](super::TraceReader): the trace, and what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[error("{trace}: {fault}")]
pub struct TraceError {
    /// The trace as the user named it.
    pub trace: String,
    /// What is wrong.
    pub fault: TraceFault,
}

impl TraceFault {
    /// It, of a trace of this name.
    pub(super) fn of(self, trace: &str) -> TraceError {
        TraceError { trace: trace.to_owned(), fault: self }
    }
}

/// What makes a trace unusable.
#[derive(Debug, thiserror::Error)]
pub enum TraceFault {
    /// The file cannot be opened.
    #[error("{0}")]
    Open(io::Error),
    /// Reading fails half-way.
    #[error("cannot read on after line {line}: {source}")]
    Read {
        /// The last whole line.
        line: u64,
        /// What the system says.
        source: io::Error,
    },
    /// No byte in it.
    #[error("the trace is empty: a header row naming each column `<signal>_<unit>` is expected")]
    Empty,
    /// Another kind of file.
    #[error("{0}")]
    Format(&'static str),
    /// The file can be read in several ways.
    #[error("{what}: {settle}")]
    Ambiguous {
        /// What is not clear.
        what: String,
        /// What says it.
        settle: String,
    },
    /// The file contradicts its own format.
    #[error("damaged: {0}")]
    Damaged(String),
    /// A signal that every trace must have is not there.
    #[error("no column for {signal}: {accepted} expected; the header has {found}{hint}")]
    MissingColumn {
        /// E.g. `position`.
        signal: String,
        /// The headers accepted.
        accepted: String,
        /// The header row, shortened.
        found: String,
        /// Columns that may be it, as the lines of `[columns]` that would say so; empty, or led by a semicolon.
        hint: String,
    },
    /// Two columns of one signal.
    #[error(
        "columns `{first}` and `{second}` both give `{signal}`: keep one, or name it under [columns] of the rig file"
    )]
    DoubledColumn {
        /// The name of the signal.
        signal: &'static str,
        /// The first header.
        first: String,
        /// The second header.
        second: String,
    },
    /// A column of a known signal in an unknown unit.
    #[error("column `{column}`: unknown unit `{unit}`; allowed for `{signal}`: {allowed}")]
    UnknownUnit {
        /// The header.
        column: String,
        /// The name of the signal.
        signal: &'static str,
        /// What follows the signal's name.
        unit: String,
        /// The suffixes accepted.
        allowed: String,
    },
    /// Columns in memory of different lengths.
    #[error("column `{column}` has {rows} rows, `{other}` has {other_rows}: all must be of one length")]
    Length {
        /// The header.
        column: String,
        /// Its rows.
        rows: usize,
        /// A header before it.
        other: String,
        /// The rows of that.
        other_rows: usize,
    },
    /// A line that does not end.
    #[error("line {0} is longer than a megabyte: not a trace of numbers")]
    TooLong(u64),
    /// Not one good row.
    #[error("no usable row{}{}", describe_waste(*.skipped, .first.as_ref()), describe_mistake(.mistake.as_deref()))]
    NoRows {
        /// Rows skipped as bad.
        skipped: u64,
        /// The first of them.
        first: Option<BadRow>,
        /// What would bring them within range, where it is known, and the lines that mend it.
        mistake: Option<Box<str>>,
    },
    /// A bad row, where those are fatal.
    #[error("{0}")]
    BadRow(BadRow),
    /// A compressed stream that ends early, where that is fatal.
    #[error("{0}")]
    CutOff(String),
}

fn describe_mistake(mistake: Option<&str>) -> String {
    mistake.map_or_else(String::new, |mistake| format!("; {mistake}"))
}

fn describe_waste(skipped: u64, first: Option<&BadRow>) -> String {
    match first {
        None => ": the trace has only a header".to_owned(),
        Some(first) => format!(": {skipped} skipped, the first for this: {first}"),
    }
}

/// How many bad rows are kept with their place.
const KEPT: usize = 5;

/// What a reader noticed so far; whole once [`next_record`](super::TraceReader::next_record) has
/// given its last.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TraceQuality {
    /// Good rows.
    pub rows: u64,
    /// Bad rows, skipped.
    pub skipped: u64,
    /// The bad rows by reason.
    pub reasons: std::collections::BTreeMap<BadReason, u64>,
    /// The first few bad rows.
    pub first_bad: Vec<BadRow>,
    /// Pauses much longer than the usual step.
    pub gaps: u64,
    /// The longest of them, s.
    pub longest_gap_s: f64,
    /// All of them together, s.
    pub gap_time_s: f64,
    /// How often the time began anew further back.
    pub clock_restarts: u64,
    /// From the first to the last good row, s.
    pub duration_s: f64,
    /// Rows without Q_A and without Q_B.
    pub flow_rests: [u64; 2],
    /// Columns that no signal is read from.
    pub ignored_columns: Vec<String>,
    /// How the file was read, where it is not as this program writes one.
    #[serde(default)]
    pub reading: Option<String>,
    /// Mapped columns that the header does not have.
    pub absent_columns: Vec<String>,
    /// Why the rest of a broken stream was not read.
    pub cut_off: Option<String>,
    /// Time of the first row, or of the first after the clock's last restart.
    pub(super) first_s: f64,
    pub(super) before_restart_s: f64,
    pub(super) regular_steps: u64,
    pub(super) regular_time_s: f64,
}

impl TraceQuality {
    /// Samples per second where they come regularly; none for a trace of one row.
    pub fn sample_rate_hz(&self) -> Option<f64> {
        (self.regular_steps > 0).then(|| self.regular_steps as f64 / self.regular_time_s)
    }

    /// The same of the flow that is read most seldom, of those that are read at all.
    pub fn slowest_hz(&self) -> Option<f64> {
        let share = |rests: u64| (self.rows - rests) as f64 / self.rows as f64;
        let least = self.flow_rests.into_iter().map(share).filter(|share| *share > 0.0).fold(1.0, f64::min);
        self.sample_rate_hz().map(|rate_hz| least * rate_hz)
    }

    /// Whether most bad rows go back in time.
    pub fn is_out_of_order(&self) -> bool {
        2 * self.reasons.get(&BadReason::TimeBack).copied().unwrap_or(0) > self.skipped
    }

    /// Whether more rows are bad than good.
    pub fn is_mostly_bad(&self) -> bool {
        self.skipped > self.rows
    }

    /// One line each on what a reader of results should know.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.skipped > 0 {
            warnings.push(self.skipped_text());
        }
        warnings.extend(self.cut_off.as_ref().map(|why| format!("{why}: the rows before are used")));
        if self.clock_restarts > 0 {
            warnings.push(format!("the clock was set back ({} times)", self.clock_restarts));
        }
        if self.gaps > 0 {
            let longest = match self.longest_gap_s {
                short_s if short_s < 120.0 => format!("{short_s:.3} s"),
                long_s => duration(long_s),
            };
            warnings.push(match self.gaps {
                1 => format!("1 gap in time, {longest}"),
                gaps => format!("{gaps} gaps in time, the longest {longest}"),
            });
        }
        if !self.absent_columns.is_empty() {
            warnings.push(format!("mapped but not in the trace: {}", self.absent_columns.join(", ")));
        }
        if !self.ignored_columns.is_empty() {
            warnings.push(format!("columns ignored: {}", self.ignored_columns.join(", ")));
        }
        warnings
    }

    fn skipped_text(&self) -> String {
        let reasons: Vec<_> =
            self.reasons.iter().map(|(reason, count)| format!("{count} {}", reason.text())).collect();
        let total = self.rows + self.skipped;
        let mut text = format!("{} of {total} rows skipped ({})", self.skipped, reasons.join(", "));
        for (index, bad) in self.first_bad.iter().enumerate() {
            text.push_str(if index == 0 { ": " } else { "; " });
            text.push_str(&bad.to_string());
        }
        if self.skipped > self.first_bad.len() as u64 {
            text.push_str("; …");
        }
        text
    }

    pub(super) fn count_bad(&mut self, bad: BadRow) {
        self.skipped += 1;
        *self.reasons.entry(bad.reason).or_default() += 1;
        if self.first_bad.len() < KEPT {
            self.first_bad.push(bad);
        }
    }

    #[inline]
    pub(super) fn count_step(&mut self, dt_s: f64, regular: bool, gap: bool) {
        if regular {
            self.regular_steps += 1;
            self.regular_time_s += dt_s;
        }
        if gap {
            self.gaps += 1;
            self.gap_time_s += dt_s;
            self.longest_gap_s = self.longest_gap_s.max(dt_s);
        }
    }

    /// The time counts from `t_s` on: at the first row, and where the clock was set back.
    #[cold]
    pub(super) fn count_from(&mut self, t_s: f64) {
        self.before_restart_s = self.duration_s;
        self.first_s = t_s;
    }

    #[inline]
    pub(super) fn count_row(&mut self, record: &Record) {
        self.rows += 1;
        self.duration_s = self.before_restart_s + (record.t_s - self.first_s);
        let Sample { qa_m3s, qb_m3s, .. } = record.sample;
        let [a, b] = &mut self.flow_rests;
        *a += u64::from(qa_m3s.is_none());
        *b += u64::from(qb_m3s.is_none());
    }
}
