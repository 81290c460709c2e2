//! A cylinder's file: records, one behind the other, each gzip, which has a checksum, of CBOR. The first is the state; each
//! later one is the state but for the segments, and the blocks that made those of the segments before.

use super::cylinder::Cylinder;
use crate::replay::{Fresh, every_number};
use ciborium::Value;
use flate2::bufread::GzDecoder;
use flate2::{Compression, GzBuilder};
use serde::de::DeserializeOwned;
use std::io::{self, Read as _};

/// Name and version of the saved form, with which a record begins.
const SCHEMA: &str = "pitchleak.watch/7";
/// No record is larger once unpacked, bytes: a forged one would fill the memory.
const LARGEST: u64 = 16 * 1024 * 1024;
/// Beyond any time in s and any sum of flows in L/min.
const LARGEST_NUMBER: f64 = 1e15;

const TOO_MUCH: &str = "something follows its end";
const MISSING: &str = "what came before it is missing";
const IMPOSSIBLE: &str = "a number in it is impossible";

/// What a file holds.
pub(super) struct Records {
    /// As of the last record before any damage.
    pub cylinder: Option<Cylinder>,
    /// Bytes before any damage.
    pub sound: usize,
    pub damage: Option<String>,
}

/// A state by itself.
pub(super) fn whole(name: &str, cylinder: &Cylinder) -> io::Result<Vec<u8>> {
    packed(name, cylinder, None)
}

/// What it is beside the record before.
pub(super) fn since(name: &str, cylinder: &Cylinder) -> io::Result<Vec<u8>> {
    let mut cylinder = cylinder.clone();
    let fresh = cylinder.stream.take_fresh();
    packed(name, &cylinder, Some(fresh))
}

fn packed(name: &str, cylinder: &Cylinder, fresh: Option<Fresh>) -> io::Result<Vec<u8>> {
    let mut out = GzBuilder::new().write(Vec::new(), Compression::default());
    ciborium::into_writer(&(SCHEMA, name, cylinder, fresh), &mut out).map_err(io::Error::other)?;
    out.finish()
}

/// The state of a cylinder of this name.
pub(super) fn read(bytes: &[u8], name: &str) -> Records {
    let (mut rest, mut file) = (bytes, Read::default());
    let mut damage = rest.is_empty().then(|| "empty".to_owned());
    while damage.is_none() && !rest.is_empty() {
        match file.take(rest, name) {
            Ok(behind) => rest = behind,
            Err(why) => damage = Some(why),
        }
    }
    let sound = bytes.len() - rest.len();
    match file.cylinder() {
        Ok(cylinder) => Records { cylinder, sound, damage },
        Err(why) => Records { cylinder: None, sound: 0, damage: Some(why) },
    }
}

/// A file so far.
#[derive(Default)]
struct Read {
    /// Of the first record, with the segments as of the last.
    first: Option<Cylinder>,
    /// All else of the last, where that is another: of none between it need be known.
    last: Option<Value>,
}

impl Read {
    /// Takes in the record with which the bytes begin, if nothing is wrong with it; what is behind it.
    fn take<'b>(&mut self, bytes: &'b [u8], name: &str) -> Result<&'b [u8], String> {
        let mut decoder = GzDecoder::new(bytes);
        let mut body = Vec::new();
        let unpacked = decoder.by_ref().take(LARGEST).read_to_end(&mut body);
        if unpacked.map_err(|_| "damaged".to_owned())? as u64 == LARGEST {
            return Err(TOO_MUCH.to_owned());
        }
        let (cylinder, fresh) = parts(&body, name)?;
        match (fresh, &mut self.first) {
            (None, None) => self.first = Some(known(&cylinder)?),
            (Some(fresh), Some(first)) => {
                if !first.stream.take_blocks(&fresh) {
                    return Err(MISSING.to_owned());
                }
                self.last = Some(cylinder);
            }
            _ => return Err(MISSING.to_owned()),
        }
        Ok(decoder.into_inner())
    }

    fn cylinder(self) -> Result<Option<Cylinder>, String> {
        match (self.first, self.last) {
            (Some(first), Some(last)) => {
                let mut cylinder = known(&last)?;
                cylinder.stream.adopt_segments(first.stream);
                Ok(Some(cylinder))
            }
            (first, _) => Ok(first),
        }
    }
}

/// The cylinder in a record, and its blocks; else what is wrong with it.
fn parts(mut body: &[u8], name: &str) -> Result<(Value, Option<Fresh>), String> {
    let version = || format!("of another version, this one reads `{SCHEMA}`");
    // A list whose first is the version.
    if body.get(2..2 + SCHEMA.len()) != Some(SCHEMA.as_bytes()) {
        return Err(version());
    }
    let (_, saved_name, cylinder, fresh): (String, String, Value, Value) =
        ciborium::from_reader(&mut body).map_err(|_| version())?;
    if !body.is_empty() {
        return Err(TOO_MUCH.to_owned());
    }
    if saved_name != name {
        return Err(format!("of the cylinder `{}`", crate::header::shorten(&saved_name, 40)));
    }
    if !every_number(&fresh, &f64::is_finite) {
        return Err(IMPOSSIBLE.to_owned());
    }
    Ok((cylinder, deserialized(&fresh)?))
}

/// A cylinder that can be.
fn known(tree: &Value) -> Result<Cylinder, String> {
    // Of the watch itself; estimators look at their own.
    if !every_number(tree, &|number| number.abs() <= LARGEST_NUMBER) {
        return Err(IMPOSSIBLE.to_owned());
    }
    let cylinder: Cylinder = deserialized(tree)?;
    if !cylinder.is_possible() {
        return Err("its counts contradict each other".to_owned());
    }
    Ok(cylinder)
}

fn deserialized<T: DeserializeOwned>(tree: &Value) -> Result<T, String> {
    tree.deserialized().map_err(|ciborium::value::Error::Custom(why)| why)
}
