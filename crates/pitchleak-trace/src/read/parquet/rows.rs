//! The rows of a Parquet file, row group after row group.

use super::codec::UNREAD;
use super::footer::Kind;
use super::pages::{self, Columns};
use crate::header::shorten;
use crate::read::columns::{Content, Layout, TextRow, bind, column, standard};
use crate::read::error::{Counted, TraceFault};
use crate::read::format::{Rows, Stream, mistaken};
use crate::read::stamps::{Epoch, seconds_between, time_format};
use crate::read::table::{Cells, TableRows};
use crate::read::table_text::TextTable;
use crate::rig::Rig;
use crate::signal::Signal;
use crate::times::TimeFormat;
use bytes::Bytes;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use std::borrow::Cow;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::{Arc, Once, OnceLock};

/// Rows read at a time: their columns stay in the cache.
const BATCH: usize = 4096;
/// So many rows say how times are written.
const SAMPLE: usize = 100;

/// A column without a nest.
struct Field {
    /// Its place in the file.
    place: usize,
    name: String,
    kind: Kind,
    /// Whether cells may be missing.
    optional: bool,
}

/// A column that is read.
struct Read {
    field: usize,
    place: usize,
    optional: bool,
    kind: Kind,
    content: Content,
}

impl Read {
    fn is_stamp(&self) -> bool {
        self.content.signal == Signal::Timestamp
    }
}

pub(super) fn open(stream: Stream, rig: &Rig) -> Result<Rows, TraceFault> {
    guarded(|| open_unguarded(stream, rig))
}

pub(super) fn look(stream: Stream, rig: &Rig) -> Result<TextTable, TraceFault> {
    guarded(|| {
        let file = columns_of(stream)?;
        let fields = fields(file.as_ref());
        let names: Vec<String> = fields.iter().map(|field| field.name.clone()).collect();
        let mistaken = mistaken(names.join(",").as_bytes());
        let table = TextTable::of_columns(names, sample(file.as_ref(), &fields, rig)?, rig);
        if table.bound.is_err() { mistaken.map_or(Ok(table), Err) } else { Ok(table) }
    })
}

fn columns_of(mut stream: Stream) -> Result<Arc<dyn Columns>, TraceFault> {
    match stream.file.take() {
        Some(file) => pages::open(file).map_err(damaged),
        None => pages::open(Bytes::from(stream.hold()?)).map_err(damaged),
    }
}

fn open_unguarded(stream: Stream, rig: &Rig) -> Result<Rows, TraceFault> {
    let file = columns_of(stream)?;
    let fields = fields(file.as_ref());
    let names: Vec<String> = fields.iter().map(|field| field.name.clone()).collect();
    let sample = sample(file.as_ref(), &fields, rig)?;
    let bound = bind(&names, None, &sample, rig)
        .map_err(|fault| mistaken(names.join(",").as_bytes()).unwrap_or(fault))?;
    let mut layout = Layout { counted: Counted::Rows, ..bound.layout };
    let mut read = Vec::new();
    for (index, (field, bound_column)) in fields.iter().zip(&layout.columns).enumerate() {
        let Some(content) = bound_column.content else { continue };
        let fits = match bound_column.is_timestamp() {
            true => !matches!(field.kind, Kind::Other | Kind::Int96),
            false => matches!(field.kind, Kind::Number | Kind::Decimal(_)),
        };
        if field.kind == Kind::Int96 {
            return Err(TraceFault::Ambiguous {
                what: format!(
                    "column `{}` holds times of 96 bits (INT96), which are not read",
                    shorten(&field.name, 40)
                ),
                settle:
                    "write it with spark.sql.parquet.outputTimestampType=TIMESTAMP_MICROS, in Python without \
                         use_deprecated_int96_timestamps"
                        .to_owned(),
            });
        }
        if !fits {
            return Err(TraceFault::Ambiguous {
                what: format!("column `{}` does not hold numbers", shorten(&field.name, 40)),
                settle: "write it as a column of doubles".to_owned(),
            });
        }
        let Field { place, optional, kind, .. } = *field;
        read.push(Read { field: index, place, optional, kind, content });
    }
    layout.time = match read.iter().find(|read| read.is_stamp()) {
        Some(stamps) if !matches!(stamps.kind, Kind::Stamp(_)) => {
            time_format(&column(&sample, stamps.field), &layout, &bound.foreign, rig)?
        }
        _ => TimeFormat::default(),
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

fn fields(file: &dyn Columns) -> Vec<Field> {
    let fields = file.leaves().iter().enumerate().filter(|(_, leaf)| leaf.is_flat());
    let fields = fields.map(|(place, leaf)| Field {
        place,
        name: leaf.name.clone(),
        kind: leaf.kind,
        optional: leaf.is_optional(),
    });
    fields.collect()
}

/// Whether a column's header alone says that it holds numbers, and of which signal.
fn is_plain(field: &Field, rig: &Rig) -> bool {
    let is_mapped = || rig.columns.values().any(|column| column.name.trim() == field.name.trim());
    standard(field.name.trim()).is_some_and(|standard| standard.unit.is_some()) && !is_mapped()
}

/// The first rows as text, as those of a file of text are looked at; without the columns whose cells nobody asks, because
/// a page of each would be read twice.
fn sample(file: &dyn Columns, fields: &[Field], rig: &Rig) -> Result<Vec<TextRow>, TraceFault> {
    let mut rows: Vec<TextRow> = Vec::new();
    if file.groups() == 0 {
        return Ok(rows);
    }
    for (index, field) in fields.iter().enumerate() {
        let cells: Vec<String> = match field.kind {
            Kind::Other => continue,
            Kind::Number | Kind::Decimal(_) if is_plain(field, rig) => continue,
            Kind::Stamp(_) | Kind::Int96 => vec!["2000-01-01T00:00:00".to_owned()],
            Kind::Text => {
                let mut reader = file.read(0, field.place).map_err(damaged)?;
                let texts = texts(&mut reader, field.optional, SAMPLE)?;
                texts.iter().map(|text| String::from_utf8_lossy(text.data()).into_owned()).collect()
            }
            Kind::Number | Kind::Decimal(_) => {
                let mut reader = file.read(0, field.place).map_err(damaged)?;
                let values = numbers(&mut reader, field.kind, field.optional, SAMPLE)?;
                values
                    .iter()
                    .map(|value| if value.is_nan() { String::new() } else { value.to_string() })
                    .collect()
            }
        };
        for (row, cell) in cells.into_iter().enumerate() {
            if rows.len() == row {
                rows.push(TextRow { line: row as u64, cells: vec![String::new(); fields.len()] });
            }
            if let Some(to) = rows.get_mut(row).and_then(|row| row.cells.get_mut(index)) {
                *to = cell;
            }
        }
    }
    Ok(rows)
}

/// Row group after row group, a few thousand rows at a time.
struct Batches {
    file: Arc<dyn Columns>,
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
                let open = self.read.iter().map(|read| self.file.read(self.group, read.place));
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
            let values = match (read.is_stamp(), read.kind) {
                (true, Kind::Stamp(ns)) => {
                    let stamps = stamps(reader, read.optional)?;
                    let first_ns = &mut self.first_ns;
                    let seconds = |stamp: Option<i64>| {
                        let Some(stamp) = stamp else { return f64::NAN };
                        let stamp_ns = i128::from(stamp) * i128::from(ns);
                        seconds_between(*first_ns.get_or_insert(stamp_ns), stamp_ns)
                    };
                    stamps.into_iter().map(seconds).collect()
                }
                (true, Kind::Text) => {
                    let texts = texts(reader, read.optional, BATCH)?;
                    texts.iter().map(|text| self.epoch.seconds(text.data()).unwrap_or(f64::NAN)).collect()
                }
                (true, _) => {
                    let values = numbers(reader, read.kind, read.optional, BATCH)?;
                    values.into_iter().map(|value| self.epoch.seconds_of(value)).collect()
                }
                (false, _) => numbers(reader, read.kind, read.optional, BATCH)?,
            };
            cells.push(Cells::of(read.content, Cow::Owned(values), read.field));
        }
        Ok(cells)
    }
}

/// The next cells, `missing` where there is none.
fn read<D: DataType, V: Clone>(
    reader: &mut ColumnReaderImpl<D>,
    optional: bool,
    rows: usize,
    missing: V,
    value: impl Fn(D::T) -> V,
) -> Result<Vec<V>, TraceFault> {
    let (mut values, mut levels) = (Vec::with_capacity(rows), Vec::new());
    let defined = optional.then_some(&mut levels);
    let (records, ..) = reader.read_records(rows, defined, None, &mut values).map_err(damaged)?;
    let mut values = values.into_iter().map(value);
    if values.len() == records {
        return Ok(values.collect());
    }
    let cell = |level: &i16| if *level > 0 { values.next() } else { None };
    Ok(levels.iter().take(records).map(cell).map(|cell| cell.unwrap_or(missing.clone())).collect())
}

fn numbers(
    reader: &mut ColumnReader,
    kind: Kind,
    optional: bool,
    rows: usize,
) -> Result<Vec<f64>, TraceFault> {
    let none = f64::NAN;
    let unit = match kind {
        Kind::Decimal(decimals) => 10_f64.powi(decimals as i32),
        _ => 1.0,
    };
    match reader {
        ColumnReader::DoubleColumnReader(reader) => read(reader, optional, rows, none, |value| value),
        ColumnReader::FloatColumnReader(reader) => read(reader, optional, rows, none, f64::from),
        ColumnReader::Int32ColumnReader(reader) => {
            read(reader, optional, rows, none, |value| f64::from(value) / unit)
        }
        ColumnReader::Int64ColumnReader(reader) => {
            read(reader, optional, rows, none, |value| value as f64 / unit)
        }
        _ => Err(TraceFault::Damaged("a column is not of the type that it says".to_owned())),
    }
}

fn stamps(reader: &mut ColumnReader, optional: bool) -> Result<Vec<Option<i64>>, TraceFault> {
    match reader {
        ColumnReader::Int64ColumnReader(reader) => read(reader, optional, BATCH, None, Some),
        _ => Err(TraceFault::Damaged("a column is not of the type that it says".to_owned())),
    }
}

fn texts(reader: &mut ColumnReader, optional: bool, rows: usize) -> Result<Vec<ByteArray>, TraceFault> {
    match reader {
        ColumnReader::ByteArrayColumnReader(reader) => {
            read(reader, optional, rows, ByteArray::from(""), |text| text)
        }
        _ => Err(TraceFault::Damaged("a column is not of the type that it says".to_owned())),
    }
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `read`; a panic within is damage of the file, and nobody hears of it but by the error. What `read` leaves half-done
/// must not be used after an error.
pub(super) fn guarded<T>(read: impl FnOnce() -> Result<T, TraceFault>) -> Result<T, TraceFault> {
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
