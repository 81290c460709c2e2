//! The default estimator and its alarms for C and C++, in `float`, as `include/pitchleak.h`: the caller brings the
//! memory, nothing is allocated, and no function reads a clock or a file.
//!
//! There is one type for each size of the estimator, `Pitchleak4`, `Pitchleak6`, `Pitchleak9`, so that a controller
//! that declares no offset pays for none. `PitchleakValve` does without flow meters. The functions of all are thin: what they do stands
//! in `running`.
#![cfg_attr(not(any(feature = "std", test)), no_std)]

mod four;
mod leaks;
mod nine;
mod reading;
mod result;
mod rig;
mod running;
mod six;
mod state;
mod valve;

pub use four::*;
pub use nine::*;
pub use reading::{PitchleakAlarms, PitchleakEstimate, PitchleakFound, PitchleakSample};
pub use result::PitchleakResult;
pub use rig::{PitchleakCylinder, PitchleakFluid, PitchleakRig, PitchleakSensor};
pub use six::*;
pub use valve::*;

/// Never called: `ci/panic-free` proves that of the core, and here is nothing that could.
#[cfg(not(any(feature = "std", test)))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
