//! Live operation: samples of many cylinders come in as lines, estimates, alarms and notices go out.
//!
//! [`Watch`] does no input or output of its own and reads no clock: what it says follows from the lines alone, and each
//! cylinder's numbers are those of a [`replay`](mod@crate::replay) of its lines, to the last bit.

mod checkpoint;
mod config;
mod csv;
mod cylinder;
mod event;
mod format;
mod influx;
mod ndjson;
mod notices;
mod watch;

pub use checkpoint::{Checkpoint, CheckpointError, Snapshot};
pub use config::{ConfigError, LiveConfig};
pub use event::{AlarmEvent, EstimateEvent, Event, LiveLeakage, NoticeEvent, OutputFormat};
pub use format::LineFormat;
pub use watch::Watch;
