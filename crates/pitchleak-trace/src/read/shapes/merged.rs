//! Readings that come one by one, each with its time, as rows: a row for each time, an empty cell where a channel has no
//! reading then. They are held, because a channel may come after all of another.
//!
//! Long tables: a row is one reading, with its time, its channel's name and its value, and maybe what it is worth. So write
//! InfluxDB (annotated CSV, <https://docs.influxdata.com/influxdb/v2/reference/syntax/annotated-csv/>), WinCC's logs
//! (`VarName;TimeString;VarValue;Validity;Time_ms`) and most databases.
//!
//! A column of times before each channel or group of channels, as TwinCAT Scope, catman and DIAdem export channels of
//! several rates: `Time;Pressure A;Time;Flow A`.

use super::{Recast, Shape, Source, Text, place, write_cell};
use crate::header::{letters, lists};
use crate::read::error::TraceFault;
use crate::read::format::MOST_HELD;
use crate::read::number::number;
use crate::read::records::{Stop, Written, stopped_early, text};
use crate::read::table_text::{TextTable, bare_unit};
use crate::rig::Decimal;
use crate::times::{self, TimeFault, TimeFormat};
use std::collections::HashMap;
use std::ops::Range;

/// How times are compared: as instants, or as numbers.
#[derive(Clone)]
struct Times {
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
    fn are_numbers(&self) -> bool {
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
struct Merged {
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
    fn add(
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

pub(super) const LONG: Shape = Shape { name: "a reading per row", told: told_long };

const TIMES: &str = "timems time timestamp timestring datetime dateandtime ts zeitstempel zeit date";
const CHANNELS: &str =
    "field channel varname tag tagname signal variable metric pointname point kanal sensor item name";
const VALUES: &str = "value varvalue wert";
const UNITS: &str = "unit units einheit";
/// What a reading is worth, with the cells that say that it is good, blanks between them; OPC counts 192 and more as good.
const QUALITIES: [(&str, &str); 4] = [
    ("validity", "1 good valid true"),
    ("quality", "192 good ok valid true 216"),
    ("statuscode", "0 0x00000000 good"),
    ("status", "0 good ok valid"),
];
/// WinCC counts days since 30 December 1899 in millionths.
const WINCC_TIME: &str = "timems";

/// The places of a reading's parts.
#[derive(Clone)]
struct Places {
    time: usize,
    channel: usize,
    value: usize,
    unit: Option<usize>,
    quality: Option<(usize, &'static str)>,
    /// Cells of the header, which may come again.
    header: Vec<String>,
    time_is_wincc: bool,
}

fn told_long(table: &TextTable, _: &[u8]) -> Option<Recast> {
    let headers = &table.headers;
    let time = place(headers, WINCC_TIME).or_else(|| place(headers, TIMES))?;
    let mut channel = place(headers, CHANNELS)?;
    let value = place(headers, VALUES)?;
    // Where every reading is of the field `value`, what was measured tells them apart.
    let own = headers.get(channel);
    let only_values =
        table.column(channel).iter().all(|name| *name == "value" || Some(*name) == own.map(String::as_str));
    if let Some(measurement) = place(headers, "measurement").filter(|_| only_values) {
        channel = measurement;
    }
    let quality = QUALITIES.iter().find_map(|(name, good)| Some((place(headers, name)?, *good)));
    let time_is_wincc = headers.get(time).is_some_and(|header| letters(header) == WINCC_TIME);
    let cells: Vec<String> = table.column(time).iter().map(|cell| in_days(cell, time_is_wincc)).collect();
    let times = Times::of(&cells.iter().map(String::as_str).collect::<Vec<_>>())?;
    let places = Places {
        time,
        channel,
        value,
        unit: place(headers, UNITS),
        quality,
        header: headers.clone(),
        time_is_wincc,
    };
    Some(Box::new(move |source| recast_long(source, &places, times)))
}

fn recast_long(source: Source, places: &Places, mut times: Times) -> Result<Text, TraceFault> {
    // A bare number stays what the file calls it, so that a unit can be given by its name.
    let own = places.header.get(places.time).map_or("timestamp", String::as_str);
    let time_name = if times.are_numbers() { own } else { "timestamp" };
    Merged::default().of(source, time_name, |merged, cells| {
        let cell = |place: usize| text(cells.get(place).copied().unwrap_or_default()).trim().to_owned();
        let name = cell(places.channel);
        let is_reading =
            !name.is_empty() && !name.starts_with("$RT_") && cell(0).bytes().next() != Some(b'#');
        // InfluxDB begins each table with its header.
        if !is_reading || places.header.get(places.channel) == Some(&name) {
            return Ok(());
        }
        let name = match places.unit.map(cell).filter(|unit| !unit.is_empty()) {
            Some(unit) => format!("{name} [{unit}]"),
            None => name,
        };
        let channel = merged.channel(&name);
        let is_good = places.quality.is_none_or(|(place, good)| lists(good, &cell(place).to_lowercase()));
        if !is_good {
            return Ok(());
        }
        let time = in_days(&cell(places.time), places.time_is_wincc);
        merged.add(&mut times, time.as_bytes(), channel, cell(places.value).as_bytes())
    })
}

/// WinCC's millionths of days as a spreadsheet's days.
fn in_days(cell: &str, is_wincc: bool) -> String {
    match number(cell, Decimal::Comma) {
        Some(millionths) if is_wincc => format!("{:.11}", millionths / 1e6),
        _ => cell.to_owned(),
    }
}

pub(super) const OWN_TIMES: Shape =
    Shape { name: "a column of times for each channel", told: told_own_times };

/// What columns of times are called; behind it may stand a number, a unit or a rate.
const CALLED: &[&str] = &["time", "zeit", "xvalue", "timestamp"];

/// Each channel's column and that of its times.
struct Pair {
    time: usize,
    channel: usize,
}

fn told_own_times(table: &TextTable, _: &[u8]) -> Option<Recast> {
    let units = table.units.as_ref().map(|units| units.cells.as_slice()).unwrap_or_default();
    of_columns(&table.headers, units, &table.column(0))
}

/// Of columns with these headers and units, the first of which begins with these times.
pub(super) fn of_columns(headers: &[String], units: &[String], first_times: &[&str]) -> Option<Recast> {
    let is_time = |header: &String| CALLED.iter().any(|name| letters(header).starts_with(name));
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
    Some(Box::new(move |source| recast_own_times(source, &pairs, &named, &times)))
}

fn recast_own_times(
    source: Source,
    pairs: &[Pair],
    named: &[String],
    times: &Times,
) -> Result<Text, TraceFault> {
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
