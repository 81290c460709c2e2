use super::quality::BadRow;
use std::io;

/// Error returned by [`TraceReader`](super::TraceReader): the trace, and what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[error("{trace}: {fault}")]
pub struct TraceError {
    /// The trace as the user named it.
    pub trace: String,
    /// What is wrong.
    pub fault: TraceFault,
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
