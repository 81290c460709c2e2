//! Records of a text stream out of one buffer of bounded size, whatever its encoding.

use super::error::TraceFault;
use csv_core::{ReadRecordResult, ReaderBuilder, Terminator};
use std::borrow::Cow;
use std::io::{self, Read};

const CHUNK: usize = 256 * 1024;
/// A record longer than this is no row of numbers.
const LONGEST_RECORD: usize = 1024 * 1024;
/// How far a quoted cell may run over line ends before its quote counts as stray.
const LONGEST_QUOTED: usize = 64 * 1024;

/// One record.
#[derive(Clone, Copy)]
pub(super) struct Record<'a> {
    /// The line it starts on, from 1.
    pub(super) line: u64,
    pub(super) text: Text<'a>,
    /// The stream ends before the line does.
    pub(super) unended: bool,
}

#[derive(Clone, Copy)]
pub(super) enum Text<'a> {
    /// As in the file, to be split at each delimiter: it, with what stands behind it, and its length.
    Plain(&'a [u8], usize),
    /// Cells without their quotes, one after the other, and where each ends.
    Unquoted(&'a [u8], &'a [usize]),
}

impl<'a> Record<'a> {
    pub(super) fn cells(&self, delimiter: u8) -> Vec<&'a [u8]> {
        match self.text {
            Text::Plain(text, length) => {
                text.get(..length).unwrap_or_default().split(|byte| *byte == delimiter).collect()
            }
            Text::Unquoted(text, ends) => {
                let starts = std::iter::once(&0).chain(ends);
                starts.zip(ends).map(|(start, end)| text.get(*start..*end).unwrap_or_default()).collect()
            }
        }
    }
}

/// Why no further record comes.
#[derive(Debug)]
pub(super) enum Stop {
    /// The stream is over.
    End,
    /// The stream fails; what came before is good, a partial last record is not.
    Failed(io::Error),
    /// A record without end.
    TooLong,
}

/// Before the first row.
pub(super) fn stopped_early(stop: Stop) -> TraceFault {
    match stop {
        Stop::End => TraceFault::Empty,
        Stop::TooLong => TraceFault::TooLong(1),
        Stop::Failed(source) => TraceFault::Read { line: 0, source },
    }
}

pub(super) struct Records {
    source: Box<dyn Read + Send>,
    buffer: Vec<u8>,
    start: usize,
    filled: usize,
    /// Lines ended so far.
    ended: u64,
    finished: Option<Option<io::Error>>,
    delimiter: u8,
    /// Made for the first quote: most files have none.
    unquoter: Option<Unquoter>,
}

impl Records {
    pub(super) fn new(source: Box<dyn Read + Send>) -> Self {
        Self {
            source,
            buffer: vec![0; CHUNK],
            start: 0,
            filled: 0,
            ended: 0,
            finished: None,
            delimiter: b',',
            unquoter: None,
        }
    }

    /// Passes over all that stands before the first row; from there on, cells are split at `delimiter`.
    pub(super) fn skip_header(&mut self, delimiter: u8, last_line: u64) -> Result<(), TraceFault> {
        self.split_at(delimiter);
        while self.next_line() <= last_line {
            self.next().map_err(stopped_early)?;
        }
        Ok(())
    }

    /// Splits at `delimiter` from here on.
    pub(super) fn split_at(&mut self, delimiter: u8) {
        (self.delimiter, self.unquoter) = (delimiter, None);
    }

    /// The line that the next record starts on, from 1.
    pub(super) fn next_line(&self) -> u64 {
        self.ended + 1
    }

    /// The next record; empty lines are passed over.
    #[inline]
    pub(super) fn next(&mut self) -> Result<Record<'_>, Stop> {
        let found = self.find()?;
        let line = self.next_line();
        let start = self.start;
        self.start += found.length;
        self.ended += found.lines;
        Ok(self.record(line, start, &found))
    }

    /// What is still to be read, so many bytes of it at the least, or all: then the second is `true`.
    pub(super) fn look_ahead(&mut self, bytes: usize) -> Result<(&[u8], bool), Stop> {
        while self.filled - self.start < bytes && self.finished.is_none() {
            self.refill()?;
        }
        let pending = self.buffer.get(self.start..self.filled).unwrap_or_default();
        Ok((pending, self.finished.is_some()))
    }

    #[inline]
    fn record(&self, line: u64, start: usize, found: &Found) -> Record<'_> {
        let text = match (found.cells, &self.unquoter) {
            (Some(cells), Some(unquoter)) => {
                Text::Unquoted(&unquoter.cells, unquoter.ends.get(..cells).unwrap_or_default())
            }
            _ => Text::Plain(self.buffer.get(start..self.filled).unwrap_or_default(), found.text),
        };
        let unended = self.finished.is_some() && self.buffer.get(start + found.length - 1) != Some(&b'\n');
        Record { line, text, unended }
    }

    #[inline]
    fn find(&mut self) -> Result<Found, Stop> {
        loop {
            let found = self.find_any()?;
            if found.text > 0 {
                return Ok(found);
            }
            self.start += found.length;
            self.ended += found.lines;
        }
    }

    #[inline]
    fn find_any(&mut self) -> Result<Found, Stop> {
        loop {
            let pending = self.buffer.get(self.start..self.filled).unwrap_or_default();
            let at_end = self.finished.is_some();
            match memchr::memchr2(b'\n', b'"', pending) {
                Some(at) if pending.get(at) == Some(&b'\n') => return Ok(Found::line(pending, at)),
                Some(_) => {
                    let within = pending.get(..LONGEST_QUOTED).unwrap_or(pending);
                    let unquoter = self.unquoter.get_or_insert_with(|| Unquoter::new(self.delimiter));
                    if let Some(found) = unquoter.read(within, at_end && within.len() == pending.len()) {
                        return Ok(found);
                    }
                    // A quote that does not close within reach is stray: its record ends with its line.
                    let out_of_reach = at_end || pending.len() > LONGEST_QUOTED;
                    if let Some(at) = memchr::memchr(b'\n', pending).filter(|_| out_of_reach) {
                        return Ok(Found::line(pending, at));
                    }
                }
                None => {}
            }
            if at_end {
                return self.last_line();
            }
            self.refill()?;
        }
    }

    /// What is left at the end of the stream, without a line end.
    #[cold]
    fn last_line(&mut self) -> Result<Found, Stop> {
        let rest = self.buffer.get(self.start..self.filled).unwrap_or_default();
        match self.finished.as_mut().and_then(Option::take) {
            Some(error) => Err(Stop::Failed(error)),
            None if rest.is_empty() => Err(Stop::End),
            None => Ok(Found { length: rest.len(), ..Found::line(rest, rest.len()) }),
        }
    }

    #[cold]
    fn refill(&mut self) -> Result<(), Stop> {
        self.buffer.copy_within(self.start..self.filled, 0);
        self.filled -= self.start;
        self.start = 0;
        if self.filled >= LONGEST_RECORD {
            return Err(Stop::TooLong);
        }
        if self.filled == self.buffer.len() {
            self.buffer.resize(2 * self.filled, 0);
        }
        let free = self.buffer.get_mut(self.filled..).unwrap_or_default();
        match self.source.read(free) {
            Ok(0) => self.finished = Some(None),
            Ok(count) => self.filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => self.finished = Some(Some(error)),
        }
        Ok(())
    }
}

/// A record at the start of the pending bytes.
struct Found {
    /// With its line end.
    length: usize,
    /// Its text as it stands, without the line end.
    text: usize,
    lines: u64,
    /// How many cells were unquoted, where there are quotes.
    cells: Option<usize>,
}

impl Found {
    /// The line whose end is at `at`.
    #[inline]
    fn line(pending: &[u8], at: usize) -> Self {
        let carriage_return = at > 0 && pending.get(at - 1) == Some(&b'\r');
        Self { length: at + 1, text: at - usize::from(carriage_return), lines: 1, cells: None }
    }
}

/// Splits records with quotes (RFC 4180). Those without, all but a few, are split as their numbers are
/// read: the automaton takes as long for a row as all else that is done to it.
struct Unquoter {
    automaton: csv_core::Reader,
    cells: Vec<u8>,
    ends: Vec<usize>,
}

impl Unquoter {
    fn new(delimiter: u8) -> Self {
        // A carriage return at the end of a line is trimmed with the blanks of its last cell.
        let automaton = ReaderBuilder::new().delimiter(delimiter).terminator(Terminator::Any(b'\n')).build();
        // Room for every record that is read, so that it is never full.
        Self { automaton, cells: vec![0; LONGEST_QUOTED + 1], ends: vec![0; LONGEST_QUOTED + 2] }
    }

    /// Reads the record that `pending` starts with; none where it does not end there.
    #[cold]
    fn read(&mut self, pending: &[u8], at_end: bool) -> Option<Found> {
        self.automaton.reset();
        let (mut result, length, text, mut cells) =
            self.automaton.read_record(pending, &mut self.cells, &mut self.ends);
        if at_end && matches!(result, ReadRecordResult::InputEmpty) {
            let (cells_left, ends_left) = (self.cells.get_mut(text..)?, self.ends.get_mut(cells..)?);
            let (last, _, _, more) = self.automaton.read_record(b"\n", cells_left, ends_left);
            (result, cells) = (last, cells + more);
        }
        let lines = self.automaton.line() - 1;
        let found = Found { length, text: length, lines, cells: Some(cells) };
        matches!(result, ReadRecordResult::Record).then_some(found)
    }
}

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
            Self::Utf16 { big_endian } => {
                let mut utf16 = Utf16 { source: bytes, big_endian, left: Vec::new() };
                Box::new(Written::by(move |text| utf16.decode(text)))
            }
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
    /// Bytes of a character that is not whole yet.
    left: Vec<u8>,
}

impl Utf16 {
    /// Decodes what is read next; `false` at the end.
    fn decode(&mut self, text: &mut Vec<u8>) -> io::Result<bool> {
        let mut chunk = [0; 16 * 1024];
        let read = match self.source.read(&mut chunk) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => return Ok(true),
            read => read?,
        };
        self.left.extend(chunk.get(..read).unwrap_or_default());
        let unit = if self.big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
        let mut units: Vec<u16> = self.left.as_chunks().0.iter().map(|bytes| unit(*bytes)).collect();
        // The first of a pair waits for the second.
        units.pop_if(|last| (0xd800..0xdc00).contains(last));
        for c in char::decode_utf16(units.iter().copied()) {
            let c = c.unwrap_or(char::REPLACEMENT_CHARACTER);
            text.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes());
        }
        self.left.drain(..2 * units.len());
        Ok(read > 0)
    }
}

/// Text that is written as it is read, piece by piece.
pub(super) struct Written<F> {
    /// Writes on; `false` at the end.
    more: F,
    text: Vec<u8>,
    given: usize,
    /// What comes behind it: the end, or why it is not read on.
    then: Option<io::Result<()>>,
}

impl<F: FnMut(&mut Vec<u8>) -> io::Result<bool>> Written<F> {
    pub(super) fn by(more: F) -> Self {
        Self { more, text: Vec::new(), given: 0, then: None }
    }
}

impl<F: FnMut(&mut Vec<u8>) -> io::Result<bool>> Read for Written<F> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.given == self.text.len() {
            self.text.clear();
            self.given = 0;
            while self.then.is_none() && self.text.len() < into.len() {
                self.then = (self.more)(&mut self.text).map(|more| (!more).then_some(())).transpose();
            }
            // What was written before is given before.
            if self.text.is_empty() && self.then.as_ref().is_some_and(Result::is_err) {
                self.then.replace(Ok(())).unwrap_or(Ok(()))?;
            }
        }
        let mut rest = self.text.get(self.given..).unwrap_or_default();
        let count = rest.read(into)?;
        self.given += count;
        Ok(count)
    }
}
