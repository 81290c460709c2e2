use super::clock::{Clock, Step};
use super::columns::Layout;
use super::error::TraceFault;
use super::quality::{BadReason, BadRow, TraceQuality};
use super::range::Ranges;
use super::row::Row;
use super::{BadRows, Record};
use crate::header::shorten;
use crate::rig::Rig;
use crate::signal::Signal;
use crate::units::readable;
use pitchleak_core::{PerLeak, Sample};

/// From rows to records: what is possible, what time it is, and what was noticed so far. It does not
/// know where the rows come from, so that a trace may come in parts.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub struct RowValidator {
    ranges: Ranges,
    clock: Clock,
    bad_rows: BadRows,
    quality: TraceQuality,
    /// The last row, if it was refused as out of range.
    #[serde(skip)]
    refused: Option<Record>,
}

impl RowValidator {
    pub(super) fn new(rig: &Rig, layout: &Layout) -> Self {
        let quality = TraceQuality {
            ignored_columns: layout.ignored(),
            absent_columns: layout.absent.clone(),
            reading: layout.reading.clone(),
            ..TraceQuality::default()
        };
        Self {
            ranges: Ranges::of(rig),
            clock: Clock::default(),
            bad_rows: BadRows::Skip,
            quality,
            refused: None,
        }
    }

    /// Whether it holds rows against what `rig` may read.
    pub fn is_for(&self, rig: &Rig) -> bool {
        self.ranges == Ranges::of(rig)
    }

    /// What was noticed so far.
    pub fn quality(&self) -> &TraceQuality {
        &self.quality
    }

    /// The last row as it was read, where a sensor's reading in it was out of range; once.
    #[cold]
    pub(super) fn take_refused(&mut self) -> Option<Record> {
        self.refused.take()
    }

    /// Time of the last good row, s.
    pub fn time_s(&self) -> Option<f64> {
        self.clock.last_s()
    }

    pub(super) fn set_bad_rows(&mut self, bad_rows: BadRows) {
        self.bad_rows = bad_rows;
    }

    /// Rows taken or skipped.
    pub(super) fn rows_seen(&self) -> u64 {
        self.quality.rows + self.quality.skipped
    }

    /// Whether `row` is good; then it is in `record`.
    #[inline]
    pub(super) fn take(
        &mut self,
        row: &Row,
        layout: &Layout,
        record: &mut Record,
    ) -> Result<bool, TraceFault> {
        match self.check(row, layout, record) {
            None => Ok(true),
            Some(bad) => self.skip(bad).map(|()| false),
        }
    }

    /// As [`take`](Self::take); a bad row is told, and neither counted nor skipped yet.
    #[inline]
    pub(super) fn check(&mut self, row: &Row, layout: &Layout, record: &mut Record) -> Option<BadRow> {
        if let Some(signal) = self.ranges.broken_by(row) {
            self.refused = signal.is_sensor().then(|| readings(row));
            let detail = self.ranges.describe(signal, row.get(signal), layout.unit_of(signal));
            return Some(bad_cell(row, layout, signal, BadReason::OutOfRange, detail));
        }
        let t_s = row.get(Signal::Time);
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
                let detail = format!("{} s is not after {} s", readable(t_s, 12), readable(last_s, 12));
                return Some(bad_cell(row, layout, Signal::Time, BadReason::TimeBack, detail));
            }
        };
        *record = Record { dt_s, after_gap, ..readings(row) };
        self.quality.count_row(record);
        None
    }

    #[cold]
    pub(super) fn skip(&mut self, bad: BadRow) -> Result<(), TraceFault> {
        if self.bad_rows == BadRows::Fatal {
            return Err(TraceFault::BadRow(bad));
        }
        self.quality.count_bad(bad);
        Ok(())
    }

    #[cold]
    pub(super) fn cut_off(&mut self, why: String) -> Result<(), TraceFault> {
        if self.bad_rows == BadRows::Fatal {
            return Err(TraceFault::CutOff(why));
        }
        self.quality.cut_off = Some(why);
        Ok(())
    }

    /// The end of a trace, which must have had a good row.
    pub(super) fn end(&self) -> Result<(), TraceFault> {
        if self.quality.rows > 0 {
            return Ok(());
        }
        if let Some(why) = self.quality.cut_off.as_ref().filter(|_| self.quality.skipped == 0) {
            return Err(TraceFault::CutOff(why.clone()));
        }
        let first = self.quality.first_bad.first().cloned();
        Err(TraceFault::NoRows { skipped: self.quality.skipped, first, mistake: None })
    }
}

#[inline]
fn readings(row: &Row) -> Record {
    let reading = |signal| Some(row.get(signal)).filter(|value| !value.is_nan());
    Record {
        line: row.line,
        t_s: row.get(Signal::Time),
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
        ..Record::default()
    }
}

#[cold]
fn bad_cell(row: &Row, layout: &Layout, signal: Signal, reason: BadReason, detail: String) -> BadRow {
    let header = layout.header_of(signal).or_else(|| layout.header_of(Signal::Timestamp));
    let column = header.map(|header| shorten(header, 40));
    BadRow { line: row.line, counted: layout.counted, column, reason, detail }
}
