//! The estimator of 9 parameters.

use crate::leaks::Leaks;
use crate::reading::{PitchleakFound, PitchleakSample};
use crate::result::PitchleakResult;
use crate::rig::PitchleakRig;
use crate::running::{self, Memory};

/// Size of `Pitchleak9` in 64-bit words.
pub const PITCHLEAK9_WORDS: usize = 783;
/// A state is never longer, bytes.
pub const PITCHLEAK9_STATE_BYTES: usize = 6264;

/// Memory of an estimator of leaks, compressibility, the flow meters' offsets and the gains of flow meters and position sensor. Begin with `pitchleak9_begin`;
/// it may be moved and copied.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Pitchleak9 {
    /// Not for reading.
    pub words: [u64; PITCHLEAK9_WORDS],
}

// SAFETY: `Memory::FITS` holds.
unsafe impl Memory for Pitchleak9 {
    type Kept = Leaks<9>;
}

/// Begins anew for a rig.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak9_begin(
    estimator: *mut Pitchleak9,
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
pub unsafe extern "C" fn pitchleak9_update(
    estimator: *mut Pitchleak9,
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
pub unsafe extern "C" fn pitchleak9_find(
    estimator: *const Pitchleak9,
    found: *mut PitchleakFound,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::find(estimator, found) }
}

/// Writes the state to `bytes`, of which there are `*length`; afterwards `*length` were written.
/// PITCHLEAK9_STATE_BYTES are enough.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak9_save(
    estimator: *const Pitchleak9,
    bytes: *mut u8,
    length: *mut usize,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::save(estimator, bytes, length) }
}

/// Goes on from a state that `pitchleak9_save` wrote, on this machine or another; other bytes leave the
/// estimator as it was.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak9_restore(
    estimator: *mut Pitchleak9,
    bytes: *const u8,
    length: usize,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::restore(estimator, bytes, length) }
}
