//! The numbers of a vector in HDF5.

use super::hdf5::{File, Found, Front, Trouble};
use super::{Form, Values, Written};
use crate::read::format::MOST_HELD;
use flate2::read::ZlibDecoder;
use std::io::Read;

/// Classes of data types.
const WHOLE: u64 = 0;
const FLOATING: u64 = 1;
const TEXT: u64 = 3;
const COMPOUND: u64 = 6;

/// Layouts of data.
const COMPACT: u64 = 0;
const CONTIGUOUS: u64 = 1;
const CHUNKED: u64 = 2;
const OF_CHUNKS: u64 = 1;

/// Filters.
const DEFLATE: u64 = 1;
const SHUFFLE: u64 = 2;

/// An array of which one dimension at most is not 1.
struct Shape {
    dimensions: Vec<u64>,
    /// That one.
    axis: usize,
    length: u64,
}

/// The numbers of an array, or what it is instead.
pub(super) fn vector(
    file: &mut File<'_>,
    dataspace: &[u8],
    datatype: &[u8],
    layout: &[u8],
    filters: Option<&[u8]>,
    budget: &mut u64,
) -> Found<Values> {
    let Some(shape) = Shape::of(dataspace)? else { return Ok(Err("matrix")) };
    let written = match written(datatype)? {
        Ok(written) => written,
        Err(other) => return Ok(Err(other)),
    };
    *budget = budget.checked_sub(shape.length).ok_or(Trouble::TooLarge)?;
    let mut layout = Front(layout);
    if layout.number(1)? != 3 {
        return Err(Trouble::Form);
    }
    let size = shape.length * written.width as u64;
    let plain = match layout.number(1)? {
        COMPACT => {
            let held = layout.number(2)?;
            layout.take(held)?
        }
        CONTIGUOUS => {
            let (mut at, held) = (file.at(layout.number(8)?)?, layout.number(8)?);
            at.take(held)?
        }
        CHUNKED => return chunks(file, layout, &shape, written, filters).map(Ok),
        _ => return Err(Trouble::Form),
    };
    if plain.len() as u64 != size {
        return Err(Trouble::Damaged);
    }
    Ok(Ok(written.numbers(plain, 1).collect()))
}

impl Shape {
    /// None of a matrix.
    fn of(dataspace: &[u8]) -> Found<Option<Self>> {
        let mut space = Front(dataspace);
        let (version, rank) = (space.number(1)?, space.number(1)?);
        space.take(match version {
            1 => 6,
            2 => 2,
            _ => return Err(Trouble::Form),
        })?;
        let dimensions = (0..rank).map(|_| space.number(8)).collect::<Found<Vec<u64>>>()?;
        if dimensions.iter().filter(|size| **size != 1).count() > 1 {
            return Ok(None);
        }
        let axis = dimensions.iter().position(|size| *size != 1).unwrap_or(0);
        let length = dimensions.get(axis).copied().unwrap_or(1);
        Ok(Some(Self { dimensions, axis, length }))
    }
}

/// How numbers of this type are written, or what is written instead.
fn written(datatype: &[u8]) -> Found<Result<Written, &'static str>> {
    let mut datatype = Front(datatype);
    let (class, bits) = (datatype.number(1)? & 0x0f, datatype.number(3)?);
    let (form, width) = match (class, datatype.number(4)?) {
        (WHOLE, width @ (1 | 2 | 4 | 8)) if bits & 8 != 0 => (Form::Signed, width),
        (WHOLE, width @ (1 | 2 | 4 | 8)) => (Form::Unsigned, width),
        (FLOATING, width @ (4 | 8)) => (Form::Floating, width),
        (TEXT, _) => return Ok(Err("text")),
        (COMPOUND, _) => return Ok(Err("complex array")),
        _ => return Ok(Err("variable of an unknown class")),
    };
    Ok(Ok(Written { form, width: width as usize, big_endian: bits & 1 != 0 }))
}

/// The numbers of chunks, which follow one another.
fn chunks(
    file: &mut File<'_>,
    mut layout: Front<'_>,
    shape: &Shape,
    written: Written,
    filters: Option<&[u8]>,
) -> Found<Vec<f64>> {
    let rank = shape.dimensions.len();
    // The size of a number is one more.
    if layout.number(1)? != rank as u64 + 1 || rank == 0 {
        return Err(Trouble::Damaged);
    }
    let tree = layout.number(8)?;
    let sides = (0..rank).map(|_| layout.number(4)).collect::<Found<Vec<u64>>>()?;
    let product = |sides: &[u64]| sides.iter().try_fold(1_u64, |product, side| product.checked_mul(*side));
    let size = product(&sides).and_then(|count| count.checked_mul(written.width as u64));
    let size = size.filter(|size| (1..=MOST_HELD).contains(size)).ok_or(Trouble::Damaged)?;
    let (before, along) = sides.split_at(shape.axis);
    let step = along.first().copied().unwrap_or(1);
    let stride = along.get(1..).and_then(product).unwrap_or(1) as usize;
    let filters = filters.map_or(Ok(Vec::new()), filter_ids)?;
    let mut leaves = Vec::new();
    for (key, address) in file.leaves(tree, OF_CHUNKS, 8 + 8 * (rank as u64 + 1))? {
        let mut key = Front(key);
        let (held, passed) = (key.number(4)?, key.number(4)?);
        key.take(8 * before.len() as u64)?;
        leaves.push((key.number(8)?, held, passed, address));
    }
    // Also where each holds one number of use.
    if size.saturating_mul(leaves.len() as u64) > MOST_HELD {
        return Err(Trouble::TooLarge);
    }
    leaves.sort_unstable();
    let mut values = Vec::new();
    for (start, held, passed, address) in leaves {
        let left = shape.length.saturating_sub(values.len() as u64).min(step);
        if start != values.len() as u64 || left == 0 {
            return Err(Trouble::Damaged);
        }
        let bytes = unfiltered(file.at(address)?.take(held)?, &filters, passed, size, written.width)?;
        values.extend(written.numbers(&bytes, stride).take(left as usize));
    }
    if values.len() as u64 != shape.length {
        return Err(Trouble::Damaged);
    }
    Ok(values)
}

/// The filters in the order in which they were applied.
fn filter_ids(message: &[u8]) -> Found<Vec<u64>> {
    let mut message = Front(message);
    let (version, count) = (message.number(1)?, message.number(1)?);
    if version != 1 {
        return Err(Trouble::Form);
    }
    message.take(6)?;
    let mut ids = Vec::new();
    for _ in 0..count {
        let (id, name) = (message.number(2)?, message.number(2)?);
        message.take(2)?;
        let values = message.number(2)?;
        message.take(name.next_multiple_of(8) + 4 * values.next_multiple_of(2))?;
        if !matches!(id, DEFLATE | SHUFFLE) {
            return Err(Trouble::Form);
        }
        ids.push(id);
    }
    Ok(ids)
}

/// A chunk of `size` bytes before the filters, the last of which was applied last; those of the bits of `passed` were not.
fn unfiltered(chunk: &[u8], filters: &[u64], passed: u64, size: u64, width: usize) -> Found<Vec<u8>> {
    let mut bytes = chunk.to_vec();
    for (place, filter) in filters.iter().enumerate().rev() {
        if place < 32 && passed >> place & 1 == 1 {
            continue;
        }
        bytes = match *filter {
            DEFLATE => {
                let mut inflated = Vec::new();
                let read = ZlibDecoder::new(bytes.as_slice()).take(size + 1).read_to_end(&mut inflated);
                read.map_err(|_| Trouble::Damaged)?;
                inflated
            }
            _ => unshuffled(&bytes, width),
        };
    }
    if bytes.len() as u64 != size { Err(Trouble::Damaged) } else { Ok(bytes) }
}

/// All first bytes stand before all second ones.
fn unshuffled(bytes: &[u8], width: usize) -> Vec<u8> {
    let count = bytes.len() / width;
    let at = |place: usize| bytes.get(place % width * count + place / width).copied();
    (0..bytes.len()).map(|place| at(place).unwrap_or_default()).collect()
}
