//! Reading a trace as a stream: constant memory however long it is, and nothing lost in silence.

mod clock;
mod columns;
mod csv;
mod error;
mod lines;
mod number;
mod quality;
mod range;
mod stamp;

pub use error::{TraceError, TraceFault};
pub use quality::{BadReason, BadRow, TraceQuality};

use crate::rig::Rig;
use crate::signal::Signal;
use clock::{Clock, Step};
use csv::{CsvRows, Next, Row};
use pitchleak_core::{PerLeak, Sample};
use range::Ranges;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// One good row of a trace, in SI.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Record {
    /// Line of the file, from 1.
    pub line: u64,
    /// Time as in the file, s; since the first row where the file has time stamps.
    pub t_s: f64,
    /// Time since the record before, s: positive, and 0 for the first record.
    pub dt_s: f64,
    /// The trace pauses before this record, or its clock begins anew: nothing is known of the time
    /// between.
    pub after_gap: bool,
    /// The readings.
    pub sample: Sample<f64>,
    /// Piston speed, m/s.
    pub speed_mps: Option<f64>,
    /// Oil temperature, K.
    pub temperature_k: Option<f64>,
    /// Reference flows of the internal, external A and external B leak, m³/s.
    pub leak_m3s: PerLeak<Option<f64>>,
}

/// What becomes of a bad row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum BadRows {
    /// Counted, the first few kept with their place, and skipped.
    #[default]
    Skip,
    /// The end of the reading, as an error. So is a compressed stream that breaks off.
    Fatal,
}

/// Reads a trace row by row.
pub struct TraceReader {
    name: String,
    rows: CsvRows,
    row: Row,
    ranges: Ranges,
    clock: Clock,
    bad_rows: BadRows,
    quality: TraceQuality,
    done: bool,
}

impl TraceReader {
    /// Opens a trace file, `.csv` or `.csv.gz`, or standard input where `path` is `-`, and reads its
    /// header. The rig gives foreign column names and the ranges that readings must lie in.
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
        match File::open(path) {
            Ok(file) => Self::from_stream(&name, wrap(file), rig),
            Err(error) => Err(TraceError { trace: name, fault: TraceFault::Open(error) }),
        }
    }

    /// As [`open`](Self::open), from any stream; `name` is for messages.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn from_stream(name: &str, stream: Box<dyn Read + Send>, rig: &Rig) -> Result<Self, TraceError> {
        let rows = csv::decompress(stream)
            .and_then(|(stream, compressed)| CsvRows::open(stream, compressed, &rig.columns))
            .map_err(|fault| TraceError { trace: name.to_owned(), fault })?;
        let layout = rows.layout();
        let quality = TraceQuality {
            ignored_columns: layout.ignored(),
            absent_columns: layout.absent.clone(),
            ..TraceQuality::default()
        };
        Ok(Self {
            name: name.to_owned(),
            rows,
            row: Row::empty(),
            ranges: Ranges::of(rig),
            clock: Clock::default(),
            bad_rows: BadRows::Skip,
            quality,
            done: false,
        })
    }

    /// Says what becomes of bad rows.
    #[must_use]
    pub fn with_bad_rows(self, bad_rows: BadRows) -> Self {
        Self { bad_rows, ..self }
    }

    /// The trace as the user named it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether the trace has a column for `signal`.
    pub fn has(&self, signal: Signal) -> bool {
        self.rows.layout().has(signal)
    }

    /// What was noticed so far.
    pub fn quality(&self) -> &TraceQuality {
        &self.quality
    }

    /// Reads the next good row into `record`; `false` at the end of the trace, and from then on.
    ///
    /// # Errors
    /// Where the trace has no good row at all, cannot be read on, or has a bad row and those are
    /// [fatal](BadRows::Fatal).
    #[inline]
    pub fn next_record(&mut self, record: &mut Record) -> Result<bool, TraceError> {
        while !self.done {
            match self.rows.next(&mut self.row).map_err(|fault| self.error(fault))? {
                Next::Row => {
                    if self.take_row(record)? {
                        return Ok(true);
                    }
                }
                Next::Bad(bad) => self.skip(bad)?,
                Next::CutOff(why) => self.cut_off(why)?,
                Next::End => self.done = true,
            }
        }
        if self.quality.rows > 0 {
            return Ok(false);
        }
        if let Some(why) = &self.quality.cut_off {
            return Err(self.error(TraceFault::CutOff(why.clone())));
        }
        let first = self.quality.first_bad.first().cloned();
        Err(self.error(TraceFault::NoRows { skipped: self.quality.skipped, first }))
    }

    /// Whether the row just read is good; then it is in `record`.
    #[inline]
    fn take_row(&mut self, record: &mut Record) -> Result<bool, TraceError> {
        if let Some(signal) = self.ranges.broken_by(&self.row) {
            let bad = self.out_of_range(signal);
            self.skip(bad)?;
            return Ok(false);
        }
        let t_s = self.row.get(Signal::Time);
        let (dt_s, after_gap) = match self.clock.step(t_s) {
            Step::First => {
                self.quality.count_from(t_s);
                (0.0, false)
            }
            Step::Next { dt_s, regular, gap } => {
                self.quality.count_step(dt_s, regular, gap);
                (dt_s, gap)
            }
            Step::Restart { usual_s } => {
                self.quality.clock_restarts += 1;
                self.quality.count_from(t_s);
                (usual_s, true)
            }
            Step::Back { last_s } => {
                let bad = self.time_back(t_s, last_s);
                self.skip(bad)?;
                return Ok(false);
            }
        };
        self.fill(record, dt_s, after_gap);
        self.quality.count_row(record);
        Ok(true)
    }

    #[inline]
    fn fill(&self, record: &mut Record, dt_s: f64, after_gap: bool) {
        let row = &self.row;
        let reading = |signal| Some(row.get(signal)).filter(|value| !value.is_nan());
        *record = Record {
            line: row.line,
            t_s: row.get(Signal::Time),
            dt_s,
            after_gap,
            sample: Sample {
                x_m: row.get(Signal::Position),
                pa_pa: row.get(Signal::PressureA),
                pb_pa: row.get(Signal::PressureB),
                qa_m3s: reading(Signal::FlowA),
                qb_m3s: reading(Signal::FlowB),
                force_n: reading(Signal::Force),
            },
            speed_mps: reading(Signal::Speed),
            temperature_k: reading(Signal::Temperature),
            leak_m3s: PerLeak {
                internal: reading(Signal::LeakInternal),
                external_a: reading(Signal::LeakExternalA),
                external_b: reading(Signal::LeakExternalB),
            },
        };
    }

    #[cold]
    fn skip(&mut self, bad: BadRow) -> Result<(), TraceError> {
        if self.bad_rows == BadRows::Fatal {
            self.done = true;
            return Err(self.error(TraceFault::BadRow(bad)));
        }
        self.quality.count_bad(bad);
        Ok(())
    }

    #[cold]
    fn cut_off(&mut self, why: String) -> Result<(), TraceError> {
        self.done = true;
        if self.bad_rows == BadRows::Fatal {
            return Err(self.error(TraceFault::CutOff(why)));
        }
        self.quality.cut_off = Some(why);
        Ok(())
    }

    #[cold]
    fn out_of_range(&self, signal: Signal) -> BadRow {
        let detail = self.ranges.describe(signal, self.row.get(signal));
        self.bad_cell(signal, BadReason::OutOfRange, detail)
    }

    #[cold]
    fn time_back(&self, t_s: f64, last_s: f64) -> BadRow {
        let detail = format!("{t_s} s is not after {last_s} s");
        self.bad_cell(Signal::Time, BadReason::TimeBack, detail)
    }

    fn bad_cell(&self, signal: Signal, reason: BadReason, detail: String) -> BadRow {
        let layout = self.rows.layout();
        let header = layout.header_of(signal).or_else(|| layout.header_of(Signal::Timestamp));
        BadRow { line: self.row.line, column: header.map(|h| columns::shorten(h, 40)), reason, detail }
    }

    fn error(&self, fault: TraceFault) -> TraceError {
        TraceError { trace: self.name.clone(), fault }
    }
}

#[cfg(test)]
mod tests;
