//! The estimator of 4 parameters.

use crate::leaks::Leaks;
use crate::reading::{PitchleakFound, PitchleakSample};
use crate::result::PitchleakResult;
use crate::rig::PitchleakRig;
use crate::running::{self, Memory};

/// Size of `Pitchleak4` in 64-bit words.
pub const PITCHLEAK4_WORDS: usize = 324;
/// A state is never longer, bytes.
pub const PITCHLEAK4_STATE_BYTES: usize = 2592;

/// Memory of an estimator of leaks and compressibility. Begin with `pitchleak4_begin`;
/// it may be moved and copied.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Pitchleak4 {
    /// Not for reading.
    pub words: [u64; PITCHLEAK4_WORDS],
}

// SAFETY: `Memory::FITS` holds.
unsafe impl Memory for Pitchleak4 {
    type Kept = Leaks<4>;
}

/// Begins anew for a rig.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak4_begin(
    estimator: *mut Pitchleak4,
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
pub unsafe extern "C" fn pitchleak4_update(
    estimator: *mut Pitchleak4,
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
pub unsafe extern "C" fn pitchleak4_find(
    estimator: *const Pitchleak4,
    found: *mut PitchleakFound,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::find(estimator, found) }
}

/// Writes the state to `bytes`, of which there are `*length`; afterwards `*length` were written.
/// PITCHLEAK4_STATE_BYTES are enough.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak4_save(
    estimator: *const Pitchleak4,
    bytes: *mut u8,
    length: *mut usize,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::save(estimator, bytes, length) }
}

/// Goes on from a state that `pitchleak4_save` wrote, on this machine or another; other bytes leave the
/// estimator as it was.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak4_restore(
    estimator: *mut Pitchleak4,
    bytes: *const u8,
    length: usize,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::restore(estimator, bytes, length) }
}
