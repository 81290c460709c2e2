//! Many traces of many cylinders: each judged as a replay judges it, on all cores, a row for each.
//!
//! [`FleetTrace::find`] says which traces there are, of which cylinder, recorded when, with which rig file; [`judge_all`]
//! replays them; [`FleetCylinder`] is what the traces of a cylinder say together; [`FleetTable`] is the table for other
//! programs, [`FleetNights`] one that grows, [`FleetReport`] JSON and text for people, [`FleetOdds`] how often each explanation is
//! true. A file that can't be read is a row with its error, so that nothing is lost.

mod beside;
mod cylinder;
mod identity;
mod nights;
mod odds;
#[cfg(feature = "parquet")]
mod parquet_table;
mod report;
mod row;
mod standing;
mod table;
mod traces;
mod trend;

pub use beside::Beside;
pub use cylinder::{CylinderLeak, FleetCylinder};
pub use identity::TraceIdentity;
pub use nights::FleetNights;
pub use odds::{FleetOdds, LearntShare};
pub use report::{Counts, FleetReport, count};
pub use row::{FleetExplanation, FleetLeak, FleetRow, Stopped, judge, judge_all, judge_opened};
pub use table::{FleetColumn, FleetFile, FleetTable};
pub use traces::{FleetRig, FleetTrace};
pub use trend::{CylinderTrend, LongTrend, Point};

use crate::output::OutputError;
use crate::rig::RigError;

/// Why a fleet is not judged at all; a trace that can't be read is a row instead.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A malformed pattern, or a table of rigs or a file of the table that grows that can't be read.
    #[error("{what}: {why}")]
    Content {
        /// The pattern or the file, as given.
        what: String,
        /// What is wrong with it, and where.
        why: String,
    },
    /// No file where one was asked for.
    #[error("{0}: no such trace")]
    NoTrace(String),
    /// A folder, which is no trace.
    #[error("{0} is a folder: name its traces, for instance '{0}/**/*.csv.gz'")]
    Folder(String),
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
    /// The rig file of all traces.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// A name that says no format in which the table is written.
    #[error("{0}: the table of a fleet is written as {formats}", formats = table::FORMATS)]
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

#[cfg(test)]
mod tests;
