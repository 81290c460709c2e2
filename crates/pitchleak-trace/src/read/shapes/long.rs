//! Long tables: a row is one reading, with its time, its channel's name and its value, and maybe what it is worth. So write
//! InfluxDB (annotated CSV, <https://docs.influxdata.com/influxdb/v2/reference/syntax/annotated-csv/>), WinCC's logs
//! (`VarName;TimeString;VarValue;Validity;Time_ms`) and most databases.

use super::merged::{Merged, Times};
use super::{Recast, Shape, Source, Text, place};
use crate::header::{letters, lists};
use crate::read::error::TraceFault;
use crate::read::number::number;
use crate::read::records::text;
use crate::read::table_text::TextTable;
use crate::rig::Decimal;

pub(super) const SHAPE: Shape = Shape { name: "a reading per row", told };

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

fn told(table: &TextTable, _: &[u8]) -> Option<Recast> {
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
    Some(Box::new(move |source| recast(source, &places, times)))
}

fn recast(source: Source, places: &Places, mut times: Times) -> Result<Text, TraceFault> {
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
