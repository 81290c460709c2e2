//! The default estimator and its alarms for C and C++, in `float`, as `include/pitchleak.h`: the caller brings the
//! memory, nothing is allocated, and no function reads a clock or a file.
//!
//! There is one type for each size of the estimator, `Pitchleak4`, `Pitchleak6`, `Pitchleak9`, so that a controller
//! that declares no offset pays for none. `PitchleakValve` does without flow meters. The functions of all are thin: what they do stands
//! in `running`.
#![cfg_attr(not(any(feature = "std", test)), no_std)]

mod meters;
mod rig;
mod running;
mod valve;

pub use meters::*;
pub use rig::{
    PitchleakAlarms, PitchleakCylinder, PitchleakEstimate, PitchleakFluid, PitchleakFound, PitchleakRig,
    PitchleakSample, PitchleakSensor,
};
pub use valve::*;

/// What a function did: zero or above where all is well.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PitchleakResult {
    /// Done; of a sample: taken in.
    Ok = 0,
    /// The first sample, or the first after a gap: nothing to integrate yet.
    Started = 1,
    /// The sample was taken in, and the estimates are new.
    Renewed = 2,
    /// Renewed, after a sudden change of the leak: what was learnt before no longer counts.
    Changed = 3,
    /// The sample was left out: not a number, or beyond what a cylinder can do.
    Rejected = 4,
    /// A pointer is null.
    NullPointer = -1,
    /// The estimator was not begun, or its memory was overwritten.
    NotBegun = -2,
    /// The cylinder or its oil is impossible.
    BadCylinder = -3,
    /// A sensor's noise, bias or gain error is negative or not a number.
    BadSensors = -4,
    /// An alarm's threshold is not positive.
    BadThreshold = -5,
    /// The buffer is too small.
    TooSmall = -6,
    /// The bytes are no state, or a damaged one.
    Damaged = -7,
    /// The bytes are the state of another version, or of an estimator of another size.
    OtherVersion = -8,
    /// A number of the valve's calibration cannot be.
    BadCalibration = -9,
}

/// Never called: `ci/panic-free` proves that of the core, and here is nothing that could.
#[cfg(not(any(feature = "std", test)))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
