//! The first lines of a text file as a table: where its header is, what its first rows say, and which columns its headers name, by
//! the names of the contract, those of `[columns]`, and foreign ones that name signal and unit.

use super::columns::{Content, Layout, REQUIRED, doubled, mapped, standard};
use super::error::TraceFault;
use super::records::{Records, text};
use crate::header::{self, HeaderUnit, shorten};
use crate::rig::{ColumnMap, Delimiter, ForeignColumn, Rig};
use crate::signal::Signal;
use crate::times::{self, TimeFault, Zone};
use std::io::Cursor;

/// No preamble is longer, lines.
const LONGEST_PREAMBLE: usize = 100;
/// So many rows say how a file is written.
const ROWS: usize = 1000;
/// A trace has this many columns at least: time, position, two pressures.
const LEAST_CELLS: usize = 4;

/// One record, its cells without blanks around them.
#[derive(Clone, Debug)]
pub(super) struct TextRow {
    /// From 1.
    pub(super) line: u64,
    pub(super) cells: Vec<String>,
}

/// What stands in a column of `rows`, empty cells left out.
pub(super) fn column(rows: &[TextRow], index: usize) -> Vec<&str> {
    rows.iter()
        .filter_map(|row| row.cells.get(index))
        .map(String::as_str)
        .filter(|cell| !cell.is_empty())
        .collect()
}

/// Without brackets and dashes around it.
pub(super) fn bare_unit(cell: &str) -> &str {
    let cell = cell.trim_matches(['-', ' ']);
    let inner = |open, close| cell.strip_prefix(open)?.strip_suffix(close);
    inner('[', ']').or_else(|| inner('(', ')')).unwrap_or(cell).trim_matches(['-', ' '])
}

/// A header, and rows below it.
pub(super) struct TextTable {
    pub(super) delimiter: Delimiter,
    /// From 1; 0 in a file that is no text.
    pub(super) header_line: u64,
    pub(super) headers: Vec<String>,
    /// The row of units below the header.
    pub(super) units: Option<TextRow>,
    pub(super) rows: Vec<TextRow>,
    /// What the columns hold, or why they don't say it.
    pub(super) bound: Result<Bound, TraceFault>,
    /// There is no header: the first line holds numbers.
    pub(super) headless: bool,
    /// What the file was before its rows were made.
    pub(super) shape: Option<&'static str>,
}

impl TextTable {
    /// The table that `ahead`, the start of a file or all of it, is: split at `delimiter`, else at the one that makes a
    /// trace of it, or the most of it.
    pub(super) fn find(ahead: &[u8], whole: bool, delimiter: Option<Delimiter>, rig: &Rig) -> Option<Self> {
        let tried = delimiter
            .map_or_else(|| Delimiter::NAMES.map(|(_, delimiter)| delimiter).to_vec(), |one| vec![one]);
        let mut best: Option<(usize, Self)> = None;
        for delimiter in tried {
            let table = Self::split(ahead, whole, delimiter, rig)?;
            if table.bound.is_ok() {
                return Some(table);
            }
            let cells = table.headers.len();
            let fitting =
                table.rows.iter().filter(|row| row.cells.len() == cells && is_data(&row.cells)).count();
            let score = if cells > 1 { (1 + fitting) * cells } else { 0 };
            if best.as_ref().is_none_or(|(most, _)| score > *most) {
                best = Some((score, table));
            }
        }
        best.map(|(_, table)| table)
    }

    fn split(ahead: &[u8], whole: bool, delimiter: Delimiter, rig: &Rig) -> Option<Self> {
        let mut rows = rows(ahead, whole, delimiter);
        let (table, first) = Self::among(&rows, rig)?;
        Some(Self { delimiter, rows: rows.split_off(first), ..table })
    }

    /// The header that makes a trace of the rows, or the likeliest one, and the first row below it.
    fn among(rows: &[TextRow], rig: &Rig) -> Option<(Self, usize)> {
        let wide = |row: &TextRow| row.cells.len() >= LEAST_CELLS;
        let may_name = |row: &TextRow| wide(row) && !is_data(&row.cells);
        let named = rows.iter().take(LONGEST_PREAMBLE).enumerate().filter(|(_, row)| may_name(row));
        for (index, _) in named {
            let table = Self::at(rows, index, rig)?;
            if table.0.bound.is_ok() {
                return Some(table);
            }
        }
        let is_data_row = |row: &TextRow| wide(row) && is_data(&row.cells);
        let first_data = rows.iter().take(LONGEST_PREAMBLE).position(is_data_row);
        let header = match first_data {
            Some(data) if data > 0 => {
                let above = |count: usize| data.checked_sub(count).and_then(|index| rows.get(index));
                let units = above(1).is_some_and(is_units) && above(2).is_some_and(wide);
                data - if units { 2 } else { 1 }
            }
            _ => 0,
        };
        let (table, first) = Self::at(rows, header, rig)?;
        Some((Self { headless: first_data == Some(0), ..table }, first))
    }

    /// The header that this row is, without the rows below it, and the first of those.
    fn at(rows: &[TextRow], header: usize, rig: &Rig) -> Option<(Self, usize)> {
        let row = rows.get(header)?;
        let mut headers = row.cells.clone();
        if let Some(first) = headers.first_mut() {
            *first = first.trim_start_matches(['#', '%']).trim_start_matches("//").trim().to_owned();
        }
        let units = rows.get(header + 1).filter(|row| is_units(row)).cloned();
        let first = header + 1 + usize::from(units.is_some());
        let rows = rows.get(first..).unwrap_or_default();
        fit_trailing(&mut headers, rows);
        Some((Self::below(row.line, headers, units, rows, rig), first))
    }

    /// Columns of a file that is no text, with their first cells.
    pub(super) fn of_columns(headers: Vec<String>, rows: Vec<TextRow>, rig: &Rig) -> Self {
        let table = Self::below(0, headers, None, &rows, rig);
        Self { rows, ..table }
    }

    /// What the headers say of the rows below them.
    fn below(
        header_line: u64,
        mut headers: Vec<String>,
        units: Option<TextRow>,
        rows: &[TextRow],
        rig: &Rig,
    ) -> Self {
        name_part(&mut headers, rig);
        let bound = bind(&headers, units.as_ref().map(|row| row.cells.as_slice()), rows, rig);
        let (delimiter, rows) = (Delimiter::Comma, Vec::new());
        Self { delimiter, header_line, headers, units, rows, bound, headless: false, shape: None }
    }

    /// The last line before the rows.
    pub(super) fn last_header_line(&self) -> u64 {
        self.units.as_ref().map_or(self.header_line, |row| row.line)
    }

    /// What stands in a column, empty cells left out.
    pub(super) fn column(&self, index: usize) -> Vec<&str> {
        column(&self.rows, index)
    }
}

fn rows(ahead: &[u8], whole: bool, delimiter: Delimiter) -> Vec<TextRow> {
    let mut records = Records::new(Box::new(Cursor::new(ahead.to_vec())));
    records.split_at(delimiter.byte());
    let mut rows = Vec::new();
    while let Ok(record) = records.next() {
        if (record.unended && !whole && !rows.is_empty()) || rows.len() == ROWS {
            break;
        }
        let cells = record.cells(delimiter.byte());
        rows.push(TextRow {
            line: record.line,
            cells: cells
                .into_iter()
                .map(|cell| text(cell).trim().trim_start_matches('\u{feff}').to_owned())
                .collect(),
        });
    }
    // `sep=;` says how a spreadsheet is to split the rest.
    if rows.first().is_some_and(|row| row.cells.first().is_some_and(|cell| cell.starts_with("sep="))) {
        rows.remove(0);
    }
    rows
}

/// A delimiter at the end of every row, or of the header alone, adds a cell without a name.
fn fit_trailing(headers: &mut Vec<String>, rows: &[TextRow]) {
    let of_length = |length: usize| rows.iter().filter(move |row| row.cells.len() == length);
    let most = |count: usize| 2 * count > rows.len();
    let length = headers.len();
    if headers.last().is_some_and(String::is_empty) && most(of_length(length - 1).count()) {
        headers.pop();
    } else if most(of_length(length + 1).filter(|row| row.cells.last().is_some_and(String::is_empty)).count())
    {
        headers.push(String::new());
    }
}

/// Whether most cells are numbers or times.
fn is_data(cells: &[String]) -> bool {
    let filled = || cells.iter().filter(|cell| !cell.is_empty());
    let values = filled().filter(|cell| cell.starts_with(|c: char| c.is_ascii_digit() || "+-.,".contains(c)));
    2 * values.count() > filled().count()
}

/// Whether most cells are units, in brackets or not.
fn is_units(row: &TextRow) -> bool {
    let filled = || row.cells.iter().filter(|cell| !bare_unit(cell).is_empty());
    let units = filled().filter(|cell| HeaderUnit::is_known(bare_unit(cell))).count();
    units >= 2 && 2 * units >= filled().count()
}

/// What the columns of a file hold.
pub(super) struct Bound {
    pub(super) layout: Layout,
    /// Signals that were found by a foreign header, and the headers.
    pub(super) foreign: ColumnMap,
}

/// Binds `headers`; `units` is the row below them, and `rows` are the first ones.
pub(super) fn bind(
    headers: &[String],
    units: Option<&[String]>,
    rows: &[TextRow],
    rig: &Rig,
) -> Result<Bound, TraceFault> {
    let mut foreign = ColumnMap::new();
    for (index, header) in headers.iter().enumerate() {
        let unit = units.and_then(|units| units.get(index)).map(|unit| bare_unit(unit)).unwrap_or_default();
        if let Some(known) = known(header, rig) {
            check_unit(header, known, unit)?;
            continue;
        }
        let Some((signal, found)) = plain(header, unit, &column(rows, index)) else { continue };
        let is_given = rig.columns.contains_key(&signal)
            || headers.iter().any(|header| known(header, rig).is_some_and(|known| known.signal == signal));
        if is_given {
            continue;
        }
        if let Some(first) = foreign.insert(signal, found) {
            return Err(doubled(signal, &first.name, header));
        }
    }
    let mut map = rig.columns.clone();
    map.extend(foreign.clone());
    let required = if rig.csv.part.is_some() { &REQUIRED[..1] } else { &REQUIRED[..] };
    Ok(Bound { layout: Layout::new(headers, &map, required, rig)?, foreign })
}

/// What a channel is called whose name is its file's.
const NAMELESS: [&str; 5] = ["value", "values", "wert", "data", "y"];

/// Names the channel of a file that holds one.
fn name_part(headers: &mut [String], rig: &Rig) {
    let Some(part) = &rig.csv.part else { return };
    let is_nameless = |header: &&mut String| NAMELESS.contains(&header.trim().to_lowercase().as_str());
    headers.iter_mut().filter(is_nameless).for_each(|header| header.clone_from(part));
}

/// What a header says that the contract or the rig file names; the unit is that of the file's numbers.
fn known(header: &str, rig: &Rig) -> Option<Content> {
    match mapped(header, &rig.columns) {
        Some((signal, column)) => Some(Content { signal, unit: column.unit }),
        None => standard(header),
    }
}

/// The row of units and the header must say the same.
fn check_unit(header: &str, known: Content, unit: &str) -> Result<(), TraceFault> {
    let found = known.signal.dimension().and_then(|dimension| HeaderUnit::by_name(unit, dimension));
    let (Some(bound), Some(found)) = (known.unit, found) else { return Ok(()) };
    if (found.unit.over(&bound) - 1.0).abs() < 1e-9 && found.offset_si.abs() < 1e-9 {
        return Ok(());
    }
    let header = shorten(header, 40);
    Err(TraceFault::Ambiguous {
        what: format!(
            "column `{header}` is read in {}, and the row of units says {}",
            bound.text,
            shorten(unit, 20)
        ),
        settle: "take that row out, or correct it or the name".to_owned(),
    })
}

/// What a foreign header says without a doubt, together with the unit below it.
fn plain(header: &str, unit: &str, cells: &[&str]) -> Option<(Signal, ForeignColumn)> {
    let name_and_unit = |name: &str, unit: &str| {
        let signal = header::signal(name)?;
        let found = HeaderUnit::by_name(unit, signal.dimension()?)?;
        Some((signal, ForeignColumn::with_unit(header, found)))
    };
    name_and_unit(header, unit)
        .or_else(|| header::parts(header).find_map(|(name, unit)| name_and_unit(name, unit)))
        .or_else(|| plain_time(header, cells))
}

/// A column called time whose cells are times of day, dates or epochs; its header may name the zone.
fn plain_time(header: &str, cells: &[&str]) -> Option<(Signal, ForeignColumn)> {
    let is_time = |name: &str| header::signal(name).is_some_and(Signal::is_time);
    let behind = header::parts(header).find(|(name, _)| is_time(name)).map(|(_, behind)| behind);
    if behind.is_none() && !is_time(header) {
        return None;
    }
    match times::guess(cells) {
        Err(TimeFault::BareNumber(_) | TimeFault::Unknown(_)) => None,
        Ok(_) | Err(_) => {
            let zone = behind.and_then(Zone::by_name);
            Some((Signal::Timestamp, ForeignColumn { zone, ..ForeignColumn::new(header, None) }))
        }
    }
}
