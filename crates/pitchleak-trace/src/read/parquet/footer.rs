//! The footer of a Parquet file: its columns, and where in the file their values lie. The crate `parquet` reads it by
//! recursion and believes its counts, so that a forged footer ends the process.
//! <https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift>

use super::leaf::{Leaf, Level};
use super::thrift::{Fields, Value, structure};
use parquet::errors::{ParquetError, Result};
use parquet::file::reader::ChunkReader;

/// What stands at the end: the footer's length, and the mark of the format.
const END: u64 = 8;
/// Footers that are longer, bytes, are refused.
const LONGEST: u64 = 64 << 20;

pub(super) struct Footer {
    pub(super) leaves: Vec<Leaf>,
    /// Of each group of rows, the chunks of all leaves.
    pub(super) groups: Vec<Vec<Chunk>>,
}

/// The pages of one column in one group of rows.
#[derive(Clone, Copy)]
pub(super) struct Chunk {
    pub(super) codec: i64,
    pub(super) start: u64,
    pub(super) length: u64,
}

impl Footer {
    pub(super) fn of(file: &impl ChunkReader) -> Result<Self> {
        let before_end = file.len().checked_sub(END).ok_or_else(|| damaged("too short"))?;
        let end = file.get_bytes(before_end, END as usize)?;
        let length = match end.split_first_chunk::<4>() {
            Some((length, b"PAR1")) => u64::from(u32::from_le_bytes(*length)),
            Some((_, b"PARE")) => return Err(damaged("encrypted")),
            _ => return Err(damaged("Parquet without a footer: cut short?")),
        };
        let start = before_end.checked_sub(length).filter(|_| length <= LONGEST);
        let start = start.ok_or_else(|| damaged("a footer longer than the file, or than 64 MB"))?;
        let bytes = file.get_bytes(start, length as usize)?;
        let (metadata, _) = structure(&bytes)?;
        let leaves = leaves(metadata.needed(2)?)?;
        let mut groups = Vec::new();
        for group in metadata.needed(4)?.items()? {
            let chunks = group?.fields()?.needed(1)?.items()?;
            let chunks = chunks.map(|chunk| Chunk::of(&chunk?.fields()?, file.len()));
            let chunks = chunks.collect::<Result<Vec<_>>>()?;
            if chunks.len() != leaves.len() {
                return Err(damaged("a group of rows has other columns than the file"));
            }
            groups.push(chunks);
        }
        Ok(Self { leaves, groups })
    }
}

impl Chunk {
    fn of(chunk: &Fields<'_>, file_length: u64) -> Result<Self> {
        let metadata = chunk.get(3).ok_or_else(|| damaged("a column is encrypted"))?.fields()?;
        let needed = |id| metadata.needed(id).and_then(Value::whole);
        // The dictionary stands before the pages that need it.
        let start = match metadata.whole(11)? {
            Some(start) => start,
            None => needed(9)?,
        };
        let (start, length) = (u64::try_from(start)?, u64::try_from(needed(7)?)?);
        if start.checked_add(length).is_none_or(|end| end > file_length) {
            return Err(damaged("a column lies beyond the file"));
        }
        Ok(Self { codec: needed(4)?, start, length })
    }
}

/// The columns out of the tree of the schema, which is written depth first.
fn leaves(schema: Value<'_>) -> Result<Vec<Leaf>> {
    let mut leaves = Vec::new();
    // Groups that are open: how many of their children are still to come, and what is above those.
    let mut open: Vec<(i64, Level)> = Vec::new();
    for (place, element) in schema.items()?.enumerate() {
        let element = element?.fields()?;
        let children = element.whole(5)?.unwrap_or(0);
        while open.last().is_some_and(|(left, _)| *left == 0) {
            open.pop();
        }
        let above = match open.last_mut() {
            Some((left, level)) => {
                *left -= 1;
                level.below(&element)?
            }
            None if place == 0 => Level::default(),
            None => return Err(damaged("a column outside the table")),
        };
        match children {
            0 if place == 0 => {}
            0 if element.get(1).is_some() => leaves.push(Leaf::of(&element, above)?),
            0 => {}
            1.. => open.push((children, above)),
            _ => return Err(damaged("a number of columns below zero")),
        }
    }
    if open.iter().any(|(left, _)| *left != 0) {
        return Err(damaged("fewer columns than it says"));
    }
    Ok(leaves)
}

/// What the file says of itself can't be.
pub(super) fn damaged(what: &str) -> ParquetError {
    ParquetError::General(what.to_owned())
}
