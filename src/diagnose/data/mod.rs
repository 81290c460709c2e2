//! The traces and what is declared of them.

mod backlash;
mod channel;
mod channels;
mod dead_band;
mod declared;
mod files;
mod motion;
mod sensor_noise;
mod series;
mod side;
mod traces;
mod unresolved;
mod wiring;

pub(crate) use channel::Channel;
pub(crate) use channels::channel_faults;
pub use declared::Declared;
pub(crate) use declared::thinned;
pub use files::{FittedAndJudged, Roles, SameFile};
pub(crate) use motion::Motion;
pub(crate) use sensor_noise::{SensorCheck, check_sensors, effective, white};
pub use series::Series;
pub use traces::Traces;
pub(crate) use unresolved::Unresolved;
pub(crate) use wiring::miswired;
