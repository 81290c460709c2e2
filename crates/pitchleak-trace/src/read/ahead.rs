//! Rows read by a thread of their own, a few batches ahead of who takes them: a text of numbers takes as long to read as its
//! samples to estimate from.

use super::columns::Layout;
use super::error::TraceFault;
use super::format::Rows;
use super::row::{Next, Row, RowSource};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};

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
