//! Leaks by flow meters: the default estimator and its alarms, in a size for each number of parameters.

use crate::PitchleakResult;
use crate::rig::{PitchleakFound, PitchleakRig, PitchleakSample};
use crate::running::{self, Kept, Memory};
use pitchleak_core::{LeakDetector, Rls, Update};

/// Of N parameters.
#[derive(Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(crate) struct Leaks<const N: usize> {
    rls: Rls<f32, N>,
    detector: LeakDetector<f32>,
}

impl<const N: usize> Kept for Leaks<N> {
    const KIND: u8 = N as u8;
    type Rig = PitchleakRig;
    type Sample = PitchleakSample;
    type Found = PitchleakFound;

    fn begin(rig: &PitchleakRig) -> Result<Self, PitchleakResult> {
        Ok(Self { rls: rig.estimator()?, detector: rig.detector()? })
    }

    fn update(&mut self, dt_s: f32, sample: PitchleakSample) -> PitchleakResult {
        // A flow may have a clock of its own.
        match self.rls.update_waiting(dt_s, &sample.into()) {
            Update::Started => PitchleakResult::Started,
            Update::Rejected => PitchleakResult::Rejected,
            Update::Renewed { elapsed_s, changed, .. } => {
                self.detector.update(elapsed_s, &self.rls.mean_leaks_m3s());
                if changed { PitchleakResult::Changed } else { PitchleakResult::Renewed }
            }
            Update::Accepted | Update::Balanced { .. } => PitchleakResult::Ok,
        }
    }

    fn find(&self) -> PitchleakFound {
        PitchleakFound::new(&self.rls.estimates(), self.detector.active())
    }
}

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
