//! Rows of a CSV stream as numbers in SI.

use super::columns::{Column, Content, Layout, shorten};
use super::error::TraceFault;
use super::lines::{Line, Lines, Stop};
use super::number::{leading_number, short_number};
use super::quality::{BadReason, BadRow, Counted};
use super::stamp::Epoch;
use crate::rig::ColumnMap;
use crate::signal::Signal;
use std::borrow::Cow;
use std::io::{self, Read};

/// One row in SI, by signal; NaN where the cell is empty or the trace has no such column.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) line: u64,
    pub(super) cells: [f64; Signal::ALL.len()],
}

impl Row {
    pub(super) fn empty() -> Self {
        Self { line: 0, cells: [f64::NAN; Signal::ALL.len()] }
    }

    #[inline(always)]
    pub(super) fn get(&self, signal: Signal) -> f64 {
        self.cells.get(signal as usize).copied().unwrap_or(f64::NAN)
    }

    #[inline(always)]
    pub(super) fn set(&mut self, signal: Signal, value: f64) {
        if let Some(cell) = self.cells.get_mut(signal as usize) {
            *cell = value;
        }
    }
}

/// What the next record is.
pub(super) enum Next {
    Row,
    Bad(BadRow),
    /// The stream fails here; every row before is good.
    CutOff(String),
    End,
}

/// What is wrong with a record, before words are put to it.
pub(super) struct Fault {
    pub(super) column: Option<usize>,
    pub(super) reason: BadReason,
}

pub(super) struct CsvRows {
    lines: Lines,
    format: Format,
    compressed: bool,
}

/// How a record is split, and into what.
struct Format {
    delimiter: u8,
    layout: Layout,
    epoch: Epoch,
}

impl CsvRows {
    pub(super) fn open(
        source: Box<dyn Read + Send>,
        compressed: bool,
        map: &ColumnMap,
    ) -> Result<Self, TraceFault> {
        let mut lines = Lines::new(source);
        let (delimiter, headers) = read_header(&mut lines)?;
        let layout = Layout::new(&headers, map)?;
        Ok(Self { lines, format: Format { delimiter, layout, epoch: Epoch::default() }, compressed })
    }

    pub(super) fn layout(&self) -> &Layout {
        &self.format.layout
    }

    /// Reads the next record into `row`.
    #[inline]
    pub(super) fn next(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        match self.lines.next() {
            Ok(line) => match self.format.read(line, row) {
                Ok(()) => Ok(Next::Row),
                Err(fault) => Ok(Next::Bad(self.format.describe(line, &fault))),
            },
            Err(stop) => self.stopped(stop),
        }
    }

    #[cold]
    fn stopped(&self, stop: Stop) -> Result<Next, TraceFault> {
        let line = self.lines.next_number();
        match stop {
            Stop::End => Ok(Next::End),
            Stop::TooLong => Err(TraceFault::TooLong(line)),
            Stop::Failed(source) if self.compressed => {
                Ok(Next::CutOff(format!("the gzip stream breaks off in line {line} ({source})")))
            }
            Stop::Failed(source) => Err(TraceFault::Read { line: line - 1, source }),
        }
    }
}

fn read_header(lines: &mut Lines) -> Result<(u8, Vec<String>), TraceFault> {
    let line = match lines.next() {
        Ok(line) => line,
        Err(Stop::End) => return Err(TraceFault::Empty),
        Err(Stop::TooLong) => return Err(TraceFault::TooLong(1)),
        Err(Stop::Failed(source)) => return Err(TraceFault::Read { line: 0, source }),
    };
    let text = line.text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line.text);
    if text.starts_with(b"\xff\xfe") || text.starts_with(b"\xfe\xff") {
        return Err(TraceFault::Format("text in UTF-16: save it as UTF-8"));
    }
    if text.contains(&0) {
        return Err(TraceFault::Format("not a CSV file: the header row is binary"));
    }
    let delimiter = sniff(text);
    let headers = Cells::new(text, delimiter).map(|cell| String::from_utf8_lossy(&cell).into_owned());
    Ok((delimiter, headers.collect()))
}

/// The delimiter that splits the header most often: a comma, else a semicolon or a tab.
fn sniff(header: &[u8]) -> u8 {
    let cells = |delimiter: &u8| Cells::new(header, *delimiter).count();
    let by_comma = cells(&b',');
    let other = [b';', b'\t'].into_iter().max_by_key(cells);
    other.filter(|delimiter| by_comma < cells(delimiter)).unwrap_or(b',')
}

impl Format {
    #[inline]
    fn read(&mut self, line: Line<'_>, row: &mut Row) -> Result<(), Fault> {
        *row = Row { line: line.number, ..Row::empty() };
        if line.quoted { self.read_quoted(line.text, row) } else { self.read_plain(line, row) }
    }

    /// A record without quotes, in one pass.
    #[inline]
    fn read_plain(&mut self, line: Line<'_>, row: &mut Row) -> Result<(), Fault> {
        let mut rest = Rest { line, at: 0, ended: false };
        for (index, column) in self.layout.columns.iter().enumerate() {
            if rest.ended {
                return Err(Fault { column: None, reason: BadReason::ShortRow });
            }
            let read = match &column.content {
                Content::Number(signal, unit) => rest
                    .number(self.delimiter)
                    .map(|value| row.set(*signal, unit.map_or(value, |unit| unit.to_si(value)))),
                Content::Ignored => {
                    rest.cell(self.delimiter);
                    Ok(())
                }
                Content::Timestamp => self
                    .epoch
                    .seconds(rest.cell(self.delimiter))
                    .map(|seconds| row.set(Signal::Time, seconds)),
            };
            read.map_err(|reason| Fault { column: Some(index), reason })?;
        }
        if rest.ended {
            check_present(&self.layout.columns, row)
        } else {
            Err(Fault { column: None, reason: BadReason::LongRow })
        }
    }

    #[cold]
    fn read_quoted(&mut self, text: &[u8], row: &mut Row) -> Result<(), Fault> {
        let mut cells = Cells::new(text, self.delimiter);
        for (index, column) in self.layout.columns.iter().enumerate() {
            let cell = cells.next().ok_or(Fault { column: None, reason: BadReason::ShortRow })?;
            let read = match column.content {
                Content::Number(signal, unit) => read_cell(&cell)
                    .map(|value| row.set(signal, unit.map_or(value, |unit| unit.to_si(value)))),
                Content::Ignored => Ok(()),
                Content::Timestamp => self.epoch.seconds(&cell).map(|value| row.set(Signal::Time, value)),
            };
            read.map_err(|reason| Fault { column: Some(index), reason })?;
        }
        match cells.next() {
            None => check_present(&self.layout.columns, row),
            Some(_) => Err(Fault { column: None, reason: BadReason::LongRow }),
        }
    }

    #[cold]
    fn describe(&self, line: Line<'_>, fault: &Fault) -> BadRow {
        let cells: Vec<_> = Cells::new(line.text, self.delimiter).collect();
        let columns = &self.layout.columns;
        let detail = match fault.reason {
            BadReason::ShortRow | BadReason::LongRow => {
                format!("{} cells, {} expected", cells.len(), columns.len())
            }
            BadReason::Missing => "empty".to_owned(),
            reason => {
                let cell = fault.column.and_then(|index| cells.get(index));
                let cell = cell.map(|cell| String::from_utf8_lossy(cell)).unwrap_or_default();
                let cell = cell.trim();
                match cell.parse::<f64>() {
                    // Not quoted, so that no output of ours ever holds such a word.
                    Ok(value) if !value.is_finite() => "not a finite number".to_owned(),
                    _ => format!("`{}` is {}", shorten(cell, 40), reason.text()),
                }
            }
        };
        let column = fault.column.and_then(|index| columns.get(index));
        let column = column.map(|column| shorten(&column.header, 40));
        BadRow { line: line.number, counted: Counted::Lines, column, reason: fault.reason, detail }
    }
}

/// An empty cell is a missing value only where every row must have one.
#[inline]
pub(super) fn check_present(columns: &[Column], row: &Row) -> Result<(), Fault> {
    let time = row.get(Signal::Time);
    let needed = time + row.get(Signal::Position) + row.get(Signal::PressureA) + row.get(Signal::PressureB);
    if needed.is_finite() {
        return Ok(());
    }
    Err(blame(columns, row))
}

/// The cell that makes the sum of the needed ones no number.
#[cold]
fn blame(columns: &[Column], row: &Row) -> Fault {
    for (index, column) in columns.iter().enumerate() {
        let Some(signal) = column.content.signal().filter(|signal| signal.is_required()) else { continue };
        let signal = if signal == Signal::Timestamp { Signal::Time } else { signal };
        let value = row.get(signal);
        if !value.is_finite() {
            let reason = if value.is_nan() { BadReason::Missing } else { BadReason::OutOfRange };
            return Fault { column: Some(index), reason };
        }
    }
    Fault { column: None, reason: BadReason::OutOfRange }
}

/// What is left of a record without quotes.
struct Rest<'a> {
    line: Line<'a>,
    at: usize,
    /// The last cell has been read.
    ended: bool,
}

impl<'a> Rest<'a> {
    /// Reads a cell as a number; NaN where it is empty.
    #[inline(always)]
    fn number(&mut self, delimiter: u8) -> Result<f64, BadReason> {
        let text = self.line.padded.get(self.at..).unwrap_or_default();
        if let Some((value, length)) = short_number(text) {
            let end = self.at + length;
            self.ended = end == self.line.text.len();
            if self.ended || text.get(length) == Some(&delimiter) {
                self.at = end + 1;
                return Ok(value);
            }
        }
        read_cell(self.cell(delimiter))
    }

    /// Passes over a cell and gives its text.
    #[inline]
    fn cell(&mut self, delimiter: u8) -> &'a [u8] {
        let (cell, after) = split_cell(self.line.text.get(self.at..).unwrap_or_default(), delimiter);
        self.at += cell.len() + 1;
        self.ended = after.is_none();
        cell
    }
}

/// A cell with whatever blanks around its number; NaN where it is empty.
#[inline]
fn read_cell(cell: &[u8]) -> Result<f64, BadReason> {
    let cell = cell.trim_ascii();
    if cell.is_empty() {
        return Ok(f64::NAN);
    }
    match leading_number(cell) {
        Some((value, length)) if length == cell.len() && value.is_finite() => Ok(value),
        _ => Err(BadReason::NotANumber),
    }
}

#[inline]
fn split_cell(text: &[u8], delimiter: u8) -> (&[u8], Option<&[u8]>) {
    match memchr::memchr(delimiter, text) {
        Some(at) => (text.get(..at).unwrap_or_default(), text.get(at + 1..)),
        None => (text, None),
    }
}

/// The cells of one record, quotes taken off (RFC 4180).
struct Cells<'a> {
    rest: Option<&'a [u8]>,
    delimiter: u8,
}

impl<'a> Cells<'a> {
    fn new(text: &'a [u8], delimiter: u8) -> Self {
        Self { rest: Some(text), delimiter }
    }
}

impl<'a> Iterator for Cells<'a> {
    type Item = Cow<'a, [u8]>;

    fn next(&mut self) -> Option<Self::Item> {
        let text = self.rest?;
        if let Some((cell, after)) = text.strip_prefix(b"\"").and_then(unquote) {
            match after.split_first() {
                None => self.rest = None,
                Some((&next, rest)) if next == self.delimiter => self.rest = Some(rest),
                // Text after the closing quote: not a quoted cell.
                Some(_) => return self.next_plain(text),
            }
            return Some(cell);
        }
        self.next_plain(text)
    }
}

impl<'a> Cells<'a> {
    fn next_plain(&mut self, text: &'a [u8]) -> Option<Cow<'a, [u8]>> {
        let (cell, after) = split_cell(text, self.delimiter);
        self.rest = after;
        Some(Cow::Borrowed(cell))
    }
}

/// The text up to the closing quote, doubled quotes made single, and what follows; none where the
/// quote does not close.
fn unquote(text: &[u8]) -> Option<(Cow<'_, [u8]>, &[u8])> {
    let mut cell = Cow::Borrowed(&text[..0]);
    let mut rest = text;
    loop {
        let at = memchr::memchr(b'"', rest)?;
        let (head, after) = (rest.get(..at)?, rest.get(at + 1..)?);
        if cell.is_empty() {
            cell = Cow::Borrowed(head);
        } else {
            cell.to_mut().extend_from_slice(head);
        }
        match after.strip_prefix(b"\"") {
            None => return Some((cell, after)),
            Some(after) => {
                cell.to_mut().push(b'"');
                rest = after;
            }
        }
    }
}

/// Wraps a stream that may be compressed: told by its first bytes, not by its name.
pub(super) fn decompress(
    mut source: Box<dyn Read + Send>,
) -> Result<(Box<dyn Read + Send>, bool), TraceFault> {
    let mut magic = [0; 4];
    let mut length = 0;
    while let Some(free) = magic.get_mut(length..).filter(|free| !free.is_empty()) {
        match source.read(free) {
            Ok(0) => break,
            Ok(count) => length += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(source) => return Err(TraceFault::Read { line: 0, source }),
        }
    }
    let start = magic.get(..length).unwrap_or_default().to_vec();
    let (gzip, parquet) = (start.starts_with(b"\x1f\x8b"), start == b"PAR1");
    let whole = io::Cursor::new(start).chain(source);
    if gzip {
        let buffered = io::BufReader::with_capacity(64 * 1024, whole);
        return Ok((Box::new(flate2::bufread::MultiGzDecoder::new(buffered)), true));
    }
    if parquet {
        return Err(TraceFault::Format("Parquet cannot be read yet: export the trace as .csv or .csv.gz"));
    }
    Ok((Box::new(whole), false))
}
