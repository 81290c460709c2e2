//! Rows of CSV as numbers in SI: of a stream, or one by one as text, such as the lines of a live feed.

use super::clock::Epoch;
use super::columns::{Content, Layout, REQUIRED};
use super::dialect::Dialect;
use super::error::{BadReason, BadRow, TraceFault};
use super::format::{Rows, Stream};
use super::number::plain_number;
use super::records::{self, Records, Stop, Text};
use super::row::{BadRows, Fault, NEEDED, Next, Record, Row, RowSource, check_time};
use super::table_text::TextTable;
use super::validator::{MOST_TIME_S, RowValidator, missing};
use crate::header::shorten;
use crate::rig::{ColumnMap, Decimal, Rig};
use crate::signal::Signal;
use crate::times::TimeKind;

pub(super) fn look(stream: Stream, rig: &Rig) -> Result<TextTable, TraceFault> {
    Dialect::first_lines(stream, rig).map(|(_, _, table)| table)
}

/// Reads all before the first row.
pub(super) fn open(stream: Stream, rig: &Rig) -> Result<Rows, TraceFault> {
    let gzip = stream.gzip;
    let (mut records, encoding, table) = Dialect::first_lines(stream, rig)?;
    let dialect = Dialect::of(table, encoding, rig)?;
    let Dialect { delimiter, decimal, layout, last_header_line } = dialect;
    let (delimiter, epoch) = (delimiter.byte(), Epoch::new(layout.time.clone()));
    records.skip_header(delimiter, last_header_line)?;
    let splitting = Splitting { delimiter, decimal, layout, epoch, last_cells: [0; 2] };
    Ok(Box::new(CsvRows { records, splitting, gzip }))
}

struct CsvRows {
    records: Records,
    splitting: Splitting,
    gzip: bool,
}

/// How a record is split, and into what.
struct Splitting {
    delimiter: u8,
    decimal: Decimal,
    layout: Layout,
    epoch: Epoch,
    /// Lengths of the last cells of the row read last and of the one before.
    last_cells: [usize; 2],
}

impl CsvRows {
    #[cold]
    fn stopped(&self, stop: Stop) -> Result<Next, TraceFault> {
        let line = self.records.next_line();
        match stop {
            Stop::End => Ok(Next::End),
            Stop::TooLong => Err(TraceFault::TooLong(line)),
            Stop::Failed(source) if self.gzip => {
                Ok(Next::CutOff(format!("the gzip stream breaks off in line {line} ({source})")))
            }
            Stop::Failed(source) => Err(TraceFault::Read { line: line - 1, source }),
        }
    }
}

impl RowSource for CsvRows {
    fn layout(&self) -> &Layout {
        &self.splitting.layout
    }

    fn epoch_ns(&self) -> Option<i64> {
        self.splitting.epoch.first_ns()
    }

    #[inline]
    fn next_row(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        match self.records.next() {
            Ok(record) => match self.splitting.read(&record, row) {
                Ok(()) if record.unended && self.splitting.may_be_cut() => Ok(Next::CutOff(format!(
                    "line {} is the last, has no line end and may be cut",
                    record.line
                ))),
                Ok(()) => Ok(Next::Row),
                Err(fault) => Ok(Next::Bad(self.splitting.describe(&record, &fault))),
            },
            Err(stop) => self.stopped(stop),
        }
    }
}

impl Splitting {
    /// Whether the row read last ends before its last cell may have been whole: in fewer characters than the one before.
    fn may_be_cut(&self) -> bool {
        let [last, before] = self.last_cells;
        last < before
    }

    #[inline]
    fn read(&mut self, record: &records::Record<'_>, row: &mut Row) -> Result<(), Fault> {
        *row = Row { line: record.line, ..Row::empty() };
        match record.text {
            Text::Plain(text, end) => {
                let (delimiter, decimal) = (self.delimiter, self.decimal);
                let cells =
                    Plain { text, end, delimiter, decimal, at: 0, length: 0, places: 0, ended: false };
                read_cells(&self.layout, &mut self.epoch, &mut self.last_cells, cells, row)
            }
            Text::Unquoted(..) => {
                let cells = record.cells(self.delimiter);
                let cells = Split { cells: &cells, decimal: self.decimal, at: 0 };
                read_cells(&self.layout, &mut self.epoch, &mut self.last_cells, cells, row)
            }
        }
    }

    #[cold]
    fn describe(&self, record: &records::Record<'_>, fault: &Fault) -> BadRow {
        describe(&self.layout, record.line, &record.cells(self.delimiter), fault)
    }
}

/// Reads the cells of a row as their columns say; `last_cells` are the lengths of the last cells of rows.
#[inline(always)]
fn read_cells<'a>(
    layout: &Layout,
    epoch: &mut Epoch,
    last_cells: &mut [usize; 2],
    mut cells: impl Cells<'a>,
    row: &mut Row,
) -> Result<(), Fault> {
    for (index, column) in layout.columns.iter().enumerate() {
        if cells.ended() {
            return Err(Fault { column: None, reason: BadReason::ShortRow });
        }
        let read = match &column.content {
            Some(Content { signal: Signal::Timestamp, .. }) => {
                epoch.seconds(cells.cell()).map(|seconds| row.set(Signal::Time, seconds))
            }
            Some(Content { signal, unit }) => {
                cells.number().map(|value| row.set(*signal, unit.map_or(value, |unit| unit.to_si(value))))
            }
            None => {
                cells.cell();
                Ok(())
            }
        };
        read.map_err(|reason| Fault { column: Some(index), reason })?;
    }
    *last_cells = [cells.length(), last_cells[0]];
    if cells.ended() {
        check_time(&layout.columns, row)
    } else {
        Err(Fault { column: None, reason: BadReason::LongRow })
    }
}

/// Words for a bad row of these cells.
#[cold]
pub(super) fn describe(layout: &Layout, line: u64, cells: &[&[u8]], fault: &Fault) -> BadRow {
    let columns = &layout.columns;
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
                _ if reason == BadReason::NotATime => {
                    format!("`{}` is {}", shorten(cell, 40), expected_time(&layout.time.kind))
                }
                _ => format!("`{}` is {}", shorten(cell, 40), reason.text()),
            }
        }
    };
    layout.bad_row(line, fault.column.and_then(|index| columns.get(index)), fault.reason, detail)
}

fn expected_time(kind: &TimeKind) -> String {
    match kind {
        TimeKind::Iso => "not a time in ISO 8601".to_owned(),
        kind => format!("not a time in the format `{kind}`"),
    }
}

/// The cells of one record, one after the other.
pub(super) trait Cells<'a> {
    /// Whether the last one has been read.
    fn ended(&self) -> bool;

    /// Passes over a cell and gives its text.
    fn cell(&mut self) -> &'a [u8];

    /// Bytes of the cell read last, without blanks around it.
    fn length(&self) -> usize;

    /// Reads a cell as a number; NaN where it is empty.
    fn number(&mut self) -> Result<f64, BadReason>;
}

/// A record without quotes.
struct Plain<'a> {
    /// It, and what stands behind it.
    text: &'a [u8],
    /// Where it ends: with `text`, or at a line end.
    end: usize,
    delimiter: u8,
    decimal: Decimal,
    at: usize,
    /// Bytes of the cell before, and its decimals.
    length: usize,
    places: usize,
    ended: bool,
}

impl<'a> Plain<'a> {
    #[inline(always)]
    fn rest(&self) -> &'a [u8] {
        self.text.get(self.at..self.end).unwrap_or_default()
    }

    /// Passes over a cell where it is so long.
    #[inline(always)]
    fn passes(&mut self, length: usize) -> bool {
        let end = self.at + length;
        let ended = end == self.end;
        let is_cell = ended || self.text.get(end) == Some(&self.delimiter);
        if is_cell {
            (self.at, self.length, self.ended) = (end + 1, length, ended);
        }
        is_cell
    }
}

impl<'a> Cells<'a> for Plain<'a> {
    #[inline(always)]
    fn ended(&self) -> bool {
        self.ended
    }

    #[inline]
    fn cell(&mut self) -> &'a [u8] {
        let rest = self.rest();
        let end = memchr::memchr(self.delimiter, rest);
        self.ended = end.is_none();
        let cell = end.map_or(rest, |end| rest.get(..end).unwrap_or_default());
        self.length = cell.trim_ascii().len();
        self.at += cell.len() + 1;
        cell
    }

    #[inline(always)]
    fn length(&self) -> usize {
        self.length
    }

    /// Most cells are a number and no more: its end is the cell's.
    #[inline(always)]
    fn number(&mut self) -> Result<f64, BadReason> {
        if self.decimal == Decimal::Comma {
            return read_number(self.cell(), Decimal::Comma);
        }
        // No number goes on behind a line end.
        let text = self.text.get(self.at..).unwrap_or_default();
        if let Some((value, length)) = plain_number(text, &mut self.places)
            && self.passes(length)
        {
            return Ok(value);
        }
        if let Ok((value, length)) = fast_float2::parse_partial::<f64, _>(self.rest())
            && value.is_finite()
            && self.passes(length)
        {
            return Ok(value);
        }
        read_number(self.cell(), Decimal::Point)
    }
}

/// Cells that were split before: of a record whose quotes were taken off, or of a line of a feed.
struct Split<'a> {
    pub(super) cells: &'a [&'a [u8]],
    pub(super) decimal: Decimal,
    pub(super) at: usize,
}

impl<'a> Cells<'a> for Split<'a> {
    fn ended(&self) -> bool {
        self.at >= self.cells.len()
    }

    fn cell(&mut self) -> &'a [u8] {
        let cell = self.cells.get(self.at).copied().unwrap_or_default();
        self.at += 1;
        cell
    }

    fn length(&self) -> usize {
        self.at.checked_sub(1).and_then(|at| self.cells.get(at)).map_or(0, |cell| cell.trim_ascii().len())
    }

    fn number(&mut self) -> Result<f64, BadReason> {
        read_number(self.cell(), self.decimal)
    }
}

/// A cell with whatever blanks around its number; NaN where it is empty.
#[cold]
fn read_number(cell: &[u8], decimal: Decimal) -> Result<f64, BadReason> {
    let mut cell = cell.trim_ascii();
    if cell.is_empty() {
        return Ok(f64::NAN);
    }
    let mut with_point = [0; LONGEST_NUMBER];
    if decimal == Decimal::Comma {
        cell = pointed(cell, &mut with_point).ok_or(BadReason::NotANumber)?;
    }
    let value = fast_float2::parse::<f64, _>(cell).ok().filter(|value| value.is_finite());
    value.ok_or(BadReason::NotANumber)
}

/// No number has more digits, bytes.
const LONGEST_NUMBER: usize = 64;

/// The cell with a point for its comma; none where it has a point already, which would stand between thousands.
fn pointed<'a>(cell: &[u8], into: &'a mut [u8; LONGEST_NUMBER]) -> Option<&'a [u8]> {
    let into = into.get_mut(..cell.len())?;
    for (to, from) in into.iter_mut().zip(cell) {
        *to = match from {
            b'.' => return None,
            b',' => b'.',
            other => *other,
        };
    }
    Some(into)
}

/// What the cells of a line hold, by their names, which are those of a trace's columns.
#[derive(Clone, Debug)]
pub struct LineLayout(Layout);

impl LineLayout {
    /// The layout of cells of these names.
    ///
    /// # Errors
    /// As for the header row of a trace.
    pub fn new(names: &[String], rig: &Rig) -> Result<Self, TraceFault> {
        let layout = Layout::new(names, &rig.columns, &REQUIRED, rig)?;
        let time = rig.csv.time.clone().unwrap_or(layout.time);
        Ok(Self(Layout { time, ..layout }))
    }

    /// Time of a line, s since `epoch_ns` (its first own stamp where there is none yet); or why it has none.
    pub fn time_s(&self, epoch_ns: Option<i64>, cells: &[&[u8]]) -> Result<f64, BadReason> {
        let times = self.0.columns.iter().enumerate().find(|(_, column)| column.is_time());
        let (at, column) = times.ok_or(BadReason::Missing)?;
        let mut cells = Split { cells, decimal: Decimal::Point, at };
        let unit = column.content.and_then(|content| content.unit);
        let time_s = match column.is_timestamp() {
            true => Epoch::since(epoch_ns, self.0.time.clone()).seconds(cells.cell())?,
            false => cells.number().map(|time| unit.map_or(time, |unit| unit.to_si(time)))?,
        };
        match time_s {
            _ if time_s.is_nan() => Err(BadReason::Missing),
            _ if time_s.abs() > MOST_TIME_S => Err(BadReason::OutOfRange),
            _ => Ok(time_s),
        }
    }

    /// The column of each signal, as a rig file's `[columns]` would name it; `map` is the one it was made with.
    pub fn columns(&self, map: &ColumnMap) -> ColumnMap {
        self.0.column_map(map)
    }

    /// A validator for lines like these.
    pub fn validator(&self, rig: &Rig, bad_rows: BadRows) -> RowValidator {
        let mut validator = RowValidator::new(rig, &self.0);
        validator.set_bad_rows(bad_rows);
        validator
    }
}

/// What was read of a line.
pub enum LineRead {
    /// It is `record`.
    Good,
    /// With the row as it was read, where a sensor's reading in it is out of range.
    Bad(BadRow, Option<Box<Record>>),
}

/// Reads the cells of a line into `record`; a bad row is an error only where those are fatal.
///
/// # Errors
/// A bad row where those are fatal.
pub fn read(
    layout: &LineLayout,
    line: u64,
    cells: &[&[u8]],
    epoch_ns: &mut Option<i64>,
    validator: &mut RowValidator,
    record: &mut Record,
) -> Result<LineRead, TraceFault> {
    let LineLayout(layout) = layout;
    let mut row = Row { line, ..Row::empty() };
    let mut epoch = Epoch::since(*epoch_ns, layout.time.clone());
    let read = read_cells(
        layout,
        &mut epoch,
        &mut [0, 0],
        Split { cells, decimal: Decimal::Point, at: 0 },
        &mut row,
    );
    *epoch_ns = epoch.first_ns();
    row.stand_in(validator.unread());
    let bad = match read {
        Ok(()) => match NEEDED.into_iter().find(|signal| row.get(*signal).is_nan()) {
            None => validator.check(&row, layout, record),
            Some(signal) => Some(missing(&row, layout, signal)),
        },
        Err(fault) => Some(describe(layout, line, cells, &fault)),
    };
    let Some(bad) = bad else { return Ok(LineRead::Good) };
    validator.skip(bad.clone())?;
    Ok(LineRead::Bad(bad, validator.take_refused().map(Box::new)))
}
