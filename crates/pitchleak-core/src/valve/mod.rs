//! Leaks without flow meters on a controller: the flows of a calibrated valve in the place of meters.
//!
//! 1. `edges`: what passes the four edges at each reading, and its slopes.
//! 2. `hats`: integrals of those over two blocks of a tenth of a second, against a weight that rises and falls.
//! 3. `rows`: both continuity equations over a hat, a column for each unknown, and their noise, made white.
//! 4. `filter`: the three leaks, κ and what else is not known, with the calibration's covariance and its drift, by a square-root free
//!    Kalman filter.
//! 5. `watch`: whether noise explains what comes, and whether the leaks changed at once.
//!
//! What `pitchleak` fits by maximum likelihood over a window, this does sample by sample around the calibration, where the equations
//! are linear: [`ValveFilter`].

mod calibration;
mod edges;
mod filter;
mod hats;
mod rows;
pub mod unknowns;
mod valve_filter;
mod watch;

pub use calibration::{ValveCalibration, ValveError, ValveNoise};
pub use unknowns::{VALVE_COVARIANCES, VALVE_UNKNOWNS};
pub use valve_filter::{ValveEstimates, ValveFilter, ValveSample, ValveUpdate};
