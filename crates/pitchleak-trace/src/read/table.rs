//! Rows of columns that are in memory already, such as those of a data frame.

use super::columns::{Column, Content, Layout, REQUIRED};
use super::error::{BadReason, BadRow, Counted, TraceError, TraceFault};
use super::row::{Next, Row, RowSource, check_time};
use crate::header::shorten;
use crate::rig::Rig;
use crate::signal::Signal;
use crate::units::Unit;
use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

/// Neighbouring rows: a slice per header, empty where the column is
/// [ignored](ColumnContent::Ignored). NaN is a missing reading.
pub type Batch<'a> = Vec<&'a [f64]>;

/// What a column of a table is read as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnContent {
    /// Readings in the unit that the header names.
    Numbers,
    /// Times, in seconds since the first one of the trace: see
    /// [`seconds_between`](super::seconds_between).
    Timestamps,
    /// Nothing.
    Ignored,
}

/// What the columns of a table hold, by their headers.
#[derive(Clone, Debug)]
pub struct TableLayout(Arc<Layout>);

impl TableLayout {
    /// Reads headers as those of a trace file; `name` is for messages.
    ///
    /// # Errors
    /// Where a signal is missing, comes twice or in an unknown unit.
    pub fn new(name: &str, headers: &[String], rig: &Rig) -> Result<Self, TraceError> {
        let layout = Layout::new(headers, &rig.columns, &REQUIRED, rig).map_err(|fault| fault.of(name))?;
        Ok(Self(Arc::new(Layout { counted: Counted::Rows, ..layout })))
    }

    /// What each column is read as, in the order of the headers.
    pub fn contents(&self) -> impl Iterator<Item = ColumnContent> {
        self.0.columns.iter().map(|column| match column.signal() {
            None => ColumnContent::Ignored,
            Some(Signal::Timestamp) => ColumnContent::Timestamps,
            Some(_) => ColumnContent::Numbers,
        })
    }

    /// Which of the headers is that of the time.
    pub fn time(&self) -> Option<usize> {
        self.0.columns.iter().position(Column::is_time)
    }
}

/// A column that is read.
pub(super) struct Cells<'a> {
    pub(super) signal: Signal,
    /// None where the values are in SI already.
    pub(super) unit: Option<Unit>,
    pub(super) values: Cow<'a, [f64]>,
    /// Its place among the headers.
    pub(super) index: usize,
}

impl<'a> Cells<'a> {
    /// Of a column that is read as `content`; time stamps were made seconds before.
    pub(super) fn of(content: Content, values: Cow<'a, [f64]>, index: usize) -> Self {
        let Content { signal, unit } = content;
        let signal = if signal == Signal::Timestamp { Signal::Time } else { signal };
        Self { signal, unit, values, index }
    }
}

/// Gives neighbouring rows, a column for each that is read, all of one length; none at the end.
pub(super) type Batches<'a> = Box<dyn FnMut() -> Result<Option<Vec<Cells<'a>>>, TraceFault> + Send + 'a>;

/// The rows of batches of columns, one after the other.
pub(super) struct TableRows<'a> {
    layout: Arc<Layout>,
    batches: Batches<'a>,
    current: Vec<Cells<'a>>,
    at: usize,
    length: usize,
    /// Rows before those of `current`.
    before: u64,
    epoch_ns: Arc<OnceLock<i64>>,
}

impl<'a> TableRows<'a> {
    pub(super) fn new(layout: &TableLayout, batches: Vec<Batch<'a>>) -> Result<Self, TraceFault> {
        let bound =
            batches.into_iter().map(|batch| bind(&layout.0, &batch)).collect::<Result<Vec<_>, _>>()?;
        let mut bound = bound.into_iter();
        Ok(Self::over(Arc::clone(&layout.0), Box::new(move || Ok(bound.next()))))
    }

    /// The rows of whatever gives batches.
    pub(super) fn over(layout: Arc<Layout>, batches: Batches<'a>) -> Self {
        let epoch_ns = Arc::default();
        Self { layout, batches, current: Vec::new(), at: 0, length: 0, before: 0, epoch_ns }
    }

    /// With the time stamp from which the seconds of the batches count, ns since 1970, once it is known.
    #[cfg(feature = "parquet")]
    pub(super) fn since(self, epoch_ns: Arc<OnceLock<i64>>) -> Self {
        Self { epoch_ns, ..self }
    }

    #[cold]
    fn next_batch(&mut self) -> Result<bool, TraceFault> {
        let Some(batch) = (self.batches)()? else { return Ok(false) };
        self.before += self.length as u64;
        (self.at, self.length) = (0, batch.first().map_or(0, |cells| cells.values.len()));
        self.current = batch;
        Ok(true)
    }

    #[cold]
    fn blame(&self, at: usize, row: &Row) -> BadRow {
        let value = |cells: &&Cells<'a>| cells.values.get(at).copied().unwrap_or(f64::NAN);
        let infinite = self.current.iter().find(|cells| value(cells).is_infinite());
        let (index, reason, detail) = match infinite {
            Some(cells) => (Some(cells.index), BadReason::NotANumber, "not a finite number"),
            None => match check_time(&self.layout.columns, row) {
                Err(fault) if fault.reason == BadReason::Missing => (fault.column, fault.reason, "missing"),
                Err(fault) => (fault.column, fault.reason, fault.reason.text()),
                Ok(()) => (None, BadReason::NotANumber, BadReason::NotANumber.text()),
            },
        };
        let column = index.and_then(|index| self.layout.columns.get(index));
        self.layout.bad_row(row.line, column, reason, detail.to_owned())
    }
}

impl RowSource for TableRows<'_> {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn epoch_ns(&self) -> Option<i64> {
        self.epoch_ns.get().copied()
    }

    fn count_from(&mut self, rows: u64) {
        self.before = rows;
    }

    #[inline]
    fn next_row(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        while self.at == self.length {
            if !self.next_batch()? {
                return Ok(Next::End);
            }
        }
        // Signals without a column were NaN before and stay so.
        row.line = self.before + self.at as u64;
        let mut finite = true;
        for cells in &self.current {
            let value = cells.values.get(self.at).copied().unwrap_or(f64::NAN);
            finite &= !value.is_infinite();
            row.set(cells.signal, cells.unit.map_or(value, |unit| unit.to_si(value)));
        }
        let at = self.at;
        self.at += 1;
        if finite && check_time(&self.layout.columns, row).is_ok() {
            return Ok(Next::Row);
        }
        Ok(Next::Bad(self.blame(at, row)))
    }
}

/// The columns of a batch that are read, all of one length.
fn bind<'a>(layout: &Layout, batch: &Batch<'a>) -> Result<Vec<Cells<'a>>, TraceFault> {
    let mut read: Vec<Cells<'a>> = Vec::new();
    for (index, column) in layout.columns.iter().enumerate() {
        let Some(content) = column.content else { continue };
        let values = batch.get(index).copied().unwrap_or_default();
        if let Some(first) = read.first().filter(|first| first.values.len() != values.len()) {
            let other = layout.columns.get(first.index).map_or("", |column| &column.header);
            return Err(TraceFault::Length {
                column: shorten(&column.header, 40),
                rows: values.len(),
                other: shorten(other, 40),
                other_rows: first.values.len(),
            });
        }
        read.push(Cells::of(content, Cow::Borrowed(values), index));
    }
    Ok(read)
}
