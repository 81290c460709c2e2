//! Rows of samples whose cells need a hand: a unit behind each number, as Grafana exports a table (`50.1 bar`), or date and
//! time of day in columns of their own.

use super::{Recast, Shape, place};
use crate::header::HeaderUnit;
use crate::read::table_text::TextTable;
use crate::times::{TimeKind, guess};
use std::borrow::Cow;

pub(super) const UNITS_IN_CELLS: Shape = Shape { name: "units in the cells", told: units };
pub(super) const DATE_AND_TIME_APART: Shape = Shape { name: "date and time apart", told: date_and_time };

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
