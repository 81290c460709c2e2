//! Time per row of reading a trace: `cargo bench --bench reading --features parquet`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use parquet::basic::{Compression, Repetition, Type as Physical};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use pitchleak::Rig;
use pitchleak::trace::{Record, TraceError, TraceReader};
use std::fmt::Write;
use std::hint::black_box;
use std::io::Cursor;
use std::sync::Arc;

const ROWS: usize = 360_000;
const HEADER: [&str; 6] = ["t_s", "x_mm", "pa_bar", "pb_bar", "qa_lpm", "qb_lpm"];

/// An hour at 100 Hz, with as many digits as a logger gives.
fn row(k: usize) -> [f64; 6] {
    let t = k as f64 * 0.01;
    let noise = |place: u64| {
        let mixed = (k as u64 + place).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
        mixed as f64 / 1e8
    };
    let digits = |value: f64| (value * 1e5).round() / 1e5;
    [
        t,
        digits(100.0 + 40.0 * (0.9 * t).sin() + noise(1)),
        digits(60.0 + 10.0 * (1.3 * t).sin() + noise(2)),
        digits(40.0 + 8.0 * (0.7 * t).sin() + noise(3)),
        digits(2.7 * (0.9 * t).cos() + noise(4)),
        digits(-2.0 * (0.9 * t).cos() + noise(5)),
    ]
}

fn csv() -> Vec<u8> {
    let mut text = HEADER.join(",");
    for k in 0..ROWS {
        let [t, x, pa, pb, qa, qb] = row(k);
        let _ = write!(text, "\n{t:.2},{x:.5},{pa:.5},{pb:.5},{qa:.5},{qb:.5}");
    }
    (text + "\n").into_bytes()
}

fn parquet() -> Result<Vec<u8>, ParquetError> {
    let field = |name: &&str| {
        let field =
            Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::OPTIONAL);
        field.build().map(Arc::new)
    };
    let fields = HEADER.iter().map(field).collect::<Result<Vec<_>, _>>()?;
    let schema = Arc::new(Type::group_type_builder("trace").with_fields(fields).build()?);
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    let mut column = 0;
    while let Some(mut open) = group.next_column()? {
        let values: Vec<f64> = (0..ROWS).filter_map(|k| row(k).get(column).copied()).collect();
        open.typed::<DoubleType>().write_batch(&values, Some(&vec![1; ROWS]), None)?;
        open.close()?;
        column += 1;
    }
    group.close()?;
    writer.into_inner()
}

fn read(bytes: &[u8]) -> Result<u64, TraceError> {
    let stream = Box::new(Cursor::new(bytes.to_vec()));
    let mut reader = TraceReader::from_stream("trace", stream, &Rig::paper())?;
    let mut record = Record::default();
    while reader.next_record(&mut record)? {
        black_box(&record);
    }
    Ok(reader.quality().rows)
}

fn reading(c: &mut Criterion) {
    let plain = csv();
    let european: Vec<u8> = plain
        .iter()
        .map(|byte| match byte {
            b',' => b';',
            b'.' => b',',
            other => *other,
        })
        .collect();
    let Ok(parquet) = parquet() else { return };
    let mut group = c.benchmark_group("read");
    group.sample_size(10).throughput(Throughput::Elements(ROWS as u64));
    for (name, bytes) in
        [("csv", &plain), ("csv, semicolon and decimal comma", &european), ("parquet", &parquet)]
    {
        group.bench_function(name, |b| b.iter(|| read(bytes).is_ok_and(|rows| rows == ROWS as u64)));
    }
}

criterion_group!(benches, reading);
criterion_main!(benches);
