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

mod binary;

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
    if matches!(bytes, [_, 0, ..]) { binary::parse(bytes) } else { parse_text(bytes) }
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
