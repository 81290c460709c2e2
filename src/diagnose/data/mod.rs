//! The traces and what is declared of them.

mod channel;
mod dead_band;
mod declared;
mod foreseen;
mod mistakes;
mod motion;
mod noise;
mod play;
mod series;
mod traces;

pub(crate) use channel::Channel;
pub use declared::Declared;
pub(crate) use declared::thinned;
pub(crate) use mistakes::{Miswired, channel_faults, miswired};
pub(crate) use motion::Motion;
pub(crate) use noise::{SensorCheck, Unresolved, check_sensors, effective, white};
pub use series::Series;
pub use traces::{FittedAndJudged, Roles, SameFile, Traces};
