//! What stands in the memory that the caller brings.

use crate::reading::{PitchleakFound, PitchleakSample};
use crate::result::PitchleakResult;
use crate::rig::PitchleakRig;
use crate::state;
use pitchleak_core::{LeakDetector, Rls, Update};

/// Says that the memory holds an estimator of N parameters.
const fn mark(parameters: usize) -> u64 {
    0x7069_7463_686c_6b00 | parameters as u64
}

/// An estimator and its alarms.
#[repr(C)]
pub(crate) struct Running<const N: usize> {
    mark: u64,
    estimator: Estimator<N>,
}

/// What is kept from sample to sample.
#[derive(Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(crate) struct Estimator<const N: usize> {
    rls: Rls<f32, N>,
    detector: LeakDetector<f32>,
}

/// Memory in which a `Running<N>` may stand.
///
/// # Safety
/// It is at least as large, and aligned as well.
pub(crate) unsafe trait Memory<const N: usize>: Sized {
    /// It does fit.
    const FITS: () = assert!(
        size_of::<Running<N>>() <= size_of::<Self>() && align_of::<Running<N>>() <= align_of::<Self>(),
        "the memory is too small for its estimator"
    );
}

/// Begins anew for `rig`.
///
/// # Safety
/// Each pointer is null, or what it says.
pub(crate) unsafe fn begin<M: Memory<N>, const N: usize>(
    memory: *mut M,
    rig: *const PitchleakRig,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    let Some(rig) = (unsafe { rig.as_ref() }) else { return PitchleakResult::NullPointer };
    let made = rig.estimator().and_then(|rls| Ok(Estimator { rls, detector: rig.detector()? }));
    match made {
        // SAFETY: as the caller promises.
        Ok(estimator) => unsafe { put(memory, estimator) },
        Err(why) => why,
    }
}

/// Takes in a sample, `dt_s` after the one before.
///
/// # Safety
/// Each pointer is null, or what it says.
pub(crate) unsafe fn update<M: Memory<N>, const N: usize>(
    memory: *mut M,
    dt_s: f32,
    sample: *const PitchleakSample,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    let Some(sample) = (unsafe { sample.as_ref() }) else { return PitchleakResult::NullPointer };
    // SAFETY: as the caller promises.
    let Estimator { rls, detector } = match unsafe { running(memory) } {
        // SAFETY: begun, and nobody else uses it meanwhile.
        Ok(running) => unsafe { &mut (*running.cast_mut()).estimator },
        Err(why) => return why,
    };
    // A flow may have a clock of its own.
    match rls.update_waiting(dt_s, &(*sample).into()) {
        Update::Started => PitchleakResult::Started,
        Update::Rejected => PitchleakResult::Rejected,
        Update::Renewed { elapsed_s, changed, .. } => {
            detector.update(elapsed_s, &rls.mean_leaks_m3s());
            if changed { PitchleakResult::Changed } else { PitchleakResult::Renewed }
        }
        Update::Accepted | Update::Balanced { .. } => PitchleakResult::Ok,
    }
}

/// Tells what has been found.
///
/// # Safety
/// Each pointer is null, or what it says.
pub(crate) unsafe fn find<M: Memory<N>, const N: usize>(
    memory: *const M,
    found: *mut PitchleakFound,
) -> PitchleakResult {
    if found.is_null() {
        return PitchleakResult::NullPointer;
    }
    // SAFETY: as the caller promises.
    match unsafe { running(memory) } {
        Ok(running) => {
            // SAFETY: begun.
            let Estimator { rls, detector } = unsafe { &(*running).estimator };
            let value = PitchleakFound::new(&rls.estimates(), detector.active());
            // SAFETY: not null, and as the caller promises.
            unsafe { found.write(value) };
            PitchleakResult::Ok
        }
        Err(why) => why,
    }
}

/// Writes the state to `bytes`, of which there are `*length`; afterwards that is how many were written.
///
/// # Safety
/// Each pointer is null, or what it says.
pub(crate) unsafe fn save<M: Memory<N>, const N: usize>(
    memory: *const M,
    bytes: *mut u8,
    length: *mut usize,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    let Some(length) = (unsafe { length.as_mut() }) else { return PitchleakResult::NullPointer };
    if bytes.is_null() {
        return PitchleakResult::NullPointer;
    }
    // SAFETY: as the caller promises.
    let estimator = match unsafe { running(memory) } {
        // SAFETY: begun.
        Ok(running) => unsafe { &(*running).estimator },
        Err(why) => return why,
    };
    // SAFETY: not null, and as the caller promises.
    match state::save(estimator, unsafe { core::slice::from_raw_parts_mut(bytes, *length) }) {
        Ok(written) => {
            *length = written;
            PitchleakResult::Ok
        }
        Err(why) => why,
    }
}

/// Goes on from a state that `save` wrote; other bytes leave the estimator as it was.
///
/// # Safety
/// Each pointer is null, or what it says.
pub(crate) unsafe fn restore<M: Memory<N>, const N: usize>(
    memory: *mut M,
    bytes: *const u8,
    length: usize,
) -> PitchleakResult {
    if bytes.is_null() {
        return PitchleakResult::NullPointer;
    }
    // SAFETY: not null, and as the caller promises.
    match state::restore(unsafe { core::slice::from_raw_parts(bytes, length) }) {
        // SAFETY: as the caller promises.
        Ok(estimator) => unsafe { put(memory, estimator) },
        Err(why) => why,
    }
}

/// # Safety
/// `memory` is null, or a `M`.
unsafe fn put<M: Memory<N>, const N: usize>(memory: *mut M, estimator: Estimator<N>) -> PitchleakResult {
    let () = M::FITS;
    if memory.is_null() {
        return PitchleakResult::NullPointer;
    }
    // SAFETY: not null, large enough and aligned.
    unsafe { memory.cast::<Running<N>>().write(Running { mark: mark(N), estimator }) };
    PitchleakResult::Ok
}

/// The estimator in `memory`, if one was put there.
///
/// # Safety
/// `memory` is null, or a `M`.
unsafe fn running<M: Memory<N>, const N: usize>(
    memory: *const M,
) -> Result<*const Running<N>, PitchleakResult> {
    let () = M::FITS;
    if memory.is_null() {
        return Err(PitchleakResult::NullPointer);
    }
    // SAFETY: not null, large enough and aligned; the mark stands first.
    let begun = unsafe { memory.cast::<u64>().read() } == mark(N);
    if begun { Ok(memory.cast()) } else { Err(PitchleakResult::NotBegun) }
}
