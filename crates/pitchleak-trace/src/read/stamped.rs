//! Columns of numbers as the cells of a table: times of an epoch become seconds since the first.

use super::columns::{Content, Layout};
use super::dialect::time_format;
use super::error::TraceFault;
use super::stamp::Epoch;
use super::table::Cells;
use super::table_text::TextRow;
use crate::rig::{ColumnMap, Rig};
use crate::signal::Signal;
use crate::times::TimeFormat;
use std::borrow::Cow;

/// So many rows say how times are written.
const ROWS: usize = 100;

/// The first rows as text, as those of a file of text are looked at.
pub(super) fn sample(columns: &[Vec<f64>]) -> Vec<TextRow> {
    let rows = columns.iter().map(Vec::len).max().unwrap_or(0).min(ROWS);
    let text = |row: usize, column: &Vec<f64>| {
        column.get(row).filter(|value| !value.is_nan()).map_or_else(String::new, f64::to_string)
    };
    let row = |row: usize| TextRow {
        line: row as u64,
        cells: columns.iter().map(|column| text(row, column)).collect(),
    };
    (0..rows).map(row).collect()
}

/// How the column of time stamps, if there is one, becomes seconds.
pub(super) struct Stamped {
    pub(super) format: TimeFormat,
    epoch: Epoch,
}

impl Stamped {
    pub(super) fn new(
        layout: &Layout,
        foreign: &ColumnMap,
        rig: &Rig,
        columns: &[Vec<f64>],
    ) -> Result<Self, TraceFault> {
        let stamps = layout.columns.iter().position(|column| column.content == Content::Timestamp);
        let format = match stamps.and_then(|index| columns.get(index)) {
            None => TimeFormat::default(),
            Some(values) => {
                let cells: Vec<String> =
                    values.iter().take(ROWS).filter(|value| !value.is_nan()).map(f64::to_string).collect();
                time_format(&cells.iter().map(String::as_str).collect::<Vec<_>>(), layout, foreign, rig)?
            }
        };
        Ok(Self { epoch: Epoch::new(format.clone()), format })
    }

    /// The columns that are read.
    pub(super) fn cells(mut self, layout: &Layout, columns: Vec<Vec<f64>>) -> Vec<Cells<'static>> {
        let mut cells = Vec::new();
        for (index, (column, values)) in layout.columns.iter().zip(columns).enumerate() {
            let (signal, unit, values) = match column.content {
                Content::Number(signal, unit) => (signal, unit, values),
                Content::Timestamp => {
                    let seconds =
                        |value: &f64| self.epoch.seconds(value.to_string().as_bytes()).unwrap_or(f64::NAN);
                    (Signal::Time, None, values.iter().map(seconds).collect())
                }
                Content::Ignored => continue,
            };
            cells.push(Cells { signal, unit, values: Cow::Owned(values), index });
        }
        cells
    }
}
