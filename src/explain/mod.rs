//! One posterior over explanations of a trace: leaks, sensors, rig and wiring weighed against each other.
//!
//! docs/explanations.md has the equations; the table of explanations is data.

mod beside;
mod candidates;
mod columns;
mod decision;
mod equations;
mod evidence;
mod given_leaks;
mod hypothesis;
mod independence;
mod leak_sample;
mod marginal;
mod mended;
mod mistakes;
mod odds;
mod orthant;
mod pass;
mod posterior;
mod pressures_off;
mod raw_products;
mod readings;
mod scales;
pub(crate) mod scatter;
mod sensors;
mod sizes;
mod still;
mod table;
#[cfg(test)]
mod testing;

pub use columns::{Column, Course};
pub use decision::{Belief, Decision, Explained, MISFIT_TOLD, Note, WIRING_DOUBT, explain};
pub(crate) use odds::Prior;
pub(crate) use orthant::{Orthant, POINTS, positive_orthant};
pub(crate) use posterior::NEAR;
pub use raw_products::{SEGMENTS, Statistic};
pub use readings::{Mistake, Of};
pub use table::{Entry, Kind, explanations};
pub(crate) use table::{LEAK_SHARE, USUAL_DRIFT, USUAL_GAIN, USUAL_ZERO};
