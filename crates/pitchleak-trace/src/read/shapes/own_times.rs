//! A column of times before each channel or group of channels, as TwinCAT Scope, catman and DIAdem export channels of
//! several rates: `Time;Pressure A;Time;Flow A`.

use super::merged::{Merged, Times};
use super::{Recast, Shape, Source, Text};
use crate::header::letters;
use crate::read::error::TraceFault;
use crate::read::table_text::{TextTable, bare_unit};

pub(super) const SHAPE: Shape = Shape { name: "a column of times for each channel", told };

/// What columns of times are called; behind it may stand a number, a unit or a rate.
const TIMES: &[&str] = &["time", "zeit", "xvalue", "timestamp"];

/// Each channel's column and that of its times.
struct Pair {
    time: usize,
    channel: usize,
}

fn told(table: &TextTable, _: &[u8]) -> Option<Recast> {
    let units = table.units.as_ref().map(|units| units.cells.as_slice()).unwrap_or_default();
    of_columns(&table.headers, units, &table.column(0))
}

/// Of columns with these headers and units, the first of which begins with these times.
pub(super) fn of_columns(headers: &[String], units: &[String], first_times: &[&str]) -> Option<Recast> {
    let is_time = |header: &String| TIMES.iter().any(|name| letters(header).starts_with(name));
    if headers.iter().filter(|header| is_time(header)).count() < 2 || !headers.first().is_some_and(is_time) {
        return None;
    }
    let (mut pairs, mut time) = (Vec::new(), 0);
    for (index, header) in headers.iter().enumerate() {
        if is_time(header) {
            time = index;
        } else if !header.is_empty() && header != "Comment" {
            pairs.push(Pair { time, channel: index });
        }
    }
    let times = Times::of(first_times)?;
    let named: Vec<String> = (0..)
        .zip(headers)
        .map(|(index, header): (usize, &String)| match units.get(index).filter(|unit| !unit.is_empty()) {
            Some(unit) => format!("{header} [{}]", bare_unit(unit)),
            None => header.clone(),
        })
        .collect();
    Some(Box::new(move |source| recast(source, &pairs, &named, &times)))
}

fn recast(source: Source, pairs: &[Pair], named: &[String], times: &Times) -> Result<Text, TraceFault> {
    let name = |index: usize| named.get(index).map_or("", String::as_str);
    let time_name = if times.are_numbers() { name(0) } else { "timestamp" };
    let mut merged = Merged::default();
    // A clock of its own each, for times of day that pass midnight.
    let mut channels: Vec<_> =
        pairs.iter().map(|pair| (merged.channel(name(pair.channel)), times.clone())).collect();
    merged.of(source, time_name, |merged, cells| {
        for (pair, (channel, times)) in pairs.iter().zip(&mut channels) {
            if let (Some(time), Some(value)) = (cells.get(pair.time), cells.get(pair.channel))
                && !value.trim_ascii().is_empty()
            {
                merged.add(times, time, *channel, value)?;
            }
        }
        Ok(())
    })
}
