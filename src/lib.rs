//! The engine of pitchleak: traces, rig files, replay, scoring and reports around
//! [`pitchleak_core`].
//!
//! From a file to a verdict:
//!
//! ```
//! use pitchleak::Rig;
//! use pitchleak::core::Leak;
//! use pitchleak::replay::{ReplayError, replay};
//! use pitchleak::trace::TraceReader;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let rig = Rig::paper(); // or Rig::load("turbine7.toml")?
//! let mut reader = TraceReader::open("data/hopsan/h02.csv.gz", &rig)?;
//! let report = replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(()))?;
//!
//! assert_eq!(report.verdict.faults, [Leak::Internal]);
//! println!("{}", report.verdict.text);
//! let coefficient = &report.estimates.internal_leak_coefficient;
//! assert!(coefficient.ci95.is_some_and(|[low, _]| low > 0.0)); // m³/(s·Pa)
//! # Ok(())
//! # }
//! ```
//!
//! What the file lacks or has too much of, [`check`](mod@check) tells; what the model lacks, [`diagnose`](mod@diagnose);
//! a trace of a rig that is known to the last leak comes from [`simulate`].

pub use pitchleak_core as core;

pub mod channels;
pub mod check;
pub mod curve;
pub mod diagnose;
pub mod explain;
pub mod fleet;
pub mod hold;
pub mod live;
pub mod output;
pub mod presence;
pub mod prove;
pub mod reference;
pub mod replay;
pub mod report;
pub mod score;
pub mod simulate;
pub mod told;
pub mod valve;
pub mod viscosity;
pub mod wind;
pub mod wiring;

pub use pitchleak_trace::{Rig, header, openfast, read as trace, rig, signal, template, times, units};
