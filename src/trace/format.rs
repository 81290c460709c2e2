//! Formats of trace files, told by the first bytes and not by the name.

use super::csv::CsvRows;
use super::error::TraceFault;
use super::row::RowSource;
use crate::rig::ColumnMap;
use std::io::{BufReader, Cursor, Read};

/// Bytes by which a format is told.
const MAGIC: usize = 4;

struct Format {
    starts_with: &'static [u8],
    open: fn(Stream, &ColumnMap) -> Result<Rows, TraceFault>,
}

type Rows = Box<dyn RowSource + Send>;

/// Every format; the first that fits is taken.
const FORMATS: [Format; 2] = [
    Format {
        starts_with: b"PAR1",
        open: |_, _| {
            Err(TraceFault::Format("Parquet cannot be read yet: export the trace as .csv or .csv.gz"))
        },
    },
    Format { starts_with: b"", open: |stream, map| Ok(Box::new(CsvRows::open(stream, map)?)) },
];

/// A trace's bytes, decompressed.
pub(super) struct Stream {
    pub(super) bytes: Box<dyn Read + Send>,
    /// Whether they come out of gzip, which may break off.
    pub(super) gzip: bool,
}

/// Opens a trace file of any format, compressed or not.
pub(super) fn open(bytes: Box<dyn Read + Send>, map: &ColumnMap) -> Result<Rows, TraceFault> {
    let (mut start, mut bytes) = peek(bytes)?;
    let gzip = start.starts_with(b"\x1f\x8b");
    if gzip {
        let buffered = BufReader::with_capacity(64 * 1024, bytes);
        (start, bytes) = peek(Box::new(flate2::bufread::MultiGzDecoder::new(buffered)))?;
    }
    match FORMATS.iter().find(|format| start.starts_with(format.starts_with)) {
        Some(format) => (format.open)(Stream { bytes, gzip }, map),
        None => Err(TraceFault::Empty),
    }
}

/// The first bytes, and all of them.
fn peek(mut source: Box<dyn Read + Send>) -> Result<(Vec<u8>, Box<dyn Read + Send>), TraceFault> {
    let mut start = Vec::with_capacity(MAGIC);
    let read = source.by_ref().take(MAGIC as u64).read_to_end(&mut start);
    read.map_err(|source| TraceFault::Read { line: 0, source })?;
    let whole = Cursor::new(start.clone()).chain(source);
    Ok((start, Box::new(whole)))
}
