//! What a file format is: the bytes by which it is told, and how its rows are read.

use super::error::TraceFault;
use super::row::RowSource;
use crate::rig::Rig;
use std::fs::File;
use std::io::Read;

/// One format, registered in `file.rs`.
pub(super) struct Format {
    /// First bytes of every such file, four at most; none of text.
    pub(super) starts_with: &'static [u8],
    pub(super) reading: Reading,
}

/// How the rows of a format are read.
pub(super) enum Reading {
    /// In this way.
    Rows(fn(Stream, &Rig) -> Result<Rows, TraceFault>),
    /// Not at all: what to do instead.
    Refused(&'static str),
}

impl Format {
    /// A format that is known, and not read.
    pub(super) const fn refused(starts_with: &'static [u8], instead: &'static str) -> Self {
        Self { starts_with, reading: Reading::Refused(instead) }
    }

    pub(super) fn open(&self, stream: Stream, rig: &Rig) -> Result<Rows, TraceFault> {
        match self.reading {
            Reading::Rows(open) => open(stream, rig),
            Reading::Refused(instead) => Err(TraceFault::Format(instead)),
        }
    }
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
