//! What a file format is: the bytes by which it is told, and how its rows are read.

use super::error::TraceFault;
use super::row::RowSource;
use crate::rig::Rig;
use std::io::Read;

/// One format, registered in `file.rs`.
pub(super) struct Format {
    /// First bytes of every such file, four at most.
    pub(super) starts_with: &'static [u8],
    pub(super) open: fn(Stream, &Rig) -> Result<Rows, TraceFault>,
}

pub(super) type Rows = Box<dyn RowSource + Send>;

/// A trace's bytes, decompressed.
pub(super) struct Stream {
    /// The first bytes once more.
    pub(super) start: Vec<u8>,
    pub(super) bytes: Box<dyn Read + Send>,
    /// Whether they come out of gzip, which may break off.
    pub(super) gzip: bool,
}
