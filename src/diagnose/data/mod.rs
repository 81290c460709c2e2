//! The traces and what is declared of them.

mod declared;
mod motion;
mod sensor_noise;
mod series;

pub use declared::Declared;
pub(crate) use declared::thinned;
pub(crate) use motion::Motion;
pub(crate) use sensor_noise::{SensorCheck, check_sensors, effective};
pub use series::Series;
