//! File formats: the first bytes, not the name, tell which a file is, and how its rows are read; and files that are given in a
//! trace's place by mistake, with what to do about each: asked only where no trace was found.

use super::error::TraceFault;
#[cfg(feature = "parquet")]
use super::parquet;
use super::records::text;
use super::row::RowSource;
use super::table_text::TextTable;
use super::{csv, mat};
use crate::rig::Rig;
use std::fs::File;
use std::io::{BufReader, Cursor, Read};

/// One format, registered in [`FORMATS`].
pub(super) struct Format {
    /// First bytes of every such file, four at most; none of text.
    starts_with: &'static [u8],
    /// How its rows are read.
    pub(super) open: fn(Stream, &Rig) -> Result<Rows, TraceFault>,
    /// The names of its columns and their first cells, also where they make no trace yet.
    pub(super) look: fn(Stream, &Rig) -> Result<TextTable, TraceFault>,
}

pub(super) type Rows = Box<dyn RowSource + Send>;

/// A trace's bytes, decompressed.
pub(super) struct Stream {
    /// The first bytes once more.
    pub(super) start: Vec<u8>,
    pub(super) bytes: Box<dyn Read + Send>,
    /// Whether they come out of gzip, which may break off.
    pub(super) gzip: bool,
    /// The file that they come from as they are, where it is one: it can be read from anywhere.
    #[cfg_attr(not(feature = "parquet"), allow(dead_code))]
    pub(super) file: Option<File>,
}

/// More than this of a file that is not read as a stream is not held, bytes.
pub(super) const MOST_HELD: u64 = 1 << 30;

impl Stream {
    /// All bytes.
    pub(super) fn hold(self) -> Result<Vec<u8>, TraceFault> {
        let mut held = Vec::new();
        let read = self.bytes.take(MOST_HELD + 1).read_to_end(&mut held);
        read.map_err(|source| TraceFault::Read { line: 0, source })?;
        if held.len() as u64 > MOST_HELD {
            return Err(TraceFault::Format("more than a gigabyte: give it as a file on a disk, or in parts"));
        }
        Ok(held)
    }
}

/// What a file shows of itself; in small letters.
struct Shown {
    /// How it begins.
    begins: &'static str,
    /// What stands in its first lines.
    holds: &'static str,
    /// What it is, and what to give.
    line: &'static str,
}

/// The first that fits is taken.
const KINDS: &[Shown] = &[
    Shown {
        begins: "",
        holds: "\n[cylinder]",
        line: "a rig file, not a trace: give it by `--rig FILE`, and the trace in its place",
    },
    Shown {
        begins: "{",
        holds: "\"pitchleak.simulate/",
        line: "what is true of a simulated trace, not the trace: that is the file that `simulate --out` wrote beside it",
    },
    Shown {
        begins: "{",
        holds: "\"pitchleak.",
        line: "a result of pitchleak (`--json`), not a trace: give the trace that it is of",
    },
    Shown {
        begins: "{\"type\":",
        holds: "",
        line: "what `pitchleak watch` wrote, not a trace: give the samples that it read",
    },
    Shown {
        begins: "{",
        holds: "",
        line: "JSON, not a table: `pitchleak watch` reads samples in lines of JSON; here give CSV, Parquet or MAT",
    },
    Shown {
        begins: "<",
        holds: "content=\"pitchleak ",
        line: "a report of pitchleak for a browser, not a trace: give the trace that it is of",
    },
    Shown { begins: "<", holds: "<html", line: "a page for a browser (HTML), not a trace: export it as CSV" },
    Shown {
        begins: "t_s,internal_leak_coefficient,",
        holds: "",
        line: "estimates that `replay --out` wrote, not a trace: give the trace that they are of",
    },
    Shown {
        begins: "cylinder,path,begins,rig,status,",
        holds: "",
        line: "a table that `fleet --out` wrote, not a trace: give the traces that it is of",
    },
    Shown {
        begins: "mdf     ",
        holds: "",
        line: "MDF, a measurement file: export it as CSV; in Python, examples/mdf4_and_tdms.py reads it",
    },
    Shown {
        begins: "trace,rig",
        holds: ".toml",
        line: "a table of rig files, not a trace: `pitchleak fleet` reads it by `--rig FILE`",
    },
];

/// What a file is that begins so, where that is plain.
pub(super) fn mistaken(start: &[u8]) -> Option<TraceFault> {
    let start = format!("\n{}", text(start).trim_start_matches('\u{feff}').trim_start().to_lowercase());
    let fits = |kind: &&Shown| start[1..].starts_with(kind.begins) && start.contains(kind.holds);
    KINDS.iter().find(fits).map(|kind| TraceFault::Format(kind.line))
}

/// Every format that is read; the first that fits is taken.
const FORMATS: &[Format] = &[
    #[cfg(feature = "parquet")]
    Format { starts_with: b"PAR1", open: parquet::open, look: parquet::look },
    Format { starts_with: b"MATL", open: mat::open, look: mat::look },
    // Text is whatever no other format knows as its own.
    Format { starts_with: b"", open: csv::open, look: csv::look },
];

/// Formats that are known and not read, by their first bytes, and what to do instead.
const REFUSED: &[(&[u8], &str)] = &[
    #[cfg(not(feature = "parquet"))]
    (b"PAR1", "Parquet needs a build with the cargo feature `parquet`: export the trace as .csv or .csv.gz"),
    (b"\x89HDF", "HDF5 cannot be read but in MAT files: export the trace as .csv, .parquet or .mat"),
    (b"PK\x03\x04", "an Excel workbook or a zip archive: save the sheet as CSV"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook: save the sheet as CSV"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd: unpack it (zstd -d), or compress it by gzip"),
    (b"\xfd7zX", "compressed by xz: unpack it (xz -d), or compress it by gzip"),
    (b"TDSm", "TDMS, of LabVIEW: export it as CSV; in Python, examples/mdf4_and_tdms.py reads it"),
];

/// Bytes by which a format is told.
const MAGIC: usize = 4;

/// Opens a trace file of any format, compressed or not; `file` is the same where it is one on a disk.
pub(super) fn open(bytes: Box<dyn Read + Send>, file: Option<File>, rig: &Rig) -> Result<Rows, TraceFault> {
    let (format, stream) = start(bytes, file)?;
    (format.open)(stream, rig)
}

/// Tells the format.
///
/// # Errors
/// Where it is none that is read.
pub(super) fn start(
    bytes: Box<dyn Read + Send>,
    file: Option<File>,
) -> Result<(&'static Format, Stream), TraceFault> {
    let (mut start, mut bytes) = peek(bytes)?;
    let gzip = start.starts_with(b"\x1f\x8b");
    if gzip {
        let buffered = BufReader::with_capacity(64 * 1024, bytes);
        (start, bytes) = peek(Box::new(flate2::bufread::MultiGzDecoder::new(buffered)))?;
    }
    let file = file.filter(|_| !gzip);
    if let Some((_, instead)) = REFUSED.iter().find(|(first, _)| start.starts_with(first)) {
        return Err(TraceFault::Format(instead));
    }
    let format = FORMATS.iter().find(|format| start.starts_with(format.starts_with));
    let format = format.ok_or(TraceFault::Empty)?;
    Ok((format, Stream { start, bytes, gzip, file }))
}

/// The first bytes, and all of them.
fn peek(mut source: Box<dyn Read + Send>) -> Result<(Vec<u8>, Box<dyn Read + Send>), TraceFault> {
    let mut start = Vec::with_capacity(MAGIC);
    let read = source.by_ref().take(MAGIC as u64).read_to_end(&mut start);
    read.map_err(|source| TraceFault::Read { line: 0, source })?;
    let whole = Cursor::new(start.clone()).chain(source);
    Ok((start, Box::new(whole)))
}
