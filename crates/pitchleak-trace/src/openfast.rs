//! Reader of OpenFAST output files, text (`.out`) and binary (`.outb`).
//!
//! Layout of the binary format: OpenFAST `modules/nwtc-library/src/NWTC_IO.f90`, `WrBinFAST`
//! (file ids 1 to 4). A file is recognised by its content, not by its name.
//!
//! ```no_run
//! let run = pitchleak_trace::openfast::read("run.outb".as_ref())?;
//! let pitch = run.channel("BldPitch1").ok_or("no pitch in this run")?;
//! println!("{} samples of pitch in {}", pitch.values.len(), pitch.unit);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::header::shorten;
use std::path::{Path, PathBuf};

/// One OpenFAST run: its channels over a common time.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Run {
    /// What the file says of itself: program versions and the input file's title.
    pub description: String,
    /// Simulated time of each sample, s.
    pub time_s: Vec<f64>,
    /// The channels in the file's order, time left out; each is as long as `time_s`.
    pub channels: Vec<Channel>,
}

/// One output channel.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Channel {
    /// Name as OpenFAST writes it, e.g. `BldPitch1`.
    pub name: String,
    /// Unit without its parentheses, e.g. `deg`, `kN-m`; empty where the file has none.
    pub unit: String,
    /// The samples, in `unit`. They may hold NaN or infinities if the file does.
    pub values: Vec<f64>,
}

impl Run {
    /// The channel called `name`, in any case.
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|c| c.name.eq_ignore_ascii_case(name))
    }
}

/// What is wrong with an OpenFAST file. Offsets count bytes, lines and columns count from 1.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be read at all.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The content is wrong, in the way `problem` says.
    #[error("{path}: {problem}", path = path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Where and how.
        problem: Problem,
    },
}

/// How the content of an OpenFAST file is wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// A binary file with an id that OpenFAST does not have.
    #[error("file id {0} is not one of OpenFAST's (1, 2, 3 or 4)")]
    FileId(i16),
    /// A binary file ends before what its header promises.
    #[error("ends at byte {length} within its {part}: cut short, or not an OpenFAST file")]
    Truncated {
        /// What was being read.
        part: &'static str,
        /// Length of the file.
        length: usize,
    },
    /// A count or length in a binary header is impossible.
    #[error("{part} is {value} in the header, which cannot be")]
    Count {
        /// What is counted.
        part: &'static str,
        /// What the header says.
        value: i64,
    },
    /// A compressed channel cannot be scaled back.
    #[error("scale or offset of {channel} is zero or not a finite number")]
    Scale {
        /// Name of the channel.
        channel: String,
    },
    /// A text file without the line of channel names.
    #[error("has no line of channel names that begins with \"Time\": not an OpenFAST output file")]
    NoHeader,
    /// The line of units does not match the line of names.
    #[error("line {line}: {found} units for {expected} channels")]
    Units {
        /// Line in the file.
        line: usize,
        /// Units found.
        found: usize,
        /// Channels named.
        expected: usize,
    },
    /// A row is too short or too long.
    #[error("line {line}: {found} values for {expected} channels")]
    RowLength {
        /// Line in the file.
        line: usize,
        /// Values found.
        found: usize,
        /// Channels named.
        expected: usize,
    },
    /// A value is not a number.
    #[error("line {line}, column {column}: {text:?} is not a number")]
    NotANumber {
        /// Line in the file.
        line: usize,
        /// Column (channel) in the line.
        column: usize,
        /// The value as written, cut to a readable length.
        text: String,
    },
}

/// Reads the OpenFAST file at `path`, text or binary.
///
/// # Errors
/// [`Error::Io`] when it cannot be read, [`Error::Content`] when it is damaged or not such a file.
pub fn read(path: &Path) -> Result<Run, Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })?;
    parse(&bytes).map_err(|problem| Error::Content { path: path.into(), problem })
}

/// Parses the whole content of an OpenFAST file, text or binary.
///
/// # Errors
/// The first [`Problem`] found. Memory stays within a small multiple of `bytes`.
pub fn parse(bytes: &[u8]) -> Result<Run, Problem> {
    // A binary file begins with an id of two bytes whose high byte is zero, as no text begins.
    if matches!(bytes, [_, 0, ..]) { parse_binary(bytes) } else { parse_text(bytes) }
}

/// Text of one byte per character: units may hold 0xB7, the middle dot of Latin-1.
fn latin1(bytes: &[u8]) -> String {
    bytes.iter().map(|&b| char::from(b)).collect()
}

/// A unit without the parentheses that OpenFAST puts around it.
fn bare_unit(text: &str) -> String {
    let text = text.trim();
    text.strip_prefix('(').and_then(|t| t.strip_suffix(')')).unwrap_or(text).trim().to_owned()
}

/// Longest piece of a bad value that a message quotes.
const QUOTED: usize = 24;

/// Parses a text output file: a free description, the line of names, the line of units, one row
/// per sample.
fn parse_text(bytes: &[u8]) -> Result<Run, Problem> {
    let mut lines = bytes.split(|&b| b == b'\n').map(latin1).zip(1..);
    let mut description = String::new();
    let names = loop {
        let (line, _) = lines.next().ok_or(Problem::NoHeader)?;
        if cells(&line).next().is_some_and(|first| first.eq_ignore_ascii_case("time")) {
            break line;
        }
        describe(&mut description, line.trim());
    };
    let (units, line) = lines.next().ok_or(Problem::NoHeader)?;
    let expected = cells(&names).count();
    let found = cells(&units).count();
    if found != expected {
        return Err(Problem::Units { line, found, expected });
    }
    let channel = |(name, unit): (&str, &str)| Channel {
        name: name.to_owned(),
        unit: bare_unit(unit),
        values: Vec::new(),
    };
    let mut run = Run {
        description,
        time_s: Vec::new(),
        channels: cells(&names).zip(cells(&units)).skip(1).map(channel).collect(),
    };
    for (row, line) in lines.filter(|(row, _)| !row.trim().is_empty()) {
        push(&mut run, &row, line)?;
    }
    Ok(run)
}

fn describe(description: &mut String, line: &str) {
    if !line.is_empty() {
        if !description.is_empty() {
            description.push(' ');
        }
        description.push_str(line);
    }
}

/// The cells of one line. OpenFAST separates them by tabs or, with another `OutFmt`, by spaces.
fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.split_ascii_whitespace()
}

fn push(run: &mut Run, row: &str, line: usize) -> Result<(), Problem> {
    let expected = run.channels.len() + 1;
    let found = cells(row).count();
    if found != expected {
        return Err(Problem::RowLength { line, found, expected });
    }
    let columns = std::iter::once(&mut run.time_s).chain(run.channels.iter_mut().map(|c| &mut c.values));
    for (column, (text, values)) in cells(row).zip(columns).enumerate() {
        let text_error = || Problem::NotANumber { line, column: column + 1, text: shorten(text, QUOTED) };
        values.push(text.parse().map_err(|_| text_error())?);
    }
    Ok(())
}

/// Ids, the two bytes that a file begins with. 1: 16-bit channels, 32-bit time; 2: time by first value and step; 3: 64-bit
/// channels; 4: as 2, with the length of the channel names in the header.
const WITH_TIME: i16 = 1;
const UNCOMPRESSED: i16 = 3;
const NAMED: i16 = 4;

/// Length of a channel name where the header gives none, `ChanLen` of WrBinFAST.
const DEFAULT_NAME_LENGTH: usize = 10;

/// Parses a binary output file.
///
/// Every count is held against the bytes that are left before memory is asked for.
fn parse_binary(bytes: &[u8]) -> Result<Run, Problem> {
    let mut cursor = Cursor { rest: bytes, length: bytes.len() };
    let id = cursor.one("file id", i16::from_le_bytes)?;
    if !(1..=4).contains(&id) {
        return Err(Problem::FileId(id));
    }
    let name_length = match id {
        NAMED => positive("length of channel names", cursor.one("header", i16::from_le_bytes)?.into())?,
        _ => DEFAULT_NAME_LENGTH,
    };
    let count = positive("number of channels", cursor.i32("header")?.into())?;
    let samples = not_negative("number of samples", cursor.i32("header")?.into())?;
    // Of packed time the scale and offset, else the first value and the step, s.
    let (time_first, time_second) = (cursor.f64("header")?, cursor.f64("header")?);
    let scaling = match id {
        UNCOMPRESSED => None,
        _ => Some([
            cursor.array(count, "channel scales", f32::from_le_bytes)?,
            cursor.array(count, "channel offsets", f32::from_le_bytes)?,
        ]),
    };
    let description_length = not_negative("length of the description", cursor.i32("header")?.into())?;
    let description = latin1(cursor.take(description_length, "description")?).trim().to_owned();
    let mut channels = named_channels(&mut cursor, count, name_length)?;
    let packed_time = match id {
        WITH_TIME => Some(cursor.array(samples, "time", |bytes| i32::from_le_bytes(bytes).into())?),
        _ => None,
    };
    let columns = match scaling {
        Some(_) => columns(&mut cursor, count, samples, |bytes| i16::from_le_bytes(bytes).into())?,
        None => columns(&mut cursor, count, samples, f64::from_le_bytes)?,
    };
    channels.iter_mut().zip(columns).for_each(|(channel, values)| channel.values = values);
    if let Some([scales, offsets]) = scaling {
        for (Channel { name, values, .. }, (scale, offset)) in
            channels.iter_mut().zip(scales.into_iter().zip(offsets))
        {
            unpack(values, scale.into(), offset.into(), name)?;
        }
    }
    // Only now is `samples` known to be backed by that many rows.
    let time_s = match packed_time {
        Some(mut time_s) => {
            unpack(&mut time_s, time_first, time_second, "Time")?;
            time_s
        }
        None => (0..samples).map(|k| time_first + time_second * k as f64).collect(),
    };
    Ok(Run { description, time_s, channels })
}

/// Numbers of which the file has scale and offset.
fn unpack(values: &mut [f64], scale: f64, offset: f64, channel: &str) -> Result<(), Problem> {
    if scale == 0.0 || !scale.is_finite() || !offset.is_finite() {
        return Err(Problem::Scale { channel: channel.to_owned() });
    }
    values.iter_mut().for_each(|value| *value = (*value - offset) / scale);
    Ok(())
}

/// The names, then the units, of time and of every channel.
fn named_channels(cursor: &mut Cursor, count: usize, length: usize) -> Result<Vec<Channel>, Problem> {
    cursor.take(length, "channel names")?;
    let names = cursor.records(count, length, "channel names")?;
    cursor.take(length, "channel units")?;
    let units = cursor.records(count, length, "channel units")?;
    let text = |record| latin1(record).trim().to_owned();
    Ok(names
        .zip(units)
        .map(|(name, unit)| Channel { name: text(name), unit: bare_unit(&latin1(unit)), values: Vec::new() })
        .collect())
}

/// The samples of each channel; in the file those of one time stand together.
fn columns<const N: usize>(
    cursor: &mut Cursor,
    count: usize,
    samples: usize,
    from_le: fn([u8; N]) -> f64,
) -> Result<Vec<Vec<f64>>, Problem> {
    let data = cursor.array(samples.saturating_mul(count), "samples", from_le)?;
    let column = |column| data.iter().skip(column).step_by(count).copied().collect();
    Ok((0..count).map(column).collect())
}

fn positive(part: &'static str, value: i64) -> Result<usize, Problem> {
    match not_negative(part, value)? {
        0 => Err(Problem::Count { part, value }),
        count => Ok(count),
    }
}

fn not_negative(part: &'static str, value: i64) -> Result<usize, Problem> {
    usize::try_from(value).map_err(|_| Problem::Count { part, value })
}

/// What is left of the file.
struct Cursor<'a> {
    rest: &'a [u8],
    length: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize, part: &'static str) -> Result<&'a [u8], Problem> {
        let (head, rest) =
            self.rest.split_at_checked(count).ok_or(Problem::Truncated { part, length: self.length })?;
        self.rest = rest;
        Ok(head)
    }

    fn records(
        &mut self,
        count: usize,
        length: usize,
        part: &'static str,
    ) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, Problem> {
        let total = count.saturating_mul(length);
        Ok(self.take(total, part)?.chunks_exact(length))
    }

    fn array<T, const N: usize>(
        &mut self,
        count: usize,
        part: &'static str,
        from_le: fn([u8; N]) -> T,
    ) -> Result<Vec<T>, Problem> {
        let (chunks, _) = self.take(count.saturating_mul(N), part)?.as_chunks::<N>();
        Ok(chunks.iter().copied().map(from_le).collect())
    }

    fn one<T, const N: usize>(
        &mut self,
        part: &'static str,
        from_le: fn([u8; N]) -> T,
    ) -> Result<T, Problem> {
        let length = self.length;
        let (head, rest) = self.rest.split_first_chunk::<N>().ok_or(Problem::Truncated { part, length })?;
        self.rest = rest;
        Ok(from_le(*head))
    }

    fn i32(&mut self, part: &'static str) -> Result<i32, Problem> {
        self.one(part, i32::from_le_bytes)
    }

    fn f64(&mut self, part: &'static str) -> Result<f64, Problem> {
        self.one(part, f64::from_le_bytes)
    }
}
