//! A running replay as bytes: its name and version, the state in CBOR (RFC 8949), and a checksum over both.

use ciborium::Value;
use flate2::Crc;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Why bytes give no running replay.
#[derive(Debug, thiserror::Error)]
pub enum RestoreError {
    /// Not what was saved, or cut short.
    #[error("not a saved estimator: {0}")]
    Content(String),
    /// Not as it was saved: a byte is wrong, missing or too many.
    #[error("the saved estimator is damaged: its checksum is wrong")]
    Checksum,
    /// Written by a version that keeps other things.
    #[error("saved by another version (`{0}`, this one reads `{SCHEMA}`): start the estimator anew")]
    Version(String),
    /// Of another rig.
    #[error("the saved estimator has another rig ({saved}, not {wanted})")]
    Rig {
        /// Name of the rig in it.
        saved: String,
        /// Name of the rig it should have.
        wanted: String,
    },
}

/// Name and version of the saved form, …
const SCHEMA: &str = "pitchleak.state/16";
/// … which begins every state as a text of CBOR.
const HEAD: &[u8] = b"\x72pitchleak.state/16";
/// The heads of saved states of any version: of one digit, and of two.
const ANY_HEADS: [(&[u8], usize); 2] = [(b"\x71pitchleak.state/", 1), (b"\x72pitchleak.state/", 2)];
/// Bytes of the checksum at the end: CRC-32 of all before it, little-endian. It finds every single wrong bit and every
/// burst of up to 32.
const CHECKSUM: usize = 4;

/// The bytes of a state.
pub(super) fn write(state: &impl Serialize) -> Result<Vec<u8>, RestoreError> {
    let mut bytes = HEAD.to_vec();
    ciborium::into_writer(state, &mut bytes).map_err(|error| RestoreError::Content(error.to_string()))?;
    let sum = checksum(&bytes);
    bytes.extend(sum);
    Ok(bytes)
}

/// The state of the bytes.
pub(super) fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, RestoreError> {
    if bytes.get(..HEAD.len()) != Some(HEAD) {
        return Err(foreign(bytes));
    }
    let (content, sum) = bytes.split_at_checked(bytes.len() - CHECKSUM).unwrap_or_default();
    if sum != checksum(content) {
        return Err(RestoreError::Checksum);
    }
    let mut rest = content.get(HEAD.len()..).unwrap_or_default();
    let malformed = |error: ciborium::de::Error<std::io::Error>| RestoreError::Content(error.to_string());
    let tree: Value = ciborium::from_reader(&mut rest).map_err(malformed)?;
    if !rest.is_empty() {
        return Err(RestoreError::Content("more than one".to_owned()));
    }
    // Infinities stand for bounds that are not there.
    if !every_number(&tree, &|number| !number.is_nan()) {
        return Err(RestoreError::Content("a number in it is none".to_owned()));
    }
    tree.deserialized().map_err(|ciborium::value::Error::Custom(why)| RestoreError::Content(why))
}

/// Whether all numbers in a tree of CBOR that may have decimals are possible.
pub(crate) fn every_number(tree: &Value, is_possible: &impl Fn(f64) -> bool) -> bool {
    match tree {
        Value::Float(number) => is_possible(*number),
        Value::Array(values) => values.iter().all(|value| every_number(value, is_possible)),
        Value::Map(entries) => entries.iter().all(|(_, value)| every_number(value, is_possible)),
        _ => true,
    }
}

fn checksum(bytes: &[u8]) -> [u8; CHECKSUM] {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum().to_le_bytes()
}

/// What else begins so, or doesn't.
fn foreign(bytes: &[u8]) -> RestoreError {
    let version = ANY_HEADS.iter().find_map(|(head, digits)| bytes.strip_prefix(*head)?.get(..*digits));
    match version.and_then(|version| std::str::from_utf8(version).ok()) {
        Some(version) if version.bytes().all(|digit| digit.is_ascii_digit()) => {
            RestoreError::Version(format!("pitchleak.state/{version}"))
        }
        _ => RestoreError::Content("it begins with other bytes".to_owned()),
    }
}
