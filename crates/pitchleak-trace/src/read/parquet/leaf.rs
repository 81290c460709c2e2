//! A column of a Parquet file: its name, and what its cells are.

use super::thrift::Fields;
use parquet::basic::{Repetition, Type as Physical};
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::{ColumnDescPtr, ColumnDescriptor, ColumnPath, Type};
use std::sync::Arc;

/// What the cells of a column are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Number,
    /// Times, so many nanoseconds each.
    Stamp(i64),
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

impl Leaf {
    pub(super) fn of(element: &Fields<'_>, level: Level) -> Result<Self> {
        let physical = match element.whole(1)? {
            Some(0) => Physical::BOOLEAN,
            Some(1) => Physical::INT32,
            Some(2) => Physical::INT64,
            Some(3) => Physical::INT96,
            Some(4) => Physical::FLOAT,
            Some(5) => Physical::DOUBLE,
            Some(6) => Physical::BYTE_ARRAY,
            Some(7) => Physical::FIXED_LEN_BYTE_ARRAY,
            _ => return Err(ParquetError::General("a column of an unknown type".to_owned())),
        };
        Ok(Self {
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
    pub(super) const TIMESTAMP: usize = 8;
    pub(super) const INTEGER: usize = 10;
}

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
        (Some(logical::INTEGER) | None, _) => None,
        (Some(logical::STRING), _) if physical == Physical::BYTE_ARRAY => return Ok(Kind::Text),
        _ => return Ok(Kind::Other),
    };
    Ok(match (physical, stamp_ns) {
        (Physical::INT64, Some(ns)) => Kind::Stamp(ns),
        (Physical::INT96, _) => Kind::Stamp(1),
        (Physical::INT32 | Physical::INT64 | Physical::FLOAT | Physical::DOUBLE, None)
            if converted != Some(converted::DECIMAL) =>
        {
            Kind::Number
        }
        (Physical::BYTE_ARRAY, None) if converted == Some(converted::UTF8) => Kind::Text,
        _ => Kind::Other,
    })
}
