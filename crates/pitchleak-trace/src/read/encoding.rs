//! The encoding of a text file: what is not UTF-8 is made so.

use std::borrow::Cow;
use std::io::{self, Read};

/// How characters are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Or a superset that only headers show: see [`text`].
    Utf8,
    Utf16 {
        big_endian: bool,
    },
}

impl Encoding {
    /// Of a file that begins with these bytes: by its byte order mark, or by every other byte being zero.
    pub(super) fn of(start: &[u8]) -> Self {
        let ascii = |byte: u8| (b' '..0x7f).contains(&byte);
        match *start {
            [0xff, 0xfe, ..] => Self::Utf16 { big_endian: false },
            [0xfe, 0xff, ..] => Self::Utf16 { big_endian: true },
            [a, 0, b, 0] if ascii(a) && ascii(b) => Self::Utf16 { big_endian: false },
            [0, a, 0, b] if ascii(a) && ascii(b) => Self::Utf16 { big_endian: true },
            _ => Self::Utf8,
        }
    }

    /// The bytes in UTF-8.
    pub(super) fn decode(self, bytes: Box<dyn Read + Send>) -> Box<dyn Read + Send> {
        match self {
            Self::Utf8 => bytes,
            Self::Utf16 { big_endian } => Box::new(Utf16 {
                source: bytes,
                big_endian,
                odd: None,
                high: None,
                text: Vec::new(),
                given: 0,
            }),
        }
    }
}

/// The text of a header; what is no UTF-8 is Latin-1, of which UTF-8 knows every character.
pub(super) fn text(cell: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(cell) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => cell.iter().map(|byte| char::from(*byte)).collect(),
    }
}

struct Utf16 {
    source: Box<dyn Read + Send>,
    big_endian: bool,
    /// First byte of a unit that is not whole yet.
    odd: Option<u8>,
    /// First unit of a pair that is not whole yet.
    high: Option<u16>,
    text: Vec<u8>,
    /// How much of `text` was given on.
    given: usize,
}

impl Utf16 {
    /// Reads on until there is text; `false` at the end.
    fn refill(&mut self) -> io::Result<bool> {
        let mut chunk = [0; 16 * 1024];
        self.text.clear();
        self.given = 0;
        while self.text.is_empty() {
            let read = self.source.read(&mut chunk)?;
            if read == 0 {
                return Ok(false);
            }
            for byte in chunk.iter().take(read) {
                match self.odd.take() {
                    None => self.odd = Some(*byte),
                    Some(first) => self.push(first, *byte),
                }
            }
        }
        Ok(true)
    }

    fn push(&mut self, first: u8, second: u8) {
        let bytes = [first, second];
        let unit = if self.big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) };
        if self.high.is_none() && (0xd800..0xdc00).contains(&unit) {
            self.high = Some(unit);
            return;
        }
        for c in char::decode_utf16(self.high.take().into_iter().chain([unit])) {
            let c = c.unwrap_or(char::REPLACEMENT_CHARACTER);
            self.text.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes());
        }
    }
}

impl Read for Utf16 {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.given == self.text.len() && !self.refill()? {
            return Ok(0);
        }
        let mut rest = self.text.get(self.given..).unwrap_or_default();
        let count = rest.read(into)?;
        self.given += count;
        Ok(count)
    }
}
