//! MAT files as MATLAB and Octave write them (version 5: `save -v6`, `-v7`; 7.3: `-v7.3`): a numeric vector per signal.
//!
//! MathWorks, "MAT-File Format", chapter 1 (Level 5).

mod hdf5;
mod vector;

use super::clock::{Epoch, ROWS, cell_text, first_rows, time_format};
use super::error::{Counted, TraceFault};
use super::format::{MOST_HELD, Rows, Stream};
use super::table::{Cells, TableRows};
use super::table_text::{Bound, TextRow, TextTable};
use crate::header::shorten;
use crate::rig::Rig;
use flate2::read::ZlibDecoder;
use std::borrow::Cow;
use std::io::{self, Read};
use std::sync::Arc;

/// Types of data elements that hold others.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

/// What the header says of a file that is HDF5 behind it; big-endian machines write none.
const VERSION_7_3: [u8; 2] = [0, 2];

/// No name or list of dimensions is longer, bytes.
const LONGEST_HEADER: u32 = 4096;

/// The numbers of a vector, or what a variable is instead.
type Values = Result<Vec<f64>, &'static str>;

/// Each variable of a file by its name.
type Variables = Vec<(String, Values)>;

pub(super) fn open(stream: Stream, rig: &Rig) -> Result<Rows, TraceFault> {
    let Vectors { names, values, short, others } = vectors(stream)?;
    let TextTable { bound, rows, .. } = TextTable::of_columns(names, sample(&values), rig);
    let Bound { mut layout, foreign } = bound.map_err(|fault| with_others(fault, &others, &short))?;
    layout.counted = Counted::Rows;
    layout.time = time_format(&rows, &layout, &foreign, rig)?;
    let mut epoch = Epoch::new(layout.time.clone());
    let mut cells = Vec::new();
    for (index, (column, mut values)) in layout.columns.iter().zip(values).enumerate() {
        let Some(content) = column.content else { continue };
        if column.is_timestamp() {
            values.iter_mut().for_each(|value| *value = epoch.seconds_of(*value));
        }
        cells.push(Cells::of(content, Cow::Owned(values), index));
    }
    let mut once = Some(cells);
    Ok(Box::new(TableRows::over(Arc::new(layout), Box::new(move || Ok(once.take())))))
}

pub(super) fn look(stream: Stream, rig: &Rig) -> Result<TextTable, TraceFault> {
    let Vectors { names, values, .. } = vectors(stream)?;
    Ok(TextTable::of_columns(names, sample(&values), rig))
}

fn sample(values: &[Vec<f64>]) -> Vec<TextRow> {
    let text = |values: &Vec<f64>| values.iter().take(ROWS).map(cell_text).collect();
    first_rows(&values.iter().map(text).collect::<Vec<_>>())
}

/// The vectors of a file that are as long as its longest, and what else is in it.
struct Vectors {
    names: Vec<String>,
    values: Vec<Vec<f64>>,
    short: Vec<(String, Vec<f64>)>,
    others: Vec<(String, &'static str)>,
}

fn vectors(stream: Stream) -> Result<Vectors, TraceFault> {
    let (mut vectors, mut others) = (Vec::new(), Vec::new());
    for (name, values) in read(stream)? {
        match values {
            Ok(values) => vectors.push((name, values)),
            Err(kind) => others.push((name, kind)),
        }
    }
    let longest = vectors.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
    let (columns, short): (Vec<_>, Vec<_>) =
        vectors.into_iter().partition(|(_, values)| values.len() == longest);
    let (names, values) = columns.into_iter().unzip();
    Ok(Vectors { names, values, short, others })
}

/// Where a signal is missing, what else the file holds may be why.
fn with_others(
    fault: TraceFault,
    others: &[(String, &'static str)],
    short: &[(String, Vec<f64>)],
) -> TraceFault {
    let (other, short) = (others.first(), short.first());
    let name = other.map(|(name, _)| name).or(short.map(|(name, _)| name));
    let name = name.map(|name| shorten(name, 40)).unwrap_or_default();
    match (fault, other, short) {
        (TraceFault::MissingColumn { .. }, Some((_, "struct")), _) => TraceFault::Ambiguous {
            what: format!("variable `{name}` is a struct, which is not read"),
            settle: format!("save its fields as variables: save('trace.mat', '-struct', '{name}')"),
        },
        (TraceFault::MissingColumn { .. }, Some((_, kind)), _) => TraceFault::Ambiguous {
            what: format!("variable `{name}` is a {kind}, which is not read"),
            settle: "save each signal as a numeric vector, e.g. t_s, x_mm, pa_bar, pb_bar".to_owned(),
        },
        (TraceFault::MissingColumn { signal, accepted, found, .. }, None, Some((_, values))) => {
            let hint = format!("; `{name}` has {} values and not as many as these", values.len());
            TraceFault::MissingColumn { signal, accepted, found, hint }
        }
        (fault, ..) => fault,
    }
}

const TOO_LARGE: &str = "more than a gigabyte of numbers: save the trace in parts, or as CSV or Parquet";

fn read(mut stream: Stream) -> Result<Variables, TraceFault> {
    let mut header = [0; 128];
    stream.bytes.read_exact(&mut header).map_err(damaged)?;
    if header.get(124..126) == Some(&VERSION_7_3) {
        stream.bytes = Box::new(io::Cursor::new(header).chain(stream.bytes));
        return hdf5::read(&stream.hold()?);
    }
    let big_endian = match header.get(126..) {
        Some(b"IM") => false,
        Some(b"MI") => true,
        _ => {
            return Err(TraceFault::Format(
                "a MAT file of another version than 5: save it with save -v7, or as CSV",
            ));
        }
    };
    let mut budget = MOST_HELD / 8;
    let mut variables = Vec::new();
    let mut elements = Elements { bytes: stream.bytes, big_endian };
    while let Some((kind, size)) = elements.outer_tag()? {
        let mut inside = elements.bytes.by_ref().take(u64::from(size));
        let variable = match kind {
            MATRIX => Elements { bytes: &mut inside, big_endian }.variable(&mut budget)?,
            COMPRESSED => {
                let mut inflated = Elements { bytes: ZlibDecoder::new(&mut inside), big_endian };
                let variable = match inflated.tag()? {
                    (MATRIX, ..) => inflated.variable(&mut budget)?,
                    _ => None,
                };
                // Its checksum stands at its end.
                if matches!(variable, Some((_, Ok(_)))) {
                    inflated.bytes.read(&mut [0]).map_err(damaged)?;
                }
                variable
            }
            _ => None,
        };
        io::copy(&mut inside, &mut io::sink()).map_err(damaged)?;
        if inside.limit() > 0 {
            return Err(damaged(io::ErrorKind::UnexpectedEof.into()));
        }
        variables.extend(variable);
    }
    Ok(variables)
}

fn damaged(error: io::Error) -> TraceFault {
    TraceFault::Damaged(format!("the MAT file breaks off ({error})"))
}

fn damaged_variable(name: &str, what: &str) -> TraceFault {
    TraceFault::Damaged(format!("`{}` {what}", shorten(name, 40)))
}

/// Data elements, one after the other.
struct Elements<R> {
    bytes: R,
    big_endian: bool,
}

impl<R: Read> Elements<R> {
    fn u32(&self, bytes: [u8; 4]) -> u32 {
        if self.big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
    }

    fn word(&mut self) -> Result<u32, TraceFault> {
        let mut bytes = [0; 4];
        self.bytes.read_exact(&mut bytes).map_err(damaged)?;
        Ok(self.u32(bytes))
    }

    /// Type and size of the next variable; none at the end of the file.
    fn outer_tag(&mut self) -> Result<Option<(u32, u32)>, TraceFault> {
        let mut first = [0; 4];
        let mut read = 0;
        while let Some(rest) = first.get_mut(read..).filter(|rest| !rest.is_empty()) {
            match self.bytes.read(rest).map_err(damaged)? {
                0 if read == 0 => return Ok(None),
                0 => return Err(damaged(io::ErrorKind::UnexpectedEof.into())),
                count => read += count,
            }
        }
        let kind = self.u32(first);
        Ok(Some((kind, self.word()?)))
    }

    /// Type and size of an element within a variable, and whether its data fill the second half of its tag.
    fn tag(&mut self) -> Result<(u32, u32, bool), TraceFault> {
        let word = self.word()?;
        match word >> 16 {
            0 => Ok((word, self.word()?, false)),
            size => Ok((word & 0xffff, size, true)),
        }
    }

    /// A short element.
    fn short(&mut self) -> Result<(u32, Vec<u8>), TraceFault> {
        let (kind, size, small) = self.tag()?;
        if size > if small { 4 } else { LONGEST_HEADER } {
            return Err(TraceFault::Damaged("a name or size in the MAT file has no end".to_owned()));
        }
        let mut bytes = vec![0; (size + padding(size, small)) as usize];
        self.bytes.read_exact(&mut bytes).map_err(damaged)?;
        bytes.truncate(size as usize);
        Ok((kind, bytes))
    }

    /// A variable after its own tag; none where it has no name.
    fn variable(&mut self, budget: &mut u64) -> Result<Option<(String, Values)>, TraceFault> {
        let (_, flags) = self.short()?;
        let flags = flags.first_chunk().map_or(0, |bytes| self.u32(*bytes));
        let (_, sizes) = self.short()?;
        let sizes: Vec<u64> = sizes.as_chunks().0.iter().map(|bytes| u64::from(self.u32(*bytes))).collect();
        let (_, name) = self.short()?;
        let name: String = String::from_utf8_lossy(&name).trim_end_matches('\0').to_owned();
        if name.is_empty() {
            return Ok(None);
        }
        let other = |kind| Ok(Some((name.clone(), Err(kind))));
        match flags & 0xff {
            1 => return other("cell array"),
            2 => return other("struct"),
            3 | 16 | 17 | 18 => return other("object"),
            4 => return other("text"),
            5 => return other("sparse matrix"),
            6..=15 => {}
            _ => return other("variable of an unknown class"),
        }
        if flags & 0x0800 != 0 {
            return other("complex array");
        }
        let length =
            sizes.iter().try_fold(1_u64, |length, size| length.checked_mul(*size)).unwrap_or(u64::MAX);
        if sizes.iter().filter(|size| **size != 1).count() > 1 {
            return other("matrix");
        }
        let (kind, size, small) = self.tag()?;
        let written = Written::of(kind, self.big_endian)
            .ok_or_else(|| damaged_variable(&name, &format!("holds data of type {kind}")))?;
        if length.checked_mul(written.width as u64) != Some(u64::from(size)) {
            return Err(damaged_variable(&name, &format!("has {size} bytes for {length} numbers")));
        }
        if small && size > 4 {
            let what = format!("has {size} bytes beside its tag, which has room for 4");
            return Err(damaged_variable(&name, &what));
        }
        *budget = budget.checked_sub(length).ok_or(TraceFault::Format(TOO_LARGE))?;
        let values = self.numbers(written, size, padding(size, small))?;
        Ok(Some((name, Ok(values))))
    }

    /// Numbers in pieces: memory is taken as they come, whatever the tag promises.
    fn numbers(&mut self, written: Written, size: u32, padding: u32) -> Result<Vec<f64>, TraceFault> {
        let mut values = Vec::new();
        let mut piece = vec![0; 64 * 1024];
        let mut left = size as usize;
        while left > 0 {
            let count = left.min(piece.len());
            let bytes = piece.get_mut(..count).unwrap_or_default();
            self.bytes.read_exact(bytes).map_err(damaged)?;
            values.extend(written.numbers(bytes, 1));
            left -= count;
        }
        io::copy(&mut self.bytes.by_ref().take(u64::from(padding)), &mut io::sink()).map_err(damaged)?;
        Ok(values)
    }
}

/// How numbers are written.
#[derive(Clone, Copy)]
struct Written {
    form: Form,
    /// Bytes of each, eight at most.
    width: usize,
    big_endian: bool,
}

#[derive(Clone, Copy)]
enum Form {
    Signed,
    Unsigned,
    Floating,
}

impl Written {
    /// In data elements of this type (miINT8 = 1 to miUINT64 = 13); none where they hold no numbers.
    fn of(kind: u32, big_endian: bool) -> Option<Self> {
        let (form, width) = match kind {
            1 => (Form::Signed, 1),
            2 => (Form::Unsigned, 1),
            3 => (Form::Signed, 2),
            4 => (Form::Unsigned, 2),
            5 => (Form::Signed, 4),
            6 => (Form::Unsigned, 4),
            7 => (Form::Floating, 4),
            9 => (Form::Floating, 8),
            12 => (Form::Signed, 8),
            13 => (Form::Unsigned, 8),
            _ => return None,
        };
        Some(Self { form, width, big_endian })
    }

    /// Every so many of the numbers.
    fn numbers(self, bytes: &[u8], stride: usize) -> impl Iterator<Item = f64> {
        bytes.chunks_exact(self.width).step_by(stride.max(1)).map(move |bytes| self.number(bytes))
    }

    fn number(self, bytes: &[u8]) -> f64 {
        let join = |word: u64, byte: &u8| word << 8 | u64::from(*byte);
        let word =
            if self.big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) };
        // The sign is the highest bit of the bytes that there are.
        let above = 64 - 8 * self.width as u32;
        match self.form {
            Form::Signed => ((word << above).cast_signed() >> above) as f64,
            Form::Unsigned => word as f64,
            Form::Floating if self.width == 4 => f32::from_bits(word as u32).into(),
            Form::Floating => f64::from_bits(word),
        }
    }
}

/// Bytes behind the data: elements end at multiples of eight bytes, those within a tag with the tag.
fn padding(size: u32, small: bool) -> u32 {
    if small { 4_u32.saturating_sub(size) } else { size.wrapping_neg() & 7 }
}

#[cfg(test)]
mod tests;
