//! The estimator of 6 parameters.

use crate::leaks::Leaks;
use crate::reading::{PitchleakFound, PitchleakSample};
use crate::result::PitchleakResult;
use crate::rig::PitchleakRig;
use crate::running::{self, Memory};

/// Size of `Pitchleak6` in 64-bit words.
pub const PITCHLEAK6_WORDS: usize = 474;
/// A state is never longer, bytes.
pub const PITCHLEAK6_STATE_BYTES: usize = 3792;

/// Memory of an estimator of leaks, compressibility and the flow meters' offsets. Begin with `pitchleak6_begin`;
/// it may be moved and copied.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Pitchleak6 {
    /// Not for reading.
    pub words: [u64; PITCHLEAK6_WORDS],
}

// SAFETY: `Memory::FITS` holds.
unsafe impl Memory for Pitchleak6 {
    type Kept = Leaks<6>;
}

/// Begins anew for a rig.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak6_begin(
    estimator: *mut Pitchleak6,
    rig: *const PitchleakRig,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::begin(estimator, rig) }
}

/// Takes in a sample, `dt_s` after the one before.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak6_update(
    estimator: *mut Pitchleak6,
    dt_s: f32,
    sample: *const PitchleakSample,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::update(estimator, dt_s, sample) }
}

/// Tells what has been found so far.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak6_find(
    estimator: *const Pitchleak6,
    found: *mut PitchleakFound,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::find(estimator, found) }
}

/// Writes the state to `bytes`, of which there are `*length`; afterwards `*length` were written.
/// PITCHLEAK6_STATE_BYTES are enough.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak6_save(
    estimator: *const Pitchleak6,
    bytes: *mut u8,
    length: *mut usize,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::save(estimator, bytes, length) }
}

/// Goes on from a state that `pitchleak6_save` wrote, on this machine or another; other bytes leave the
/// estimator as it was.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak6_restore(
    estimator: *mut Pitchleak6,
    bytes: *const u8,
    length: usize,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::restore(estimator, bytes, length) }
}
