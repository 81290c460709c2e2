//! Parquet: a flat table of numbers, times typed or as text, row group after row group.

mod footer;
mod pages;
mod thrift;

use super::clock::{Epoch, ROWS, cell_text, first_rows, seconds_between, time_format};
use super::columns::{Content, standard};
use super::error::{Counted, TraceFault};
use super::format::{Rows, Stream, mistaken};
use super::table::{Cells, TableRows};
use super::table_text::{Bound, TextRow, TextTable};
use crate::header::shorten;
use crate::rig::Rig;
use crate::times::TimeFormat;
use bytes::Bytes;
use footer::{Kind, Leaf};
use pages::{Columns, UNREAD};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use std::borrow::Cow;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::{Arc, Once, OnceLock};

/// Rows read at a time: their columns stay in the cache.
const BATCH: usize = 4096;

/// A column that is read.
struct Read {
    /// Its place among the flat columns of the file.
    index: usize,
    content: Content,
    is_stamp: bool,
}

pub(super) fn open(stream: Stream, rig: &Rig) -> Result<Rows, TraceFault> {
    guarded(|| open_unguarded(stream, rig))
}

pub(super) fn look(stream: Stream, rig: &Rig) -> Result<TextTable, TraceFault> {
    guarded(|| table(&columns_of(stream)?, rig))
}

fn columns_of(mut stream: Stream) -> Result<Columns, TraceFault> {
    let file = stream.file.take();
    let columns = match file {
        Some(file) => Columns::of(file),
        None => Columns::of(Bytes::from(stream.hold()?)),
    };
    columns.map_err(damaged)
}

/// The names of the columns, and their first cells.
fn table(file: &Columns, rig: &Rig) -> Result<TextTable, TraceFault> {
    let names: Vec<String> = file.leaves.iter().map(|leaf| leaf.name.clone()).collect();
    let mistaken = mistaken(names.join(",").as_bytes());
    let table = TextTable::of_columns(names, sample(file, rig)?, rig);
    if table.bound.is_err() { mistaken.map_or(Ok(table), Err) } else { Ok(table) }
}

fn open_unguarded(stream: Stream, rig: &Rig) -> Result<Rows, TraceFault> {
    let file = columns_of(stream)?;
    let TextTable { bound, rows, .. } = table(&file, rig)?;
    let Bound { mut layout, foreign } = bound?;
    layout.counted = Counted::Rows;
    let mut read = Vec::new();
    for (index, (leaf, column)) in file.leaves.iter().zip(&layout.columns).enumerate() {
        let Some(content) = column.content else { continue };
        check_kind(leaf, column.is_timestamp())?;
        read.push(Read { index, content, is_stamp: column.is_timestamp() });
    }
    let is_untyped = |read: &Read| read.is_stamp && !matches!(file.leaves[read.index].kind, Kind::Stamp(_));
    layout.time = match read.iter().any(is_untyped) {
        true => time_format(&rows, &layout, &foreign, rig)?,
        false => TimeFormat::default(),
    };
    let layout = Arc::new(layout);
    let epoch_ns = Arc::default();
    let mut batches = Batches {
        file,
        read,
        group: 0,
        open: Vec::new(),
        epoch: Epoch::new(layout.time.clone()),
        first_ns: None,
        epoch_ns: Arc::clone(&epoch_ns),
    };
    let rows = TableRows::over(layout, Box::new(move || guarded(|| batches.next())));
    Ok(Box::new(rows.since(epoch_ns)))
}

/// Whether a column's cells can be what its header says.
fn check_kind(leaf: &Leaf, is_stamp: bool) -> Result<(), TraceFault> {
    let name = shorten(&leaf.name, 40);
    match leaf.kind {
        Kind::Int96 => Err(TraceFault::Ambiguous {
            what: format!("column `{name}` holds times of 96 bits (INT96), which are not read"),
            settle:
                "write it with spark.sql.parquet.outputTimestampType=TIMESTAMP_MICROS, in Python without \
                     use_deprecated_int96_timestamps"
                    .to_owned(),
        }),
        Kind::Number | Kind::Decimal(_) => Ok(()),
        Kind::Stamp(_) | Kind::Text if is_stamp => Ok(()),
        _ => Err(TraceFault::Ambiguous {
            what: format!("column `{name}` does not hold numbers"),
            settle: "write it as a column of doubles".to_owned(),
        }),
    }
}

fn damaged(error: ParquetError) -> TraceFault {
    let what = match error {
        ParquetError::NYI(what) | ParquetError::General(what) | ParquetError::EOF(what) => what,
        other => other.to_string(),
    };
    match what.strip_prefix(UNREAD).and_then(|what| what.split_once('\n')) {
        Some((what, settle)) => {
            TraceFault::Ambiguous { what: format!("not read: {what}"), settle: settle.to_owned() }
        }
        None => TraceFault::Damaged(what.replace('\n', " ")),
    }
}

/// Whether a column's header alone says that it holds numbers, and of which signal.
fn is_plain(name: &str, rig: &Rig) -> bool {
    let is_mapped = || rig.columns.values().any(|column| column.name.trim() == name);
    standard(name).is_some_and(|standard| standard.unit.is_some()) && !is_mapped()
}

/// The first rows as text, as those of a file of text are looked at; without the columns whose cells nobody asks, because
/// a page of each would be read twice.
fn sample(file: &Columns, rig: &Rig) -> Result<Vec<TextRow>, TraceFault> {
    if file.groups() == 0 {
        return Ok(Vec::new());
    }
    let cells = file.leaves.iter().enumerate().map(|(index, leaf)| first_cells(file, index, leaf, rig));
    Ok(first_rows(&cells.collect::<Result<Vec<_>, _>>()?))
}

fn first_cells(file: &Columns, index: usize, leaf: &Leaf, rig: &Rig) -> Result<Vec<String>, TraceFault> {
    let reader = || file.read(0, index).map_err(damaged);
    match leaf.kind {
        Kind::Other => Ok(Vec::new()),
        Kind::Number | Kind::Decimal(_) if is_plain(leaf.name.trim(), rig) => Ok(Vec::new()),
        Kind::Stamp(_) | Kind::Int96 => Ok(vec!["2000-01-01T00:00:00".to_owned()]),
        Kind::Text => {
            let texts = texts(&mut reader()?, leaf, ROWS)?;
            Ok(texts.iter().map(|text| String::from_utf8_lossy(text.data()).into_owned()).collect())
        }
        Kind::Number | Kind::Decimal(_) => {
            let values = numbers(&mut reader()?, leaf, ROWS)?;
            Ok(values.iter().map(cell_text).collect())
        }
    }
}

/// Row group after row group, a few thousand rows at a time.
struct Batches {
    file: Columns,
    read: Vec<Read>,
    group: usize,
    /// Of the row group that is being read; none before it is.
    open: Vec<ColumnReader>,
    epoch: Epoch,
    first_ns: Option<i128>,
    /// The first stamp, for whoever asks.
    epoch_ns: Arc<OnceLock<i64>>,
}

impl Batches {
    fn next(&mut self) -> Result<Option<Vec<Cells<'static>>>, TraceFault> {
        loop {
            if self.open.is_empty() {
                if self.group == self.file.groups() {
                    return Ok(None);
                }
                let open = self.read.iter().map(|read| self.file.read(self.group, read.index));
                self.open = open.collect::<Result<_, _>>().map_err(damaged)?;
                self.group += 1;
            }
            let cells = self.batch()?;
            let rows = cells.first().map_or(0, |cells| cells.values.len());
            if cells.iter().any(|cells| cells.values.len() != rows) {
                return Err(TraceFault::Damaged(
                    "columns of one row group are of different lengths".to_owned(),
                ));
            }
            if rows > 0 {
                let typed = self.first_ns.and_then(|ns| i64::try_from(ns).ok());
                if let Some(first_ns) = typed.or_else(|| self.epoch.first_ns()) {
                    self.epoch_ns.get_or_init(|| first_ns);
                }
                return Ok(Some(cells));
            }
            self.open.clear();
        }
    }

    fn batch(&mut self) -> Result<Vec<Cells<'static>>, TraceFault> {
        let mut cells = Vec::with_capacity(self.read.len());
        for (read, reader) in self.read.iter().zip(&mut self.open) {
            let leaf = &self.file.leaves[read.index];
            let values = match leaf.kind {
                _ if !read.is_stamp => numbers(reader, leaf, BATCH)?,
                Kind::Stamp(ns) => {
                    let first_ns = &mut self.first_ns;
                    let seconds = |stamp: Option<i64>| {
                        let Some(stamp) = stamp else { return f64::NAN };
                        let stamp_ns = i128::from(stamp) * i128::from(ns);
                        seconds_between(*first_ns.get_or_insert(stamp_ns), stamp_ns)
                    };
                    stamps(reader, leaf)?.into_iter().map(seconds).collect()
                }
                Kind::Text => {
                    let texts = texts(reader, leaf, BATCH)?;
                    texts.iter().map(|text| self.epoch.seconds(text.data()).unwrap_or(f64::NAN)).collect()
                }
                _ => {
                    let values = numbers(reader, leaf, BATCH)?;
                    values.into_iter().map(|value| self.epoch.seconds_of(value)).collect()
                }
            };
            cells.push(Cells::of(read.content, Cow::Owned(values), read.index));
        }
        Ok(cells)
    }
}

/// The next cells, `missing` where there is none.
fn read<D: DataType, V: Clone>(
    reader: &mut ColumnReaderImpl<D>,
    leaf: &Leaf,
    rows: usize,
    missing: V,
    value: impl Fn(D::T) -> V,
) -> Result<Vec<V>, TraceFault> {
    let (mut values, mut levels) = (Vec::with_capacity(rows), Vec::new());
    let defined = leaf.is_optional().then_some(&mut levels);
    let (records, ..) = reader.read_records(rows, defined, None, &mut values).map_err(damaged)?;
    let mut values = values.into_iter().map(value);
    if values.len() == records {
        return Ok(values.collect());
    }
    let cell = |level: &i16| if *level > 0 { values.next() } else { None };
    Ok(levels.iter().take(records).map(cell).map(|cell| cell.unwrap_or(missing.clone())).collect())
}

fn numbers(reader: &mut ColumnReader, leaf: &Leaf, rows: usize) -> Result<Vec<f64>, TraceFault> {
    let none = f64::NAN;
    let unit = match leaf.kind {
        Kind::Decimal(decimals) => 10_f64.powi(decimals as i32),
        _ => 1.0,
    };
    match reader {
        ColumnReader::DoubleColumnReader(reader) => read(reader, leaf, rows, none, |value| value),
        ColumnReader::FloatColumnReader(reader) => read(reader, leaf, rows, none, f64::from),
        ColumnReader::Int32ColumnReader(reader) => {
            read(reader, leaf, rows, none, |value| f64::from(value) / unit)
        }
        ColumnReader::Int64ColumnReader(reader) => {
            read(reader, leaf, rows, none, |value| value as f64 / unit)
        }
        _ => Err(other_type()),
    }
}

fn stamps(reader: &mut ColumnReader, leaf: &Leaf) -> Result<Vec<Option<i64>>, TraceFault> {
    match reader {
        ColumnReader::Int64ColumnReader(reader) => read(reader, leaf, BATCH, None, Some),
        _ => Err(other_type()),
    }
}

fn texts(reader: &mut ColumnReader, leaf: &Leaf, rows: usize) -> Result<Vec<ByteArray>, TraceFault> {
    match reader {
        ColumnReader::ByteArrayColumnReader(reader) => {
            read(reader, leaf, rows, ByteArray::from(""), |text| text)
        }
        _ => Err(other_type()),
    }
}

fn other_type() -> TraceFault {
    TraceFault::Damaged("a column is not of the type that it says".to_owned())
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `read`; a panic within is damage of the file, and nobody hears of it but by the error. What `read` leaves half-done
/// must not be used after an error.
fn guarded<T>(read: impl FnOnce() -> Result<T, TraceFault>) -> Result<T, TraceFault> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            if !GUARDED.get() {
                before(panic);
            }
        }));
    });
    GUARDED.set(true);
    let result = panic::catch_unwind(AssertUnwindSafe(read));
    GUARDED.set(false);
    result.unwrap_or_else(|_| {
        Err(TraceFault::Damaged("a page of the Parquet file contradicts itself".to_owned()))
    })
}

#[cfg(test)]
mod tests;
