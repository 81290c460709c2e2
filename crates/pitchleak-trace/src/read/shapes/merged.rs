//! Readings that come one by one, each with its time, as rows: a row for each time, an empty cell where a channel has no
//! reading then. They are held, because a channel may come after all of another.

use super::{Source, Text, write_cell};
use crate::read::error::TraceFault;
use crate::read::format::MOST_HELD;
use crate::read::number::number;
use crate::read::records::{Stop, Written, stopped_early};
use crate::rig::Decimal;
use crate::times::{self, TimeFault, TimeFormat};
use std::collections::HashMap;
use std::ops::Range;

/// How times are compared: as instants, or as numbers.
#[derive(Clone)]
pub(super) struct Times {
    format: Option<TimeFormat>,
    last_ns: Option<i128>,
}

impl Times {
    /// As these cells are written; none where they are no times.
    pub(super) fn of(cells: &[&str]) -> Option<Self> {
        let format = match times::guess(cells) {
            Ok(format) => Some(format),
            Err(TimeFault::BareNumber(_)) => None,
            Err(_) => return None,
        };
        Some(Self { format, last_ns: None })
    }

    /// Whether they are numbers, which say neither their unit nor their epoch.
    pub(super) fn are_numbers(&self) -> bool {
        self.format.is_none()
    }

    /// A time, ns since any one instant.
    fn ns(&mut self, cell: &str) -> Option<i128> {
        let Some(format) = &self.format else {
            let number = number(cell, Decimal::Comma)?;
            return (number.abs() < 1e18).then_some((number * 1e9).round() as i128);
        };
        self.last_ns = Some(format.instant_ns(format.kind.read(cell)?, self.last_ns)?);
        self.last_ns
    }
}

struct Row {
    ns: i128,
    time: Range<u32>,
    cells: Vec<Range<u32>>,
}

#[derive(Default)]
pub(super) struct Merged {
    /// All cells, one after the other.
    held: Vec<u8>,
    channels: Vec<String>,
    places: HashMap<String, usize>,
    rows: Vec<Row>,
    at: HashMap<i128, usize>,
}

impl Merged {
    /// The rows of a source, as `add` takes in the readings of each of its records; `time` is what their times are called.
    pub(super) fn of(
        mut self,
        mut source: Source,
        time: &str,
        mut add: impl FnMut(&mut Self, &[&[u8]]) -> Result<(), TraceFault>,
    ) -> Result<Text, TraceFault> {
        source.skip_header()?;
        loop {
            match source.records.next() {
                Ok(record) => add(&mut self, &record.cells(source.delimiter))?,
                Err(Stop::End) => return Ok(self.text(time)),
                Err(stop) => return Err(stopped_early(stop)),
            }
        }
    }

    /// The place of a channel, which is a new one where none is called so.
    pub(super) fn channel(&mut self, name: &str) -> usize {
        if let Some(place) = self.places.get(name) {
            return *place;
        }
        self.channels.push(name.to_owned());
        self.places.insert(name.to_owned(), self.channels.len() - 1);
        self.channels.len() - 1
    }

    /// A reading; one whose time can't be read is left out.
    pub(super) fn add(
        &mut self,
        times: &mut Times,
        time: &[u8],
        channel: usize,
        value: &[u8],
    ) -> Result<(), TraceFault> {
        let Some(ns) = std::str::from_utf8(time.trim_ascii()).ok().and_then(|cell| times.ns(cell)) else {
            return Ok(());
        };
        let value = self.hold(value)?;
        let row = match self.at.get(&ns) {
            Some(row) => *row,
            None => {
                let time = self.hold(time)?;
                self.rows.push(Row { ns, time, cells: Vec::new() });
                self.at.insert(ns, self.rows.len() - 1);
                self.rows.len() - 1
            }
        };
        if let Some(row) = self.rows.get_mut(row) {
            row.cells.resize(row.cells.len().max(channel + 1), 0..0);
            if let Some(cell) = row.cells.get_mut(channel) {
                *cell = value;
            }
        }
        Ok(())
    }

    fn hold(&mut self, cell: &[u8]) -> Result<Range<u32>, TraceFault> {
        let start = self.held.len() as u32;
        write_cell(cell, &mut self.held);
        if self.held.len() as u64 > MOST_HELD {
            return Err(TraceFault::Format(
                "more than a gigabyte of single readings: give it in parts, or a row per time",
            ));
        }
        Ok(start..self.held.len() as u32)
    }

    /// The rows in the order of their times, under `time` and the channels' names.
    fn text(mut self, time: &str) -> Text {
        self.at = HashMap::new();
        self.rows.sort_by_key(|row| row.ns);
        let mut next = None;
        let header = time.to_owned() + "\t" + &self.channels.join("\t") + "\n";
        Box::new(Written::by(move |text| {
            let Some(index) = next else {
                text.extend(header.bytes());
                next = Some(0);
                return Ok(true);
            };
            let Some(row) = self.rows.get(index) else { return Ok(false) };
            next = Some(index + 1);
            self.write(row, text);
            Ok(true)
        }))
    }

    fn write(&self, row: &Row, text: &mut Vec<u8>) {
        let held =
            |cell: &Range<u32>| self.held.get(cell.start as usize..cell.end as usize).unwrap_or_default();
        text.extend(held(&row.time));
        for channel in 0..self.channels.len() {
            text.push(b'\t');
            text.extend(row.cells.get(channel).map(held).unwrap_or_default());
        }
        text.push(b'\n');
    }
}
