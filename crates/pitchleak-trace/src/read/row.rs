//! Where rows come from: one trait, whatever the file's format, or columns in memory.
//!
//! Rows read by a thread of their own, a few batches ahead of who takes them: a text of numbers takes as long to read as its
//! samples to estimate from.

use super::columns::{Column, Layout};
use super::error::{BadReason, BadRow, TraceFault};
use super::format::Rows;
use crate::signal::Signal;
use pitchleak_core::{PerLeak, Sample};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};

/// A source of rows. A new one is an implementation of this trait; a file format is also one
/// line of registration in `format.rs`.
pub(super) trait RowSource {
    /// What the columns hold.
    fn layout(&self) -> &Layout;

    /// Reads the next row into `row`.
    fn next_row(&mut self, row: &mut Row) -> Result<Next, TraceFault>;

    /// The time stamp from which its seconds count, ns since 1970; none before the first row, and where it has no stamps.
    fn epoch_ns(&self) -> Option<i64> {
        None
    }

    /// This is the part of a trace after its first `rows` rows. Files, numbered by lines, are whole.
    fn count_from(&mut self, _rows: u64) {}
}

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

/// One good row of a trace, in SI.
#[derive(Clone, Copy, Debug, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Record {
    /// Line of the file, from 1; of columns in memory the row, from 0.
    pub line: u64,
    /// Time as in the file, s; since the first row where the file has time stamps.
    pub t_s: f64,
    /// Time since the record before, s: positive, and 0 for the first record.
    pub dt_s: f64,
    /// The trace pauses before this record, or its clock begins anew: nothing is known of the time
    /// between.
    pub after_gap: bool,
    /// The readings. A chamber pressure that is not measured is NaN: beside a valve one may be missing.
    pub sample: Sample<f64>,
    /// Piston speed, m/s.
    pub speed_mps: Option<f64>,
    /// Oil temperature, K.
    pub temperature_k: Option<f64>,
    /// What the valve between supply and cylinder shows; none where nothing of it was read.
    #[serde(default)]
    pub valve: Option<ValveReading>,
    /// Whether both ports are shut between valve and cylinder: then both flows are zero for certain.
    #[serde(default)]
    pub shut: Option<bool>,
    /// Reference flows of the internal, external A and external B leak, m³/s.
    pub leak_m3s: PerLeak<Option<f64>>,
}

/// What is read of the valve between supply and cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ValveReading {
    /// Position of the spool, a share of its full stroke, positive: supply to A; its command where the position is not measured.
    pub spool: f64,
    /// Supply pressure at the valve, Pa.
    pub supply_pa: Option<f64>,
    /// Tank pressure at the valve, Pa.
    pub tank_pa: Option<f64>,
}

impl Record {
    /// Whether a flow meter read anything.
    #[inline]
    pub fn has_flow(&self) -> bool {
        self.sample.qa_m3s.is_some() || self.sample.qb_m3s.is_some()
    }

    /// Whether both chamber pressures were read. Where one is not, the valve alone tells of leaks.
    #[inline]
    pub fn has_both_pressures(&self) -> bool {
        !(self.sample.pa_pa + self.sample.pb_pa).is_nan()
    }

    /// Time that this record's reading stands for, s: none after a gap, as the first record stands for none.
    #[inline]
    pub fn step_s(&self) -> f64 {
        if self.after_gap { 0.0 } else { self.dt_s }
    }
}

/// What becomes of a bad row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum BadRows {
    /// Counted, the first few kept with their place, and skipped.
    #[default]
    Skip,
    /// The end of the reading, as an error. So is a compressed stream that breaks off.
    Fatal,
}

/// What comes next.
pub(super) enum Next {
    Row,
    Bad(BadRow),
    /// The stream fails here; every row before is good.
    CutOff(String),
    End,
}

/// What is wrong with a row, before words are put to it.
pub(super) struct Fault {
    pub(super) column: Option<usize>,
    pub(super) reason: BadReason,
}

/// What every row must have beside its time.
pub(super) const NEEDED: [Signal; 3] = [Signal::Position, Signal::PressureA, Signal::PressureB];

impl Row {
    /// Whether it has all that a row must have.
    #[inline(always)]
    pub(super) fn has_needed(&self) -> bool {
        !NEEDED.into_iter().map(|signal| self.get(signal)).sum::<f64>().is_nan()
    }

    /// Makes a row whole that lacks a pressure which is not measured; its record has none.
    #[inline(always)]
    pub(super) fn stand_in(&mut self, unread: Option<Signal>) {
        if let Some(signal) = unread {
            self.set(signal, 0.0);
        }
    }

    /// Takes other flows: of the cylinder as it would be.
    #[cold]
    pub(super) fn change_flows(&mut self, change: &mut FlowChange<'_>) {
        let of = |a, b| [self.get(a), self.get(b)];
        let pressures_pa = of(Signal::PressureA, Signal::PressureB);
        let flows_m3s = of(Signal::FlowA, Signal::FlowB);
        // A flow that was not read stays so: no number is made of none.
        let [qa, qb] = change(self.get(Signal::Time), pressures_pa, flows_m3s);
        self.set(Signal::FlowA, qa);
        self.set(Signal::FlowB, qb);
    }

    /// Takes what it lacks from another row.
    pub(super) fn fill(&mut self, other: &Self) {
        for (cell, other) in self.cells.iter_mut().zip(other.cells) {
            if cell.is_nan() {
                *cell = other;
            }
        }
    }
}

/// Every row must have its time; what else is empty may come on a clock of its own.
#[inline]
pub(super) fn check_time(columns: &[Column], row: &Row) -> Result<(), Fault> {
    let time = row.get(Signal::Time);
    if time.is_finite() { Ok(()) } else { Err(blame(columns, time)) }
}

#[cold]
fn blame(columns: &[Column], time: f64) -> Fault {
    let reason = if time.is_nan() { BadReason::Missing } else { BadReason::OutOfRange };
    Fault { column: columns.iter().position(Column::is_time), reason }
}

/// Readings of flow, m³/s, from the time, s, the pressures, Pa, and the flows that were read, those of A first.
pub type FlowChange<'a> = Box<dyn FnMut(f64, [f64; 2], [f64; 2]) -> [f64; 2] + Send + 'a>;

/// Rows that pass between the threads at a time (chosen): 120 kB. A quarter of that switched threads five times as often.
const BATCH: usize = 1024;
/// Batches that wait at most (chosen).
const WAITING: usize = 4;
/// A shorter trace is read before a thread would have begun (chosen).
const WORTH_A_THREAD: usize = 4096;

/// Neighbouring rows, in the order of the trace.
struct Batch {
    /// The first `count` hold.
    rows: Vec<Row>,
    count: usize,
    /// What comes behind them, where it is no row.
    then: Option<Result<Next, TraceFault>>,
    epoch_ns: Option<i64>,
}

impl Batch {
    fn empty() -> Self {
        Self { rows: vec![Row::empty(); BATCH], count: 0, then: None, epoch_ns: None }
    }

    fn fill(&mut self, source: &mut Rows) {
        (self.count, self.then) = (0, None);
        for row in &mut self.rows {
            match source.next_row(row) {
                Ok(Next::Row) => self.count += 1,
                other => {
                    self.then = Some(other);
                    break;
                }
            }
        }
        self.epoch_ns = source.epoch_ns();
    }

    /// Whether nothing can come behind it.
    fn is_last(&self) -> bool {
        matches!(self.then, Some(Ok(Next::End | Next::CutOff(_)) | Err(_)))
    }
}

/// The rows of a source, from a thread once there are many.
pub(super) struct RowsAhead {
    layout: Layout,
    /// The source, until the thread has it.
    here: Option<Rows>,
    /// Rows that are still read here.
    left: usize,
    thread: Option<Threaded>,
}

struct Threaded {
    batches: Receiver<Batch>,
    emptied: Sender<Batch>,
    current: Batch,
    at: usize,
}

impl RowsAhead {
    pub(super) fn of(rows: Rows) -> Self {
        Self { layout: rows.layout().clone(), here: Some(rows), left: WORTH_A_THREAD, thread: None }
    }
}

impl Threaded {
    fn start(rows: Rows) -> Self {
        let (filled, batches) = sync_channel(WAITING);
        let (emptied, empty) = channel();
        let current = Batch { epoch_ns: rows.epoch_ns(), ..Batch::empty() };
        std::thread::spawn(move || read_on(rows, &filled, &empty));
        Self { batches, emptied, current, at: 0 }
    }

    #[inline]
    fn next_row(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        while self.at == self.current.count {
            if let Some(next) = self.current.then.take() {
                return next;
            }
            let Ok(batch) = self.batches.recv() else {
                // Its batch before said why.
                return Ok(Next::End);
            };
            let before = std::mem::replace(&mut self.current, batch);
            self.at = 0;
            // Where the thread is over nobody wants it.
            let _ = self.emptied.send(before);
        }
        if let Some(read) = self.current.rows.get(self.at) {
            row.clone_from(read);
        }
        self.at += 1;
        Ok(Next::Row)
    }
}

/// Reads to the end, or until nobody takes what is read.
fn read_on(mut rows: Rows, filled: &SyncSender<Batch>, empty: &Receiver<Batch>) {
    loop {
        let mut batch = empty.try_recv().unwrap_or_else(|_| Batch::empty());
        batch.fill(&mut rows);
        let last = batch.is_last();
        if filled.send(batch).is_err() || last {
            return;
        }
    }
}

impl RowSource for RowsAhead {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn epoch_ns(&self) -> Option<i64> {
        let of_thread = || self.thread.as_ref().and_then(|thread| thread.current.epoch_ns);
        self.here.as_ref().map_or_else(of_thread, |rows| rows.epoch_ns())
    }

    #[inline]
    fn next_row(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        if let Some(thread) = &mut self.thread {
            return thread.next_row(row);
        }
        let Some(rows) = &mut self.here else { return Ok(Next::End) };
        let next = rows.next_row(row);
        self.left -= 1;
        if self.left == 0 {
            self.thread = self.here.take().map(Threaded::start);
        }
        next
    }
}
