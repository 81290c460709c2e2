//! Rows that come one by one as text, such as the lines of a live feed.

use super::columns::{Layout, REQUIRED};
use super::csv::{Cells, Split, describe, read_cells};
use super::error::{BadReason, BadRow, TraceFault};
use super::row::{BadRows, NEEDED, Record, Row};
use super::stamps::Epoch;
use super::validator::{MOST_TIME_S, RowValidator, missing};
use crate::rig::{ColumnMap, Decimal, Rig};

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
