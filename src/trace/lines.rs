//! Records of a CSV stream out of one buffer of bounded size.

use super::number::LOOK_AHEAD;
use std::io::{self, Read};

const CHUNK: usize = 256 * 1024;
/// A record longer than this is no row of numbers.
const LONGEST_RECORD: usize = 1024 * 1024;
/// How far a quoted cell may run over line ends before its quote counts as stray.
const LONGEST_QUOTED: usize = 64 * 1024;

/// One record.
#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    /// The line it starts on, from 1.
    pub(super) number: u64,
    /// Its text without the line end.
    pub(super) text: &'a [u8],
    /// Its text and [`LOOK_AHEAD`] bytes more, the first of which is a line end or a zero.
    pub(super) padded: &'a [u8],
    /// Whether it has quotes.
    pub(super) quoted: bool,
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

pub(super) struct Lines {
    source: Box<dyn Read + Send>,
    buffer: Vec<u8>,
    start: usize,
    filled: usize,
    /// Lines ended so far.
    ended: u64,
    finished: Option<Option<io::Error>>,
}

impl Lines {
    pub(super) fn new(source: Box<dyn Read + Send>) -> Self {
        Self { source, buffer: vec![0; CHUNK + LOOK_AHEAD], start: 0, filled: 0, ended: 0, finished: None }
    }

    /// The line that the next record starts on, from 1.
    pub(super) fn next_number(&self) -> u64 {
        self.ended + 1
    }

    /// The next record; empty lines are passed over.
    #[inline]
    pub(super) fn next(&mut self) -> Result<Line<'_>, Stop> {
        loop {
            let number = self.next_number();
            let found = self.find_record()?;
            let (start, end) = (self.start, self.start + found.length);
            self.start = end + found.line_end;
            self.ended += found.lines;
            let carriage_return = end > start && self.buffer.get(end - 1) == Some(&b'\r');
            let end = end - usize::from(carriage_return);
            if end > start {
                let text = self.buffer.get(start..end).unwrap_or_default();
                let padded = self.buffer.get(start..end + LOOK_AHEAD).unwrap_or_default();
                return Ok(Line { number, text, padded, quoted: found.quoted });
            }
        }
    }

    #[inline]
    fn find_record(&mut self) -> Result<Found, Stop> {
        loop {
            let pending = self.buffer.get(self.start..self.filled).unwrap_or_default();
            match memchr::memchr2(b'\n', b'"', pending) {
                Some(at) if pending.get(at) == Some(&b'\n') => return Ok(Found::plain(at)),
                Some(_) => {
                    if let Some(found) = find_quoted(pending, self.finished.is_some()) {
                        return Ok(found);
                    }
                }
                None => {}
            }
            if self.finished.is_some() {
                return self.last_record();
            }
            self.refill()?;
        }
    }

    /// What is left at the end of the stream, without a line end.
    fn last_record(&mut self) -> Result<Found, Stop> {
        let rest = self.buffer.get(self.start..self.filled).unwrap_or_default();
        match self.finished.as_mut().and_then(Option::take) {
            Some(error) => Err(Stop::Failed(error)),
            None if rest.is_empty() => Err(Stop::End),
            None => {
                let (lines, quoted) = (1 + count_lines(rest), rest.contains(&b'"'));
                Ok(Found { length: rest.len(), line_end: 0, lines, quoted })
            }
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
        if self.filled + LOOK_AHEAD == self.buffer.len() {
            self.buffer.resize(2 * self.filled + LOOK_AHEAD, 0);
        }
        let end = self.buffer.len() - LOOK_AHEAD;
        let free = self.buffer.get_mut(self.filled..end).unwrap_or_default();
        match self.source.read(free) {
            Ok(0) => self.finished = Some(None),
            Ok(count) => self.filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => self.finished = Some(Some(error)),
        }
        if let Some(after) = self.buffer.get_mut(self.filled) {
            *after = 0;
        }
        Ok(())
    }
}

struct Found {
    length: usize,
    line_end: usize,
    lines: u64,
    quoted: bool,
}

impl Found {
    fn plain(length: usize) -> Self {
        Self { length, line_end: 1, lines: 1, quoted: false }
    }
}

fn count_lines(text: &[u8]) -> u64 {
    memchr::memchr_iter(b'\n', text).count() as u64
}

/// The end of a record with quotes; none while it takes more input to tell. A quote that does not
/// close within reach is stray: its record then ends with its line, as if unquoted.
fn find_quoted(pending: &[u8], at_end: bool) -> Option<Found> {
    let mut inside = false;
    let mut cell_start = true;
    for (at, &byte) in pending.iter().take(LONGEST_QUOTED).enumerate() {
        match byte {
            b'"' if inside || cell_start => inside = !inside,
            b'\n' if !inside => {
                let lines = 1 + count_lines(pending.get(..at).unwrap_or_default());
                return Some(Found { length: at, line_end: 1, lines, quoted: true });
            }
            _ => {}
        }
        // A doubled quote leaves and enters again.
        cell_start = matches!(byte, b',' | b';' | b'\t') || (byte == b'"' && !inside);
    }
    if !inside || (!at_end && pending.len() < LONGEST_QUOTED) {
        return None;
    }
    let length = memchr::memchr(b'\n', pending)?;
    Some(Found { quoted: true, ..Found::plain(length) })
}
