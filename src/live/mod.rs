//! Live operation: samples of many cylinders come in as lines or messages, estimates, alarms and notices go out.
//!
//! [`Watch`] does no input or output of its own and reads no clock: what it says follows from the lines alone, and each
//! cylinder's numbers are those of a [`replay`](mod@crate::replay) of its lines, to the last bit.

mod checkpoint;
mod config;
mod cylinder;
mod event;
mod format;
mod history;
mod json;
mod order;
mod record;
mod watch;

pub use checkpoint::{Checkpoint, CheckpointError, Snapshot};
pub use config::{ConfigError, LiveConfig, LiveDocument};
pub use event::{
    AlarmEvent, EstimateEvent, Event, HoldEvent, LiveLeakage, NoticeEvent, OutputFormat, SummaryEvent,
};
pub use format::{Batch, BatchFormat, LineFormat};
pub use history::{DayTrend, LeakSummary, Span};
pub use watch::Watch;
