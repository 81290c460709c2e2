//! Runs an estimator over a trace that the host feeds, and tells the host what it estimates and what that costs.
//!
//! The host (tests/firmware.rs) writes `trace.f32`: the rig, what else an estimator is made of, then a row of seven numbers for each sample.
#![no_std]

mod measure;
pub mod paper;
mod rig;
pub mod rls;
mod semihosting;
pub mod valve;

pub use measure::run;

unsafe extern "C" {
    /// Never defined: the program links only if nothing in it can panic.
    fn the_firmware_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    // SAFETY: never linked.
    unsafe { the_firmware_can_panic() }
}
