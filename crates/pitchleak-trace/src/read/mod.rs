//! Reading a trace as a stream: constant memory however long it is, and nothing lost in silence.

mod clock;
mod columns;
mod csv;
mod dialect;
mod error;
mod format;
mod inspect;
mod mat;
mod number;
mod own_clocks;
#[cfg(feature = "parquet")]
mod parquet;
mod proposal;
mod records;
mod row;
mod shapes;
mod table;
mod table_text;
mod validator;

pub use clock::seconds_between;
pub use csv::{LineLayout, LineRead, read as read_line};
pub use error::{BadReason, BadRow, Counted, TraceError, TraceFault, TraceQuality};
pub use inspect::{ColumnReading, FileReading, ProposedLine, TextReading};
pub use row::{BadRows, FlowChange, Record, ValveReading};
pub use table::{Batch, ColumnContent, TableLayout};
pub use validator::{OVERRANGE, RowValidator};

use crate::rig::{ColumnMap, Rig};
use crate::signal::Signal;
use crate::times::Clock;
use own_clocks::{Joined, OwnClocks};
use row::{Next, Row, RowSource, RowsAhead};
use std::fs::File;
use std::io::Read;
use std::path::Path;
use table::TableRows;

/// Reads a trace row by row: a file, a stream, or columns in memory.
pub struct TraceReader<'a> {
    name: String,
    rows: Box<dyn RowSource + Send + 'a>,
    row: Row,
    /// Other flows than were read.
    change: Option<FlowChange<'a>>,
    validator: RowValidator,
    done: bool,
    /// Stamp from which the seconds of columns in memory count.
    first_ns: Option<i64>,
}

impl TraceReader<'static> {
    /// Opens a trace file, CSV (also gzip), Parquet or MAT by its first bytes, or standard input where `path` is `-`, and
    /// reads its header. The rig gives foreign column names and the ranges that readings must lie in.
    ///
    /// # Errors
    /// Where the file cannot be read, is no trace, or its header lacks a signal, gives one twice or
    /// in an unknown unit.
    pub fn open(path: impl AsRef<Path>, rig: &Rig) -> Result<Self, TraceError> {
        Self::open_through(path, rig, |file| Box::new(file))
    }

    /// As [`open`](Self::open), with the file read through what `wrap` makes of it, e.g. a progress bar.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_through(
        path: impl AsRef<Path>,
        rig: &Rig,
        wrap: impl FnOnce(File) -> Box<dyn Read + Send>,
    ) -> Result<Self, TraceError> {
        let path = path.as_ref();
        if path == Path::new("-") {
            return Self::from_stream("standard input", Box::new(std::io::stdin()), rig);
        }
        let name = path.display().to_string();
        let file = File::open(path).map_err(|error| TraceFault::Open(error).of(&name))?;
        if path.is_dir() {
            return Err(TraceFault::Format(FOLDER).of(&name));
        }
        // Parquet is read from anywhere in the file: no progress is seen, but it is soon done.
        let again = file.try_clone().ok();
        Self::from_source(&name, wrap(file), again, rig)
    }

    /// As [`open`](Self::open), from any stream; `name` is for messages.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn from_stream(name: &str, stream: Box<dyn Read + Send>, rig: &Rig) -> Result<Self, TraceError> {
        Self::from_source(name, stream, None, rig)
    }

    /// Opens files of one recording, each with its time and some of the channels, whatever their rates. A column `value` is
    /// called as its file is.
    ///
    /// # Errors
    /// As [`open`](Self::open), of each file, and of all together.
    pub fn join(paths: &[impl AsRef<Path>], rig: &Rig) -> Result<Self, TraceError> {
        let names: Vec<String> = paths.iter().map(|path| path.as_ref().display().to_string()).collect();
        Ok(Self::over(&names.join(" + "), Box::new(Joined::open(paths, rig)?), rig))
    }

    fn from_source(
        name: &str,
        stream: Box<dyn Read + Send>,
        file: Option<File>,
        rig: &Rig,
    ) -> Result<Self, TraceError> {
        let rows = format::open(stream, file, rig).map_err(|fault| fault.of(name))?;
        Ok(Self::over(name, rows, rig))
    }

    /// Reads a long trace in a thread of its own, a little ahead of the records that are taken, where there is a second core.
    /// Records, their order and errors are the same, memory stays constant.
    #[must_use]
    pub fn ahead(self) -> Self {
        if std::thread::available_parallelism().is_ok_and(|cores| cores.get() > 1) {
            Self { rows: Box::new(RowsAhead::of(self.rows)), ..self }
        } else {
            self
        }
    }
}

const FOLDER: &str = "a folder, not a trace: name the files in it, e.g. by `*.csv`";

impl<'a> TraceReader<'a> {
    /// Reads columns in memory without copying them: `layout` says what they hold, `batches` are their
    /// values, in SI or in the units that the headers name. A reading that is missing is NaN.
    ///
    /// # Errors
    /// Where the columns of a batch are not of one length.
    pub fn from_table(
        name: &str,
        layout: &TableLayout,
        batches: Vec<Batch<'a>>,
        rig: &Rig,
    ) -> Result<Self, TraceError> {
        let rows = TableRows::new(layout, batches).map_err(|fault| fault.of(name))?;
        Ok(Self::over(name, Box::new(rows), rig))
    }

    fn over(name: &str, rows: Box<dyn RowSource + Send + 'a>, rig: &Rig) -> Self {
        let rows = Box::new(OwnClocks::of(rows));
        let validator = RowValidator::new(rig, rows.layout());
        let (name, row) = (name.to_owned(), Row::empty());
        Self { name, rows, row, change: None, validator, done: false, first_ns: None }
    }

    /// Says from which time stamp the seconds of columns in memory count, ns since 1970.
    #[must_use]
    pub fn since(mut self, first_ns: Option<i64>) -> Self {
        self.first_ns = first_ns;
        self
    }

    /// Goes on where another part of the same trace ended; rows of columns in memory count on from there.
    #[must_use]
    pub fn resuming(mut self, before: RowValidator) -> Self {
        self.rows.count_from(before.rows_seen());
        self.validator = before;
        self
    }

    /// What has to be kept for the next part of the trace.
    pub fn into_validator(self) -> RowValidator {
        self.validator
    }

    /// The same trace with other flows; one that is missing has to stay so.
    #[must_use]
    pub fn with_flows(self, change: FlowChange<'a>) -> Self {
        Self { change: Some(change), ..self }
    }

    /// Says what becomes of bad rows.
    #[must_use]
    pub fn with_bad_rows(mut self, bad_rows: BadRows) -> Self {
        self.validator.set_bad_rows(bad_rows);
        self
    }

    /// Refuses a trace without one of the chamber pressures; `map` is the one it was read with.
    ///
    /// # Errors
    /// Where one is not measured.
    pub fn need_both_pressures(&self, map: &ColumnMap) -> Result<(), TraceError> {
        self.rows.layout().check_pressures(map).map_err(|fault| self.error(fault))
    }

    /// The trace as the user named it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The column of each signal, as a rig file's `[columns]` would name it; `map` is the one it was read with.
    pub fn columns(&self, map: &ColumnMap) -> ColumnMap {
        self.rows.layout().column_map(map)
    }

    /// Whether the trace has a column for `signal`.
    pub fn has(&self, signal: Signal) -> bool {
        self.rows.layout().has(signal)
    }

    /// The clock of its time stamps; none before the first row, and where it has no stamps.
    pub fn clock(&self) -> Option<Clock> {
        Clock::new(self.rows.epoch_ns().or(self.first_ns)?, &self.rows.layout().time)
    }

    /// What was noticed so far.
    pub fn quality(&self) -> &TraceQuality {
        self.validator.quality()
    }

    /// Reads the next good row into `record`; `false` at the end of the trace, and from then on.
    ///
    /// # Errors
    /// Where the trace has no good row at all, cannot be read on, or has a bad row and those are
    /// [fatal](BadRows::Fatal).
    // Once per sample: a call and its result through memory are a tenth of the sample's time.
    #[inline(always)]
    pub fn next_record(&mut self, record: &mut Record) -> Result<bool, TraceError> {
        self.next_record_or(record, |_| {})
    }

    /// As [`next_record`](Self::next_record); `refused` sees the rows on the way that are whole, but have a reading that is out
    /// of its sensor's range.
    ///
    /// # Errors
    /// As [`next_record`](Self::next_record).
    #[inline(always)]
    pub fn next_record_or(
        &mut self,
        record: &mut Record,
        mut refused: impl FnMut(&Record),
    ) -> Result<bool, TraceError> {
        while !self.done {
            let taken = match self.rows.next_row(&mut self.row).map_err(|fault| self.error(fault))? {
                Next::Row => {
                    if let Some(change) = &mut self.change {
                        self.row.change_flows(change);
                    }
                    self.validator.take(&self.row, self.rows.layout(), record)
                }
                Next::Bad(bad) => self.validator.skip(bad).map(|()| false),
                Next::CutOff(why) => {
                    self.done = true;
                    self.validator.cut_off(why).map(|()| false)
                }
                Next::End => {
                    self.done = true;
                    Ok(false)
                }
            };
            match taken {
                Ok(true) => return Ok(true),
                Ok(false) => self.validator.take_refused().iter().for_each(&mut refused),
                Err(fault) => {
                    self.done = true;
                    return Err(self.error(fault));
                }
            }
        }
        self.validator.end().map(|()| false).map_err(|fault| self.error(fault))
    }

    fn error(&self, fault: TraceFault) -> TraceError {
        fault.of(&self.name)
    }
}

#[cfg(test)]
mod tests;
