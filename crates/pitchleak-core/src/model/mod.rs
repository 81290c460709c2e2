//! Eq. (1)–(2) and what they speak of: cylinder, oil, sensors, samples, leaks, the blade's linkage.

mod cylinder;
mod equations;
mod estimate;
mod leak;
mod linkage;
mod orifice;
mod sensors;

pub use cylinder::{Cylinder, CylinderError, Fluid};
pub use equations::{Model, Signals, Terms};
pub use estimate::{Estimate, LeakPressures};
pub use leak::{Leak, PerLeak};
pub use linkage::{Linkage, LinkageError};
pub use orifice::{metering, metering_slope, signed_root};
pub use sensors::{ATMOSPHERE_PA, Sample, SensorSpread, Sensors};
