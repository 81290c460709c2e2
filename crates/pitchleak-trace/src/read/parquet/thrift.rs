//! The compact protocol of Thrift, in which Parquet writes its footer and the heads of its pages:
//! <https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md>.
//!
//! Nothing is held and every value takes a byte at least, so that whatever a head says costs no more than its length.

use parquet::errors::{ParquetError, Result};

/// Kinds of values.
const TRUE: u8 = 1;
const FALSE: u8 = 2;
const BYTE: u8 = 3;
const INT16: u8 = 4;
const INT32: u8 = 5;
const INT64: u8 = 6;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const SET: u8 = 10;
const MAP: u8 = 11;
const STRUCT: u8 = 12;
const UUID: u8 = 13;

/// Deeper than any that Parquet has.
const DEEPEST: u32 = 32;
/// The fields of a structure that are kept have smaller numbers.
const FIELDS: usize = 16;

/// A value that is there as a whole.
#[derive(Clone, Copy)]
pub(super) struct Value<'a> {
    kind: u8,
    bytes: &'a [u8],
}

/// The fields of a structure by their numbers.
#[derive(Default)]
pub(super) struct Fields<'a>([Option<Value<'a>>; FIELDS]);

/// The structure that `bytes` begin with, and its length.
pub(super) fn structure(bytes: &[u8]) -> Result<(Fields<'_>, usize)> {
    let mut front = Front(bytes);
    let fields = front.fields(DEEPEST)?;
    Ok((fields, bytes.len() - front.0.len()))
}

impl<'a> Value<'a> {
    pub(super) fn whole(self) -> Result<i64> {
        match self.kind {
            BYTE => Ok(Front(self.bytes).byte()?.cast_signed().into()),
            INT16 | INT32 | INT64 => Front(self.bytes).whole(),
            _ => Err(damaged("a whole number")),
        }
    }

    pub(super) fn is_true(self) -> bool {
        self.kind == TRUE
    }

    pub(super) fn bytes(self) -> Result<&'a [u8]> {
        if self.kind == BINARY { Front(self.bytes).binary() } else { Err(damaged("a text")) }
    }

    pub(super) fn fields(self) -> Result<Fields<'a>> {
        if self.kind == STRUCT { Front(self.bytes).fields(DEEPEST) } else { Err(damaged("a structure")) }
    }

    /// What is in a list.
    pub(super) fn items(self) -> Result<impl Iterator<Item = Result<Value<'a>>>> {
        if self.kind != LIST {
            return Err(damaged("a list"));
        }
        let mut front = Front(self.bytes);
        let (kind, size) = front.list()?;
        Ok((0..size).map(move |_| front.value(kind, DEEPEST)))
    }
}

impl<'a> Fields<'a> {
    pub(super) fn get(&self, id: usize) -> Option<Value<'a>> {
        self.0.get(id).copied().flatten()
    }

    pub(super) fn needed(&self, id: usize) -> Result<Value<'a>> {
        self.get(id).ok_or_else(|| damaged("a field that must be there"))
    }

    /// A whole number, where it is there.
    pub(super) fn whole(&self, id: usize) -> Result<Option<i64>> {
        self.get(id).map(Value::whole).transpose()
    }

    /// The numbers of the fields that are there.
    pub(super) fn ids(&self) -> impl Iterator<Item = usize> {
        self.0.iter().enumerate().filter(|(_, value)| value.is_some()).map(|(id, _)| id)
    }
}

/// What is still to be read.
pub(super) struct Front<'a>(pub(super) &'a [u8]);

impl<'a> Front<'a> {
    pub(super) fn take(&mut self, count: u64) -> Result<&'a [u8]> {
        let split = usize::try_from(count).ok().and_then(|count| self.0.split_at_checked(count));
        let (taken, rest) = split.ok_or_else(|| ParquetError::EOF("a head breaks off".to_owned()))?;
        self.0 = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8> {
        Ok(self.take(1)?.first().copied().unwrap_or_default())
    }

    /// Seven bits a byte, the lowest first.
    pub(super) fn varint(&mut self) -> Result<u64> {
        let mut number = 0;
        for place in 0..10 {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << (7 * place);
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(damaged("a number of 64 bits"))
    }

    /// Zigzag: 0, −1, 1, −2 …
    pub(super) fn whole(&mut self) -> Result<i64> {
        let number = self.varint()?;
        Ok((number >> 1).cast_signed() ^ -(number & 1).cast_signed())
    }

    fn binary(&mut self) -> Result<&'a [u8]> {
        let length = self.varint()?;
        self.take(length)
    }

    /// Kind and count of a list's values.
    fn list(&mut self) -> Result<(u8, u64)> {
        let byte = self.byte()?;
        let size = if byte >> 4 == 15 { self.varint()? } else { u64::from(byte >> 4) };
        Ok((byte & 15, size))
    }

    /// A value outside a structure, where what is true or false takes a byte.
    fn value(&mut self, kind: u8, depth: u32) -> Result<Value<'a>> {
        let from = self.0;
        self.pass(kind, depth)?;
        let (bytes, _) = from.split_at_checked(from.len() - self.0.len()).unwrap_or_default();
        Ok(Value { kind, bytes })
    }

    fn pass(&mut self, kind: u8, depth: u32) -> Result<()> {
        let Some(deeper) = depth.checked_sub(1) else { return Err(damaged("less deep")) };
        match kind {
            TRUE | FALSE | BYTE => self.take(1).map(drop),
            INT16 | INT32 | INT64 => self.varint().map(drop),
            DOUBLE => self.take(8).map(drop),
            BINARY => self.binary().map(drop),
            UUID => self.take(16).map(drop),
            STRUCT => self.fields(deeper).map(drop),
            LIST | SET => {
                let (kind, size) = self.list()?;
                (0..size).try_for_each(|_| self.pass(kind, deeper))
            }
            MAP => {
                let size = self.varint()?;
                let kinds = if size == 0 { 0 } else { self.byte()? };
                (0..size).try_for_each(|_| {
                    self.pass(kinds >> 4, deeper)?;
                    self.pass(kinds & 15, deeper)
                })
            }
            _ => Err(damaged("of a known kind")),
        }
    }

    fn fields(&mut self, depth: u32) -> Result<Fields<'a>> {
        let (mut fields, mut id) = (Fields::default(), 0_i64);
        loop {
            let byte = self.byte()?;
            if byte == 0 {
                return Ok(fields);
            }
            id = match byte >> 4 {
                0 => self.whole()?,
                step => id.saturating_add(step.into()),
            };
            let value = match byte & 15 {
                // Said by the kind itself.
                kind @ (TRUE | FALSE) => Value { kind, bytes: &[] },
                kind => self.value(kind, depth)?,
            };
            if let Some(place) = usize::try_from(id).ok().and_then(|id| fields.0.get_mut(id)) {
                *place = Some(value);
            }
        }
    }
}

fn damaged(wanted: &str) -> ParquetError {
    ParquetError::General(format!("what should be {wanted} is not"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Written by hand: field 1 = −3, field 2 = true, field 4 = "ab", field 5 = [1, 2], field 20 = 1.
    const BYTES: [u8; 17] =
        [0x15, 5, 0x11, 0x28, 2, b'a', b'b', 0x19, 0x25, 2, 4, 0x05, 40, 2, 0, 0xff, 0xff];

    #[test]
    fn fields_are_what_was_written() {
        let (fields, length) = structure(&BYTES).unwrap();
        assert_eq!(length, 15);
        assert_eq!(fields.ids().collect::<Vec<_>>(), [1, 2, 4, 5]);
        assert_eq!(fields.whole(1).unwrap(), Some(-3));
        assert!(fields.get(2).unwrap().is_true());
        assert_eq!(fields.get(4).unwrap().bytes().unwrap(), b"ab");
        let items = fields.get(5).unwrap().items().unwrap().map(|item| item.unwrap().whole().unwrap());
        assert_eq!(items.collect::<Vec<_>>(), [1, 2]);
        assert!(fields.needed(3).is_err());
    }

    /// Each says that more is there than follows: it ends at once, and not by running out of memory or stack.
    #[test]
    fn what_a_head_says_costs_no_more_than_its_length() {
        let most = [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f];
        for start in [&[0x19, 0xf2][..], &[0x19, 0xfc], &[0x1b], &[0x18], &[0x19, 0xf5]] {
            let bytes = [start, &most, &[0x22, 0, 0, 0]].concat();
            assert!(structure(&bytes).is_err(), "{start:?}");
        }
        assert!(structure(&[0x1c; 1_000_000]).is_err());
        assert!(structure(&[0x19; 1_000_000]).is_err());
    }
}
