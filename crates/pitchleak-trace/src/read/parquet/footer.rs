//! The footer of a Parquet file: its columns, and where in the file their values lie. The crate `parquet` reads it by
//! recursion and believes its counts, so that a forged footer ends the process.
//! <https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift>

use super::pages::ReadAt;
use super::thrift::{Fields, Value, structure};
use parquet::basic::{Repetition, Type as Physical};
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::{ColumnDescPtr, ColumnDescriptor, ColumnPath, Type};
use std::sync::Arc;

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
    pub(super) fn of(bytes: &ReadAt, file_length: u64) -> Result<Self> {
        let before_end = file_length.checked_sub(END).ok_or_else(|| damaged("too short"))?;
        let end = bytes(before_end, END as usize)?;
        let length = match end.split_first_chunk::<4>() {
            Some((length, b"PAR1")) => u64::from(u32::from_le_bytes(*length)),
            Some((_, b"PARE")) => return Err(damaged("encrypted")),
            _ => return Err(damaged("Parquet without a footer: cut short?")),
        };
        let start = before_end.checked_sub(length).filter(|_| length <= LONGEST);
        let start = start.ok_or_else(|| damaged("a footer longer than the file, or than 64 MB"))?;
        let bytes = bytes(start, length as usize)?;
        let (metadata, _) = structure(&bytes)?;
        let leaves = leaves(metadata.needed(2)?)?;
        let mut groups = Vec::new();
        for group in metadata.needed(4)?.items()? {
            let chunks = group?.fields()?.needed(1)?.items()?;
            let chunks = chunks.map(|chunk| Chunk::of(&chunk?.fields()?, file_length));
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
            0 if element.get(1).is_some() => leaves.push(Leaf::of(leaves.len(), &element, above)?),
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

/// What the cells of a column are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Number,
    /// Whole numbers, so many decimals of each.
    Decimal(u32),
    /// Times, so many nanoseconds each.
    Stamp(i64),
    /// Times in 96 bits, which the format gave up.
    Int96,
    Text,
    Other,
}

/// How many cells a row may have, by this column and the groups around it.
#[derive(Clone, Copy, Default)]
pub(super) struct Level {
    /// So many of them may be missing.
    optional: u32,
    repeated: bool,
}

pub(super) struct Leaf {
    /// Its place among the chunks of a group.
    pub(super) place: usize,
    pub(super) name: String,
    pub(super) kind: Kind,
    level: Level,
    physical: Physical,
    /// Bytes of a cell of fixed length.
    length: i32,
}

impl Level {
    /// That of a member.
    pub(super) fn below(self, element: &Fields<'_>) -> Result<Self> {
        let (optional, repeated) = match element.whole(3)? {
            Some(0) | None => (0, false),
            Some(1) => (1, false),
            _ => (1, true),
        };
        Ok(Self { optional: self.optional.saturating_add(optional), repeated: self.repeated || repeated })
    }
}

/// The types by their numbers.
const PHYSICAL: [Physical; 8] = {
    use Physical::*;
    [BOOLEAN, INT32, INT64, INT96, FLOAT, DOUBLE, BYTE_ARRAY, FIXED_LEN_BYTE_ARRAY]
};

impl Leaf {
    fn of(place: usize, element: &Fields<'_>, level: Level) -> Result<Self> {
        let number = element.whole(1)?.and_then(|number| usize::try_from(number).ok());
        let physical = number.and_then(|number| PHYSICAL.get(number).copied());
        let physical = physical.ok_or_else(|| damaged("a column of an unknown type"))?;
        Ok(Self {
            place,
            name: String::from_utf8_lossy(element.needed(4)?.bytes()?).into_owned(),
            kind: kind(physical, element)?,
            level,
            physical,
            length: i32::try_from(element.whole(2)?.unwrap_or(0))?,
        })
    }

    /// One cell a row at most.
    pub(super) fn is_flat(&self) -> bool {
        !self.level.repeated && self.level.optional <= 1
    }

    /// Whether cells may be missing.
    pub(super) fn is_optional(&self) -> bool {
        self.level.optional > 0
    }

    /// As the crate's readers want it; of a flat column.
    pub(super) fn descriptor(&self) -> Result<ColumnDescPtr> {
        let repetition = if self.is_optional() { Repetition::OPTIONAL } else { Repetition::REQUIRED };
        let builder = Type::primitive_type_builder(&self.name, self.physical);
        let leaf = builder.with_repetition(repetition).with_length(self.length).build()?;
        let path = ColumnPath::from(self.name.as_str());
        Ok(Arc::new(ColumnDescriptor::new(Arc::new(leaf), i16::from(self.is_optional()), 0, path)))
    }
}

/// Types as they were said in the format's first version.
mod converted {
    pub(super) const UTF8: i64 = 0;
    pub(super) const DECIMAL: i64 = 5;
    pub(super) const TIMESTAMP_MILLIS: i64 = 9;
    pub(super) const TIMESTAMP_MICROS: i64 = 10;
}

/// Types as they are said today.
mod logical {
    pub(super) const STRING: usize = 1;
    pub(super) const DECIMAL: usize = 5;
    pub(super) const TIMESTAMP: usize = 8;
    pub(super) const INTEGER: usize = 10;
}

/// Of 64 bits.
const MOST_DECIMALS: u32 = 18;

fn kind(physical: Physical, element: &Fields<'_>) -> Result<Kind> {
    let logical = element.get(10).map(|logical| logical.fields()).transpose()?;
    let converted = element.whole(6)?;
    let stamp_ns = match (logical.as_ref().map(|logical| logical.ids().next().unwrap_or_default()), converted)
    {
        (Some(logical::TIMESTAMP), _) => {
            let stamp = logical.unwrap_or_default().needed(logical::TIMESTAMP)?.fields()?;
            match stamp.needed(2)?.fields()?.ids().next() {
                Some(1) => Some(1_000_000),
                Some(2) => Some(1_000),
                _ => Some(1),
            }
        }
        (_, Some(converted::TIMESTAMP_MILLIS)) => Some(1_000_000),
        (_, Some(converted::TIMESTAMP_MICROS)) => Some(1_000),
        (Some(logical::DECIMAL), _) | (_, Some(converted::DECIMAL)) => {
            let decimals = u32::try_from(element.whole(7)?.unwrap_or(0))?;
            let is_whole = matches!(physical, Physical::INT32 | Physical::INT64);
            return Ok(if is_whole && decimals <= MOST_DECIMALS {
                Kind::Decimal(decimals)
            } else {
                Kind::Other
            });
        }
        (Some(logical::INTEGER) | None, _) => None,
        (Some(logical::STRING), _) if physical == Physical::BYTE_ARRAY => return Ok(Kind::Text),
        _ => return Ok(Kind::Other),
    };
    Ok(match (physical, stamp_ns) {
        (Physical::INT64, Some(ns)) => Kind::Stamp(ns),
        (Physical::INT96, _) => Kind::Int96,
        (Physical::INT32 | Physical::INT64 | Physical::FLOAT | Physical::DOUBLE, None) => Kind::Number,
        (Physical::BYTE_ARRAY, None) if converted == Some(converted::UTF8) => Kind::Text,
        _ => Kind::Other,
    })
}
