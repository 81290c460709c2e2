//! The simulated rig: cylinder, valve and supply as one ordinary differential equation.

mod chamber;
mod cylinder_plant;
mod end_stop;
mod error;
mod rk4;
mod supply;
mod valve;
mod valve_plant;

pub use cylinder_plant::{CylinderPlant, CylinderRates, CylinderState, Drive};
pub use end_stop::EndStop;
pub use error::PlantError;
pub use rk4::rk4_step;
pub use supply::Supply;
pub use valve::{Valve, ValveFlows};
pub use valve_plant::{ValvePlant, ValvePlantState};

pub(crate) use cylinder_plant::{STATES as CYLINDER_STATES, number_or_zero, substeps};
