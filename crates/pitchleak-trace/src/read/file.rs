//! Opens a file of rows: its format is told by the first bytes and not by the name.

use super::error::TraceFault;
use super::format::{Format, Rows, Stream};
use super::{csv, mat, parquet};
use crate::rig::Rig;
use std::fs::File;
use std::io::{BufReader, Cursor, Read};

/// Every format; the first that fits is taken.
const FORMATS: &[Format] = &[
    parquet::FORMAT,
    mat::FORMAT,
    Format::refused(
        b"\x89HDF",
        "HDF5 cannot be read but in MAT files: export the trace as .csv, .parquet or .mat",
    ),
    Format::refused(b"PK\x03\x04", "an Excel workbook or a zip archive: save the sheet as CSV"),
    Format::refused(b"\xd0\xcf\x11\xe0", "an Excel workbook: save the sheet as CSV"),
    Format::refused(b"\x28\xb5\x2f\xfd", "compressed by zstd: unpack it (zstd -d), or compress it by gzip"),
    Format::refused(b"\xfd7zX", "compressed by xz: unpack it (xz -d), or compress it by gzip"),
    Format::refused(
        b"TDSm",
        "TDMS, of LabVIEW: export it as CSV; in Python, examples/mdf4_and_tdms.py reads it",
    ),
    csv::FORMAT,
];

/// Bytes by which a format is told.
const MAGIC: usize = 4;

/// Opens a trace file of any format, compressed or not; `file` is the same where it is one on a disk.
pub(super) fn open(bytes: Box<dyn Read + Send>, file: Option<File>, rig: &Rig) -> Result<Rows, TraceFault> {
    let (format, stream) = start(bytes, file)?;
    format.open(stream, rig)
}

/// Tells the format.
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
    match FORMATS.iter().find(|format| start.starts_with(format.starts_with)) {
        Some(format) => Ok((format, Stream { start, bytes, gzip, file })),
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
