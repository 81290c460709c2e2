//! The simulated rig: cylinder, valve and supply as one ordinary differential equation.

mod chamber;
mod cylinder_plant;
mod end_stop;
mod error;
mod orifice;
mod supply;
mod valve;
mod valve_plant;

pub use chamber::{ATMOSPHERE_PA, LEAST_ABSOLUTE_PA};
pub use cylinder_plant::{CylinderPlant, CylinderRates, CylinderState, Drive, LeakFlows};
pub use end_stop::EndStop;
pub use error::PlantError;
pub use orifice::{metering, signed_root};
pub use supply::Supply;
pub use valve::{Valve, ValveFlows};
pub use valve_plant::{ValvePlant, ValvePlantState};

pub(crate) use cylinder_plant::{STATES as CYLINDER_STATES, number_or_zero, substeps};
