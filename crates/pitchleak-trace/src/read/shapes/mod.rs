//! Tables whose rows are no samples: each shape is told by its first lines and recast as rows of samples, a text with tabs
//! between its cells, which is then read as any other. Asked only where the table makes no trace as it is.
//!
//! A new shape is an entry of [`SHAPES`], and a function that tells it.
//!
//! Rows of samples whose cells need a hand: a unit behind each number, as Grafana exports a table (`50.1 bar`), or date and
//! time of day in columns of their own.

mod labview;
mod merged;
#[cfg(test)]
mod tests;

use super::error::TraceFault;
use super::records::{Records, Stop, Written};
use super::table_text::TextTable;
use crate::header::{HeaderUnit, letters, lists};
use crate::times::{TimeKind, guess};
use std::borrow::Cow;
use std::io::{self, Read};

/// A shape of tables.
struct Shape {
    /// As a note says it.
    name: &'static str,
    /// How a table that begins so, at the start of this text, is recast; none where it has another shape.
    told: fn(&TextTable, &[u8]) -> Option<Recast>,
}

type Recast = Box<dyn FnOnce(Source) -> Result<Text, TraceFault>>;

/// Rows of samples, with tabs between their cells.
pub(super) type Text = Box<dyn Read + Send>;

/// Every shape; the first that fits is taken.
const SHAPES: &[Shape] =
    &[labview::SHAPE, merged::LONG, merged::OWN_TIMES, DATE_AND_TIME_APART, UNITS_IN_CELLS];

/// The shape of a table, and how it is recast.
pub(super) fn told(table: &TextTable, ahead: &[u8]) -> Option<(&'static str, Recast)> {
    SHAPES.iter().find_map(|shape| Some((shape.name, (shape.told)(table, ahead)?)))
}

/// A text from its begin on.
pub(super) struct Source {
    pub(super) records: Records,
    pub(super) delimiter: u8,
    pub(super) last_header_line: u64,
}

impl Source {
    /// Passes over all that stands before the first row.
    fn skip_header(&mut self) -> Result<(), TraceFault> {
        self.records.skip_header(self.delimiter, self.last_header_line)
    }

    /// The rows one by one, each in the line that it had; `header` stands in the last line before them.
    fn row_by_row(
        mut self,
        header: &[String],
        mut recast: impl for<'c> FnMut(&[&'c [u8]]) -> Vec<Cow<'c, [u8]>> + Send + 'static,
    ) -> Result<Text, TraceFault> {
        self.skip_header()?;
        let mut start = vec![b'\n'; self.last_header_line.saturating_sub(1) as usize];
        start.extend(header.join("\t").bytes());
        start.push(b'\n');
        let mut line = self.last_header_line + 1;
        let mut first = Some(start);
        Ok(Box::new(Written::by(move |text| {
            if let Some(start) = first.take() {
                text.extend(start);
            }
            match self.records.next() {
                Ok(record) => {
                    text.extend((line..record.line).map(|_| b'\n'));
                    line = record.line + 1;
                    write_row(&recast(&record.cells(self.delimiter)), text);
                    Ok(true)
                }
                Err(Stop::End) => Ok(false),
                Err(Stop::Failed(error)) => Err(error),
                Err(Stop::TooLong) => Err(io::Error::other("a line is longer than a megabyte")),
            }
        })))
    }
}

fn write_row(cells: &[Cow<'_, [u8]>], text: &mut Vec<u8>) {
    for (index, cell) in cells.iter().enumerate() {
        if index > 0 {
            text.push(b'\t');
        }
        write_cell(cell, text);
    }
    text.push(b'\n');
}

/// The first column that is called by one of the names, letters and digits only; blanks between the names.
fn place(headers: &[String], names: &str) -> Option<usize> {
    headers.iter().position(|header| lists(names, &letters(header)))
}

/// A cell without blanks, and without what would part it.
fn write_cell(cell: &[u8], text: &mut Vec<u8>) {
    text.extend(
        cell.trim_ascii().iter().map(|byte| if matches!(byte, b'\t' | b'\n' | b'\r') { b' ' } else { *byte }),
    );
}

const UNITS_IN_CELLS: Shape = Shape { name: "units in the cells", told: units };
const DATE_AND_TIME_APART: Shape = Shape { name: "date and time apart", told: date_and_time };

/// A number and what stands behind it.
fn parted(cell: &str) -> (&str, &str) {
    let end = cell.find(|c: char| !c.is_ascii_digit() && !"+-.,".contains(c)).unwrap_or(cell.len());
    let (number, unit) = cell.split_at(end);
    (number, unit.trim())
}

/// The unit that nearly all cells of a column have.
fn unit_of(cells: &[&str]) -> Option<String> {
    let unit = cells.iter().map(|cell| parted(cell).1).find(|unit| !unit.is_empty())?;
    let fitting = cells.iter().filter(|cell| parted(cell).1 == unit && !parted(cell).0.is_empty()).count();
    (HeaderUnit::is_known(unit) && 10 * fitting >= 9 * cells.len()).then(|| unit.to_owned())
}

fn units(table: &TextTable, _: &[u8]) -> Option<Recast> {
    let units: Vec<Option<String>> =
        (0..table.headers.len()).map(|index| unit_of(&table.column(index))).collect();
    if units.iter().flatten().count() == 0 {
        return None;
    }
    let header: Vec<String> = table
        .headers
        .iter()
        .zip(&units)
        .map(|(header, unit)| {
            unit.as_ref().map_or_else(|| header.clone(), |unit| format!("{header} [{unit}]"))
        })
        .collect();
    Some(Box::new(move |source| {
        source.row_by_row(&header, move |cells| {
            let bare = cells.iter().copied().enumerate().map(|(index, cell)| {
                let unit = units.get(index).and_then(Option::as_ref);
                let bare = unit.and_then(|unit| cell.trim_ascii().strip_suffix(unit.as_bytes()));
                Cow::Borrowed(bare.unwrap_or(cell))
            });
            bare.collect()
        })
    }))
}

fn date_and_time(table: &TextTable, _: &[u8]) -> Option<Recast> {
    let date = place(&table.headers, "date datum")?;
    let time = place(&table.headers, "time zeit uhrzeit timeofday")?;
    if !guess(&table.column(time)).is_ok_and(|format| format.kind == TimeKind::OfDay) {
        return None;
    }
    let named = |(index, header): (usize, &String)| match index {
        _ if index == date => Some("timestamp".to_owned()),
        _ if index == time => None,
        _ => Some(header.clone()),
    };
    let header: Vec<String> = table.headers.iter().enumerate().filter_map(named).collect();
    Some(Box::new(move |source| {
        source.row_by_row(&header, move |cells| {
            let time_of_day = cells.get(time).copied().unwrap_or_default().trim_ascii();
            let kept = cells.iter().enumerate().filter(|(index, _)| *index != time);
            kept.map(|(index, cell)| match index == date {
                true => Cow::Owned([cell.trim_ascii(), time_of_day].join(&b' ')),
                false => Cow::Borrowed(*cell),
            })
            .collect()
        })
    }))
}
