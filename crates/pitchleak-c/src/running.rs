//! What stands in the memory that the caller brings.

use crate::PitchleakResult;
use crc::{CRC_32_ISO_HDLC, Crc};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Says that the memory holds an estimator of this kind.
const fn mark(kind: u8) -> u64 {
    0x7069_7463_686c_6b00 | kind as u64
}

/// An estimator and its alarms.
#[repr(C)]
pub(crate) struct Running<E> {
    mark: u64,
    estimator: E,
}

/// What is kept from sample to sample, an estimator and its alarms: how it begins, and what it makes of a sample.
pub(crate) trait Kept: Copy + Serialize + DeserializeOwned {
    /// Its number of unknowns tells its kind.
    const KIND: u8;
    type Rig;
    type Sample: Copy;
    type Found;
    fn begin(rig: &Self::Rig) -> Result<Self, PitchleakResult>;
    fn update(&mut self, dt_s: f32, sample: Self::Sample) -> PitchleakResult;
    fn find(&self) -> Self::Found;
}

/// Memory in which an estimator may stand.
///
/// # Safety
/// It is at least as large as a `Running<Kept>`, and aligned as well.
pub(crate) unsafe trait Memory: Sized {
    type Kept: Kept;
    /// It does fit.
    const FITS: () = assert!(
        size_of::<Running<Self::Kept>>() <= size_of::<Self>()
            && align_of::<Running<Self::Kept>>() <= align_of::<Self>(),
        "the memory is too small for its estimator"
    );
}

/// Begins anew for `rig`.
///
/// # Safety
/// Each pointer is null, or what it says.
pub(crate) unsafe fn begin<M: Memory>(memory: *mut M, rig: *const <M::Kept as Kept>::Rig) -> PitchleakResult {
    // SAFETY: as the caller promises.
    let Some(rig) = (unsafe { rig.as_ref() }) else { return PitchleakResult::NullPointer };
    match M::Kept::begin(rig) {
        // SAFETY: as the caller promises.
        Ok(estimator) => unsafe { put(memory, estimator) },
        Err(why) => why,
    }
}

/// Takes in a sample, `dt_s` after the one before.
///
/// # Safety
/// Each pointer is null, or what it says.
pub(crate) unsafe fn update<M: Memory>(
    memory: *mut M,
    dt_s: f32,
    sample: *const <M::Kept as Kept>::Sample,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    let Some(sample) = (unsafe { sample.as_ref() }) else { return PitchleakResult::NullPointer };
    // SAFETY: as the caller promises.
    match unsafe { running(memory) } {
        // SAFETY: begun, and nobody else uses it meanwhile.
        Ok(running) => unsafe { &mut (*running.cast_mut()).estimator }.update(dt_s, *sample),
        Err(why) => why,
    }
}

/// Tells what has been found.
///
/// # Safety
/// Each pointer is null, or what it says.
pub(crate) unsafe fn find<M: Memory>(
    memory: *const M,
    found: *mut <M::Kept as Kept>::Found,
) -> PitchleakResult {
    if found.is_null() {
        return PitchleakResult::NullPointer;
    }
    // SAFETY: as the caller promises.
    match unsafe { running(memory) } {
        Ok(running) => {
            // SAFETY: begun.
            let value = unsafe { &(*running).estimator }.find();
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
pub(crate) unsafe fn save<M: Memory>(
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
    match packed(estimator, unsafe { core::slice::from_raw_parts_mut(bytes, *length) }) {
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
pub(crate) unsafe fn restore<M: Memory>(memory: *mut M, bytes: *const u8, length: usize) -> PitchleakResult {
    if bytes.is_null() {
        return PitchleakResult::NullPointer;
    }
    // SAFETY: not null, and as the caller promises.
    match unpacked(unsafe { core::slice::from_raw_parts(bytes, length) }) {
        // SAFETY: as the caller promises.
        Ok(estimator) => unsafe { put(memory, estimator) },
        Err(why) => why,
    }
}

/// # Safety
/// `memory` is null, or a `M`.
unsafe fn put<M: Memory>(memory: *mut M, estimator: M::Kept) -> PitchleakResult {
    let () = M::FITS;
    if memory.is_null() {
        return PitchleakResult::NullPointer;
    }
    // SAFETY: not null, large enough and aligned.
    unsafe { memory.cast::<Running<M::Kept>>().write(Running { mark: mark(M::Kept::KIND), estimator }) };
    PitchleakResult::Ok
}

/// The estimator in `memory`, if one was put there.
///
/// # Safety
/// `memory` is null, or a `M`.
unsafe fn running<M: Memory>(memory: *const M) -> Result<*const Running<M::Kept>, PitchleakResult> {
    let () = M::FITS;
    if memory.is_null() {
        return Err(PitchleakResult::NullPointer);
    }
    // SAFETY: not null, large enough and aligned; the mark stands first.
    let begun = unsafe { memory.cast::<u64>().read() } == mark(M::Kept::KIND);
    if begun { Ok(memory.cast()) } else { Err(PitchleakResult::NotBegun) }
}

// The state as bytes: postcard of a name, a version, the number of unknowns and the estimator, then a CRC-32; the
// same on every machine.

/// Goes up whenever the estimator keeps other things: a test holds the form.
const VERSION: u8 = 4;
const NAME: [u8; 4] = *b"ptlk";
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Form {
    name: [u8; 4],
    version: u8,
    parameters: u8,
}

impl Form {
    const fn of(parameters: u8) -> Self {
        Self { name: NAME, version: VERSION, parameters }
    }
}

fn packed<E: Kept>(estimator: &E, bytes: &mut [u8]) -> Result<usize, PitchleakResult> {
    let state = (Form::of(E::KIND), estimator);
    let written = postcard::to_slice_crc32(&state, bytes, CRC.digest());
    written.map(|written| written.len()).map_err(|_| PitchleakResult::TooSmall)
}

fn unpacked<E: Kept>(bytes: &[u8]) -> Result<E, PitchleakResult> {
    let (form, _) = postcard::take_from_bytes::<Form>(bytes).map_err(|_| PitchleakResult::Damaged)?;
    if form.name != NAME {
        return Err(PitchleakResult::Damaged);
    }
    if form != Form::of(E::KIND) {
        return Err(PitchleakResult::OtherVersion);
    }
    match postcard::take_from_bytes_crc32::<(Form, E)>(bytes, CRC.digest()) {
        Ok(((_, estimator), [])) => Ok(estimator),
        _ => Err(PitchleakResult::Damaged),
    }
}
