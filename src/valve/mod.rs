//! Leaks without flow meters: the valve's four edges in the place of meters.
//!
//! 1. [`ValveMeter`] keeps the readings of a window: position, both pressures, the spool and the supply's pressure.
//! 2. `fit` finds leaks, compressibility and what is not known of the valve by maximum likelihood, with the continuity equations of
//!    `equations`, the valve's flows of `edges`, and the noise made white by `whitening`.
//! 3. `course` has how leaks go through the window: constant, others since a moment, or in a line. `parts` says which, and whether what is
//!    left is noise.
//! 4. [`presence`](crate::presence) weighs which leaks there are, and [`ValveTest`] has the verdict and its words.
//!
//! [`Calibrator`] keeps what traces of a rig say of its valve for later ones.

mod calibration;
mod course;
mod edges;
mod equations;
mod fit;
mod means;
mod meter;
mod outcome;
mod parts;
mod stream;
mod unknowns;
mod unread;
mod verdict;
mod whitening;

pub use calibration::{Calibration, CalibrationError, Calibrator, EdgeFound, LeaksThen, Since};
pub use meter::ValveMeter;
pub use outcome::{ValveSummary, ValveTest};
pub use stream::ValveStream;
