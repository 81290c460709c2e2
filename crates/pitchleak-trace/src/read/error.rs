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
