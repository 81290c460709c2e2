//! How a text file of numbers is written: found in its first lines, said where it is not as this program writes one, and
//! refused where it can be read in two ways.

use super::clock::{Epoch, time_format};
use super::columns::{Column, Layout, REQUIRED};
use super::error::TraceFault;
use super::format::{Stream, mistaken};
use super::number::{decimal, number};
use super::proposal::{Proposal, proposals};
use super::records::{Encoding, Records, stopped_early};
use super::shapes::{self, Source};
use super::table_text::TextTable;
use crate::header::shorten;
use crate::rig::{ColumnMap, Decimal, Delimiter, Rig};
use crate::signal::Signal;
use crate::times::TimeFormat;

/// So much of a file says how it is written, bytes.
const AHEAD: usize = 64 * 1024;

/// How a file is written.
pub(super) struct Dialect {
    pub(super) delimiter: Delimiter,
    pub(super) decimal: Decimal,
    pub(super) layout: Layout,
    pub(super) last_header_line: u64,
}

impl Dialect {
    /// The records of a file, and its first ones as a table.
    pub(super) fn first_lines(
        stream: Stream,
        rig: &Rig,
    ) -> Result<(Records, Encoding, TextTable), TraceFault> {
        let encoding = Encoding::of(&stream.start);
        let mut records = Records::new(encoding.decode(stream.bytes));
        let (ahead, whole) = records.look_ahead(AHEAD).map_err(stopped_early)?;
        let declared = rig.csv.delimiter.or_else(|| separator(ahead));
        let Some(table) = TextTable::find(ahead, whole, declared, rig) else {
            // Nothing but line ends, or a stream that fails before its first line.
            return Err(records.next().map_or_else(stopped_early, |_| TraceFault::Empty));
        };
        if table.bound.is_err()
            && let Some(fault) = mistaken(ahead)
        {
            return Err(fault);
        }
        if table.bound.is_err()
            && let Some((shape, recast)) = shapes::told(&table, ahead)
        {
            let (delimiter, last_header_line) = (table.delimiter.byte(), table.last_header_line());
            let mut records = Records::new(recast(Source { records, delimiter, last_header_line })?);
            let (ahead, whole) = records.look_ahead(AHEAD).map_err(stopped_early)?;
            let table = TextTable::find(ahead, whole, Some(Delimiter::Tab), rig).ok_or(TraceFault::Empty)?;
            return Ok((records, encoding, TextTable { shape: Some(shape), ..table }));
        }
        if table.headers.iter().any(|header| header.contains('\0')) {
            return Err(TraceFault::Format("not a CSV file: the header row is binary"));
        }
        Ok((records, encoding, table))
    }

    /// Of the file that begins with this table.
    pub(super) fn of(mut table: TextTable, encoding: Encoding, rig: &Rig) -> Result<Self, TraceFault> {
        let last_header_line = table.last_header_line();
        let bound = std::mem::replace(&mut table.bound, Err(TraceFault::Empty));
        let (mut layout, foreign) = match bound {
            Ok(bound) => (bound.layout, bound.foreign),
            Err(_) if table.headless => return Err(headless(&table)),
            Err(fault) => return Err(hinted(fault, &table, rig)),
        };
        check_shape(&table)?;
        let decimal = match rig.csv.decimal {
            Some(decimal) => decimal,
            None => decimal(&numbers(&table, &layout))?,
        };
        layout.time = time_format(&table.rows, &layout, &foreign, rig)?;
        check_steps(&table, &layout, decimal)?;
        layout.reading = reading(&table, &layout, &foreign, decimal, encoding);
        Ok(Self { delimiter: table.delimiter, decimal, layout, last_header_line })
    }
}

/// `sep=;` in the first line.
fn separator(ahead: &[u8]) -> Option<Delimiter> {
    let ahead = ahead.strip_prefix(b"\xef\xbb\xbf").unwrap_or(ahead);
    let ahead = ahead.strip_prefix(b"\"").unwrap_or(ahead);
    let byte = ahead.strip_prefix(b"sep=")?.first()?;
    Delimiter::NAMES.into_iter().map(|(_, delimiter)| delimiter).find(|delimiter| delimiter.byte() == *byte)
}

/// Where foreign names are shown beside what they may be.
fn hinted(mut fault: TraceFault, table: &TextTable, rig: &Rig) -> TraceFault {
    let TraceFault::MissingColumn { signal, hint, .. } = &mut fault else { return fault };
    let is_missing = |proposed: &&Proposal| match proposed.signal {
        Signal::Timestamp => signal == "time",
        other => REQUIRED.iter().any(|(required, words)| *required == other && words == signal),
    };
    *hint = match proposals(table, rig).iter().find(is_missing) {
        Some(Proposal { signal, column, .. }) => format!(
            "; if `{}` is it, say {} = {} under [columns] of the rig file (`pitchleak columns` proposes all)",
            shorten(&column.name, 40),
            signal.name(),
            column.to_toml(*signal)
        ),
        None => {
            "; [columns] of the rig file names foreign columns (`pitchleak columns` proposes some)".to_owned()
        }
    };
    fault
}

fn headless(table: &TextTable) -> TraceFault {
    TraceFault::Ambiguous {
        what: format!("line {} holds numbers where a header was expected", table.header_line),
        settle: "put a line above it that names each column `<signal>_<unit>`, e.g. t_s,x_mm,pa_bar,pb_bar"
            .to_owned(),
    }
}

/// Rows of another number of cells than the header's are few; else a delimiter is also something else.
fn check_shape(table: &TextTable) -> Result<(), TraceFault> {
    let cells = table.headers.len();
    let other: Vec<usize> =
        table.rows.iter().map(|row| row.cells.len()).filter(|count| *count != cells).collect();
    let Some(first) = other.first().filter(|_| other.len() > 2 && 2 * other.len() > table.rows.len()) else {
        return Ok(());
    };
    let settle = if table.delimiter == Delimiter::Comma && *first > cells {
        "a decimal comma cannot be told from one between cells; export with a semicolon between cells, or with a \
         decimal point"
    } else {
        "the delimiter must be the same in all lines: export it anew, or name it by --delimiter"
    };
    Err(TraceFault::Ambiguous {
        what: format!(
            "most rows have {first} cells, and the header in line {} has {cells}",
            table.header_line
        ),
        settle: settle.to_owned(),
    })
}

/// The cells of every column of numbers.
fn numbers<'a>(table: &'a TextTable, layout: &Layout) -> Vec<Vec<&'a str>> {
    let columns = layout.columns.iter().enumerate();
    let numbers = columns.filter(|(_, column)| column.content.is_some() && !column.is_timestamp());
    numbers.map(|(index, _)| table.column(index)).collect()
}

/// A clock that shows whole seconds only leaves one row of a second.
fn check_steps(table: &TextTable, layout: &Layout, decimal: Decimal) -> Result<(), TraceFault> {
    let is_time = |(_, column): &(usize, &Column)| column.is_time();
    let Some((index, column)) = layout.columns.iter().enumerate().find(is_time) else { return Ok(()) };
    let cells = table.column(index);
    let mut epoch = Epoch::new(layout.time.clone());
    let seconds = |cell: &&str| match column.is_timestamp() {
        true => epoch.seconds(cell.as_bytes()).ok(),
        false => number(cell, decimal),
    };
    let times: Vec<f64> = cells.iter().filter_map(seconds).collect();
    let still = times.windows(2).filter(|pair| pair.first() == pair.last()).count();
    if still < 10 || 5 * still < 3 * times.len() {
        return Ok(());
    }
    Err(TraceFault::Ambiguous {
        what: format!(
            "column `{}` says the same time in {still} of {} rows",
            shorten(&column.header, 40),
            times.len()
        ),
        settle: "export it with fractions of a second".to_owned(),
    })
}

/// What is worth saying of how a file was read.
fn reading(
    table: &TextTable,
    layout: &Layout,
    foreign: &ColumnMap,
    decimal: Decimal,
    encoding: Encoding,
) -> Option<String> {
    let mut parts = Vec::new();
    if encoding != Encoding::Utf8 {
        parts.push("UTF-16".to_owned());
    }
    parts.extend(table.shape.map(str::to_owned));
    if table.shape.is_none() && table.delimiter != Delimiter::Comma {
        parts.push(format!("{} between cells", table.delimiter.name()));
    }
    if decimal == Decimal::Comma {
        parts.push("decimal comma".to_owned());
    }
    if table.shape.is_none() && table.header_line > 1 {
        parts.push(format!("header in line {}", table.header_line));
    }
    parts.extend(table.units.as_ref().map(|units| format!("units in line {}", units.line)));
    if layout.has(Signal::Timestamp) && layout.time != TimeFormat::default() {
        parts.push(format!("times as `{}`{}", layout.time.kind, layout.time.zone_text()));
    }
    for (signal, column) in foreign {
        let gauge = if column.offset < 0.0 { ", absolute" } else { "" };
        let unit = column.unit.map(|unit| format!(" in {}{gauge}", unit.text)).unwrap_or_default();
        parts.push(format!("{} from `{}`{unit}", signal.name(), shorten(&column.name, 40)));
    }
    (!parts.is_empty()).then(|| parts.join(", "))
}
