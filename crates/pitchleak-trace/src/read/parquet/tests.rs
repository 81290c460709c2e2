#![allow(clippy::unwrap_used)]

use crate::Rig;
use crate::read::{Record, TraceError, TraceReader};
use parquet::basic::{Compression, Encoding, GzipLevel, LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{
    ByteArray, ByteArrayType, DoubleType, FloatType, Int32Type, Int64Type, Int96, Int96Type,
};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use pitchleak_core::Sample;
use std::io::Cursor;
use std::sync::Arc;

enum Column {
    Doubles(Vec<Option<f64>>),
    Floats(Vec<f32>),
    Whole(Vec<i32>),
    /// Thousandths in 32 and in 64 bits, as Spark writes decimals.
    Decimals(Vec<i32>),
    LongDecimals(Vec<i64>),
    Stamps(TimeUnit, Vec<i64>),
    Stamps96(Vec<Int96>),
    Texts(Vec<String>),
}

fn file(columns: &[(&str, Column)], rows: usize) -> Vec<u8> {
    file_by(Compression::SNAPPY, columns, rows)
}

fn file_by(compression: Compression, columns: &[(&str, Column)], rows: usize) -> Vec<u8> {
    file_with(WriterProperties::builder().set_compression(compression).build(), columns, rows)
}

/// A file of these columns, in row groups of seven.
fn file_with(properties: WriterProperties, columns: &[(&str, Column)], rows: usize) -> Vec<u8> {
    let field = |(name, column): &(&str, Column)| {
        let (physical, logical) = match column {
            Column::Doubles(_) => (Physical::DOUBLE, None),
            Column::Floats(_) => (Physical::FLOAT, None),
            Column::Whole(_) => (Physical::INT32, None),
            Column::Decimals(_) => (Physical::INT32, Some(LogicalType::decimal(3, 9))),
            Column::LongDecimals(_) => (Physical::INT64, Some(LogicalType::decimal(3, 18))),
            Column::Stamps(unit, _) => (Physical::INT64, Some(LogicalType::timestamp(true, *unit))),
            Column::Stamps96(_) => (Physical::INT96, None),
            Column::Texts(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let optional = matches!(column, Column::Doubles(_));
        let repetition = if optional { Repetition::OPTIONAL } else { Repetition::REQUIRED };
        let field = Type::primitive_type_builder(name, physical).with_repetition(repetition);
        let (precision, scale) = match column {
            Column::Decimals(_) => (9, 3),
            Column::LongDecimals(_) => (18, 3),
            _ => (-1, -1),
        };
        Arc::new(
            field.with_logical_type(logical).with_precision(precision).with_scale(scale).build().unwrap(),
        )
    };
    let schema =
        Type::group_type_builder("trace").with_fields(columns.iter().map(field).collect()).build().unwrap();
    let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties)).unwrap();
    for start in (0..rows).step_by(7) {
        let part = start..(start + 7).min(rows);
        let mut group = writer.next_row_group().unwrap();
        let mut left = columns.iter();
        while let (Some(mut column), Some((_, values))) = (group.next_column().unwrap(), left.next()) {
            match values {
                Column::Doubles(values) => {
                    let values = &values[part.clone()];
                    let present: Vec<f64> = values.iter().flatten().copied().collect();
                    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
                    column.typed::<DoubleType>().write_batch(&present, Some(&levels), None).unwrap()
                }
                Column::Floats(values) => {
                    column.typed::<FloatType>().write_batch(&values[part.clone()], None, None).unwrap()
                }
                Column::Decimals(values) | Column::Whole(values) => {
                    column.typed::<Int32Type>().write_batch(&values[part.clone()], None, None).unwrap()
                }
                Column::LongDecimals(values) | Column::Stamps(_, values) => {
                    column.typed::<Int64Type>().write_batch(&values[part.clone()], None, None).unwrap()
                }
                Column::Stamps96(values) => {
                    column.typed::<Int96Type>().write_batch(&values[part.clone()], None, None).unwrap()
                }
                Column::Texts(values) => {
                    let texts: Vec<ByteArray> =
                        values[part.clone()].iter().map(|text| text.as_str().into()).collect();
                    column.typed::<ByteArrayType>().write_batch(&texts, None, None).unwrap()
                }
            };
            column.close().unwrap();
        }
        group.close().unwrap();
    }
    writer.into_inner().unwrap()
}

fn read(bytes: Vec<u8>) -> Result<Vec<Record>, TraceError> {
    let mut reader = TraceReader::from_stream("trace.parquet", Box::new(Cursor::new(bytes)), &Rig::paper())?;
    let (mut records, mut record) = (Vec::new(), Record::default());
    while reader.next_record(&mut record)? {
        records.push(record);
    }
    Ok(records)
}

const ROWS: usize = 30;

fn doubles(f: impl Fn(f64) -> f64) -> Column {
    Column::Doubles((0..ROWS).map(|i| Some(f(i as f64))).collect())
}

fn with_time(name: &'static str, time: Column) -> Vec<(&'static str, Column)> {
    vec![
        (name, time),
        ("note", Column::Texts(vec!["text".to_owned(); ROWS])),
        ("x_mm", Column::Whole((0..ROWS as i32).collect())),
        ("pa_bar", Column::Floats(vec![50.5; ROWS])),
        ("Pressure B [bar]", doubles(|_| 40.0)),
        ("qa_lpm", Column::Doubles((0..ROWS).map(|i| (i != 3).then_some(6.0)).collect())),
    ]
}

/// As of a file of text.
#[test]
fn a_column_value_is_called_as_its_file_is() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["x_mm", "pa_bar", "pb_bar"].map(|name| folder.path().join(name).with_extension("parquet"));
    for path in &paths {
        let columns = [("t_s", doubles(|i| 0.01 * i)), ("value", doubles(|_| 40.0))];
        std::fs::write(path, file(&columns, ROWS)).unwrap();
    }
    let mut reader = TraceReader::join(&paths, &Rig::paper()).unwrap();
    let mut record = Record::default();
    assert!(reader.next_record(&mut record).unwrap());
    let Sample { x_m, pa_pa, pb_pa, .. } = record.sample;
    assert!((x_m - 0.04).abs() < 1e-12 && (pa_pa - 4e6).abs() < 1e-3 && (pb_pa - 4e6).abs() < 1e-3);
}

#[test]
fn every_kind_of_time_and_number_is_read() {
    let ms = |i: usize| 1_763_676_631_500 + 10 * i as i64;
    let times = [
        ("t_s", doubles(|i| 0.01 * i)),
        ("t_ms", Column::Whole((0..ROWS as i32).map(|i| 10 * i).collect())),
        ("timestamp", Column::Stamps(TimeUnit::MILLIS, (0..ROWS).map(ms).collect())),
        ("time", Column::Stamps(TimeUnit::NANOS, (0..ROWS).map(|i| 1_000_000 * ms(i)).collect())),
        ("timestamp", doubles(|i| 1_763_676_631.5 + 0.01 * i)),
        (
            "timestamp",
            Column::Texts(
                (0..ROWS).map(|i| format!("2026-11-20 22:10:{:02}.{:02}", i / 10, 10 * (i % 10))).collect(),
            ),
        ),
    ];
    for (at, (name, time)) in times.into_iter().enumerate() {
        let step_s = if at == 5 { 0.1 } else { 0.01 };
        let records =
            read(file(&with_time(name, time), ROWS)).unwrap_or_else(|error| panic!("{at}: {error}"));
        assert_eq!(records.len(), ROWS);
        let last = &records[ROWS - 1];
        assert!((last.t_s - records[0].t_s - 29.0 * step_s).abs() < 1e-6, "{at}: {}", last.t_s);
        assert_eq!((last.sample.x_m, last.sample.pa_pa, last.sample.pb_pa), (0.029, 5_050_000.0, 4e6));
        assert_eq!((records[3].sample.qa_m3s, last.sample.qa_m3s, last.line), (None, Some(1e-4), 29));
    }
}

#[test]
fn every_compression_that_costs_no_build_is_read() {
    let plain = read(file_by(Compression::UNCOMPRESSED, &with_time("t_s", doubles(|i| i)), ROWS)).unwrap();
    let codecs = [Compression::SNAPPY, Compression::GZIP(GzipLevel::default()), Compression::LZ4_RAW];
    for codec in codecs {
        let bytes = file_by(codec, &with_time("t_s", doubles(|i| i)), ROWS);
        assert_eq!(read(bytes).unwrap(), plain, "{codec}");
    }
}

/// As polars writes them of itself, and pyarrow in pages of version 2, whose levels are not compressed.
const BY_ZSTD: [(&str, &[u8]); 2] = [
    ("polars", include_bytes!("../../../../../fuzz/seeds/parquet/polars.parquet")),
    ("pages of version 2", include_bytes!("../../../../../fuzz/seeds/parquet/arrow-pages-2.parquet")),
];

#[test]
fn zstd_is_read() {
    let plain = read(file_by(Compression::UNCOMPRESSED, &with_time("t_s", doubles(|i| i)), ROWS)).unwrap();
    for (writer, bytes) in BY_ZSTD {
        assert_eq!(read(bytes.to_vec()).unwrap(), plain, "{writer}");
    }
}

/// Decimals are whole numbers and how many decimals they have.
#[test]
fn decimals_are_numbers() {
    let trace = |x: Column, pa: Column| {
        vec![("t_s", doubles(|i| 0.01 * i)), ("x_mm", x), ("pa_bar", pa), ("pb_bar", doubles(|_| 40.0))]
    };
    let whole = trace(doubles(|i| 100.0 + 0.001 * i), doubles(|i| 50.0 - 0.25 * i));
    let decimals = trace(
        Column::Decimals((0..ROWS as i32).map(|i| 100_000 + i).collect()),
        Column::LongDecimals((0..ROWS as i64).map(|i| 50_000 - 250 * i).collect()),
    );
    let [expected, found] = [whole, decimals].map(|columns| read(file(&columns, ROWS)).unwrap());
    assert_eq!((found.len(), expected.len()), (ROWS, ROWS));
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found.sample.x_m - expected.sample.x_m).abs() < 1e-12);
        assert!((found.sample.pa_pa - expected.sample.pa_pa).abs() < 1e-6);
    }
}

/// What only old writers and Hadoop write costs more code than it has users: each says what to write instead.
#[test]
fn what_was_given_up_is_one_line_with_its_remedy() {
    let trace = || with_time("t_s", doubles(|i| i));
    let of_hadoop = read(file_by(Compression::LZ4, &trace(), ROWS)).unwrap_err().to_string();
    assert!(of_hadoop.contains("LZ4 as Hadoop frames it: write it with"), "{of_hadoop}");
    let deltas = WriterProperties::builder().set_dictionary_enabled(false);
    let deltas = deltas.set_column_encoding("timestamp".into(), Encoding::DELTA_BYTE_ARRAY);
    let texts = Column::Texts((0..ROWS).map(|i| format!("2026-11-20T22:10:{i:02}")).collect());
    let error =
        read(file_with(deltas.build(), &with_time("timestamp", texts), ROWS)).unwrap_err().to_string();
    assert!(error.contains("texts written as differences: write"), "{error}");
    let int96 = Column::Stamps96((0..ROWS).map(|_| Int96::new()).collect());
    let error = read(file(&with_time("timestamp", int96), ROWS)).unwrap_err().to_string();
    assert!(error.contains("INT96") && error.contains("TIMESTAMP_MICROS"), "{error}");
}

#[test]
fn what_is_no_trace_is_one_line() {
    let message = |bytes| read(bytes).unwrap_err().to_string();
    let texts = Column::Texts(vec!["0".to_owned(); ROWS]);
    assert!(message(file(&with_time("t_s", texts), ROWS)).contains("`t_s` does not hold numbers"));
    assert!(message(file(&with_time("clock", doubles(|i| i)), ROWS)).contains("no column for time"));
    assert!(message(file(&with_time("t_s", doubles(|i| i)), 0)).contains("only a header"));
    let whole = file(&with_time("t_s", doubles(|i| i)), ROWS);
    for length in [4, 8, 100, whole.len() / 2, whole.len() - 1] {
        assert!(message(whole[..length].to_vec()).contains("damaged"), "{length}");
    }
}

/// Files of few bytes that say more than there is: each once took gigabytes, minutes, or the process with it.
const FORGED: [(&[u8], &str); 7] = [
    (
        include_bytes!("../../../../../fuzz/seeds/parquet/forged-columns.parquet"),
        "fewer columns than it says",
    ),
    (
        include_bytes!("../../../../../fuzz/seeds/parquet/forged-dictionary.parquet"),
        "fewer values than it says",
    ),
    (include_bytes!("../../../../../fuzz/seeds/parquet/forged-footer-list.parquet"), "breaks off"),
    (include_bytes!("../../../../../fuzz/seeds/parquet/forged-footer-map.parquet"), "breaks off"),
    (include_bytes!("../../../../../fuzz/seeds/parquet/forged-page-list.parquet"), "breaks off"),
    (include_bytes!("../../../../../fuzz/seeds/parquet/forged-size-lz4.parquet"), "more than a gigabyte"),
    (include_bytes!("../../../../../fuzz/seeds/parquet/forged-size-snappy.parquet"), "more than a gigabyte"),
];

#[test]
fn forged_counts_and_sizes_are_refused() {
    for (bytes, words) in FORGED {
        let error = read(bytes.to_vec()).unwrap_err().to_string();
        assert!(error.contains("damaged") && error.contains(words), "{error} lacks {words}");
    }
}

/// It once ended in a stack overflow, which no guard holds.
#[test]
fn columns_within_columns_without_end_are_one_line() {
    let depth = 200_000_u32;
    // Version, and the list of the schema, whose length takes seven bits a byte.
    let mut footer = vec![0x15, 2, 0x19, 0xfc];
    footer.extend([depth as u8 | 0x80, (depth >> 7) as u8 | 0x80, (depth >> 14) as u8]);
    // Required, named g, with one member.
    (1..depth).for_each(|_| footer.extend([0x35, 0, 0x18, 1, b'g', 0x15, 2, 0]));
    // A double, required, named w; no rows, no groups of rows.
    footer.extend([0x15, 10, 0x25, 0, 0x18, 1, b'w', 0, 0x16, 0, 0x19, 0x0c, 0]);
    let length = (footer.len() as u32).to_le_bytes();
    let file = [b"PAR1", footer.as_slice(), &length, b"PAR1"].concat();
    let error = read(file).unwrap_err().to_string();
    assert!(error.contains("no column for time"), "{error}");
}

proptest::proptest! {
    #[test]
    fn any_byte_may_be_wrong(at in 0..100_000_usize, byte in 0..=255_u8) {
        let mut bytes = file(&with_time("t_s", doubles(|i| 0.01 * i)), ROWS);
        let at = at % bytes.len();
        bytes[at] = byte;
        if let Err(error) = read(bytes) {
            proptest::prop_assert!(!error.to_string().contains('\n'));
        }
    }

    #[test]
    fn any_byte_may_be_wrong_where_zstd_compresses(at in 0..100_000_usize, byte in 0..=255_u8) {
        for (_, bytes) in BY_ZSTD {
            let mut bytes = bytes.to_vec();
            let at = at % bytes.len();
            bytes[at] = byte;
            if let Err(error) = read(bytes) {
                proptest::prop_assert!(!error.to_string().contains('\n'));
            }
        }
    }
}
