use crate::output::OutputError;
use crate::rig::RigError;

/// Why a fleet is not judged at all; a trace that can't be read is a row instead.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A malformed pattern.
    #[error("{pattern}: {why}")]
    Pattern {
        /// As given.
        pattern: String,
        /// What is wrong with it, and where.
        why: String,
    },
    /// No file where one was asked for.
    #[error("{0}: no such trace")]
    NoTrace(String),
    /// A folder, which is no trace.
    #[error("{0} is a folder: name its traces, for instance '{0}/**/*.csv.gz'")]
    Folder(String),
    /// The table of rigs can't be read.
    #[error("{file}: {why}")]
    RigTable {
        /// As given.
        file: String,
        /// What is wrong with it, and where.
        why: String,
    },
    /// Traces that the table of rigs does not name.
    #[error("{table} names no rig for {trace}{}", and_others(*.others))]
    NotInTable {
        /// The table as given.
        table: String,
        /// The first trace without a rig.
        trace: String,
        /// How many more there are.
        others: usize,
    },
    /// A file of the table that grows can't be read.
    #[error("{file}: {why}")]
    Nights {
        /// Its path.
        file: String,
        /// What is wrong with it.
        why: String,
    },
    /// The rig file of all traces.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// A name that says no format in which the table is written.
    #[error("{0}: the table of a fleet is written as {formats}", formats = super::write::FORMATS)]
    Kind(String),
    /// The table can't be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

fn and_others(count: usize) -> String {
    match count {
        0 => String::new(),
        count => format!(" and {count} other traces"),
    }
}
