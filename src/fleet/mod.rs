//! Many traces of many cylinders: each judged as a replay judges it, on all cores, a row for each.
//!
//! [`FleetTrace::find`] says which traces there are, of which cylinder, recorded when, with which rig file; [`judge_all`]
//! replays them; [`FleetCylinder`] is what the traces of a cylinder say together; [`FleetTable`] is the table for other
//! programs, [`FleetNights`] one that grows, [`FleetReport`] JSON and text for people, [`FleetOdds`] how often each explanation is
//! true. A file that can't be read is a row with its error, so that nothing is lost.

mod beside;
mod cylinder;
mod doubles;
mod errors;
mod identity;
mod judge;
mod nights;
mod odds;
mod report;
mod rig_table;
mod row;
mod scatter;
mod standing;
mod table;
mod traces;
mod trend;
mod write;

pub use beside::Beside;
pub use cylinder::{CylinderLeak, FleetCylinder};
pub use errors::FleetError;
pub use identity::TraceIdentity;
pub use judge::{Stopped, judge, judge_all, judge_opened};
pub use nights::FleetNights;
pub use odds::{FleetOdds, LearntShare};
pub use report::{Counts, FleetReport, count};
pub use rig_table::RigTable;
pub use row::{FleetExplanation, FleetLeak, FleetRow};
pub use table::{FleetColumn, FleetTable};
pub use traces::{FleetRig, FleetTrace};
pub use trend::{CylinderTrend, LongTrend, Point};
pub use write::FleetFile;

#[cfg(test)]
mod tests;
