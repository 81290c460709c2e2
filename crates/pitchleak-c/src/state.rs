//! The state as bytes: postcard of a name, a version, the number of unknowns and the estimator, then a CRC-32; the
//! same on every machine.

use crate::result::PitchleakResult;
use crate::running::Kept;
use crc::{CRC_32_ISO_HDLC, Crc};
use serde::{Deserialize, Serialize};

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

pub(crate) fn save<E: Kept>(estimator: &E, bytes: &mut [u8]) -> Result<usize, PitchleakResult> {
    let state = (Form::of(E::KIND), estimator);
    let written = postcard::to_slice_crc32(&state, bytes, CRC.digest());
    written.map(|written| written.len()).map_err(|_| PitchleakResult::TooSmall)
}

pub(crate) fn restore<E: Kept>(bytes: &[u8]) -> Result<E, PitchleakResult> {
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
