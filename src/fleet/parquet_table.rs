//! Parquet: one row group, Snappy, every column optional; and texts read back.

use crate::fleet::{FleetColumn, FleetTable};
use crate::output::OutputFile;
use crate::output::parquet::{ParquetWriter, cause};
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedColumnWriter;
use parquet::schema::types::Type;
use std::fs::File;
use std::io;

pub(super) fn write(table: &FleetTable, file: &mut OutputFile) -> io::Result<()> {
    let fields = table.columns().iter().map(|(name, column)| field(name, column));
    let mut writer = ParquetWriter::begin(file, "fleet", fields)?;
    writer.group(table.columns(), |writer, (_, column)| fill(writer, column))?;
    writer.finish().map(drop)
}

/// The columns of these names, a row each; one that is not there, or has no text, is empty.
pub(in crate::fleet) fn texts<const N: usize>(file: File, names: [&str; N]) -> io::Result<Vec<[String; N]>> {
    let reader = SerializedFileReader::new(file).map_err(cause)?;
    let rows = reader.get_row_iter(None).map_err(cause)?;
    let named = |row: parquet::record::Row| {
        names.map(|name| match row.get_column_iter().find(|(column, _)| *column == name) {
            Some((_, parquet::record::Field::Str(text))) => text.clone(),
            _ => String::new(),
        })
    };
    rows.map(|row| row.map(named).map_err(cause)).collect()
}

fn field(name: &str, column: &FleetColumn) -> Result<Type, ParquetError> {
    let utc_ms = LogicalType::timestamp(true, TimeUnit::MILLIS);
    let (physical, logical) = match column {
        FleetColumn::Texts(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        FleetColumn::Times(_) => (Physical::INT64, Some(utc_ms)),
        FleetColumn::Numbers(_) => (Physical::DOUBLE, None),
        FleetColumn::Counts(_) => (Physical::INT64, None),
        FleetColumn::Flags(_) => (Physical::BOOLEAN, None),
    };
    let field = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
    field.with_logical_type(logical).build()
}

fn fill(writer: &mut SerializedColumnWriter<'_>, column: &FleetColumn) -> Result<(), ParquetError> {
    match column {
        FleetColumn::Texts(values) => {
            put::<ByteArrayType, _>(writer, values, |text| ByteArray::from(text.as_str()))
        }
        FleetColumn::Times(values) => put::<Int64Type, _>(writer, values, |time| time.as_millisecond()),
        FleetColumn::Numbers(values) => put::<DoubleType, _>(writer, values, |number| *number),
        FleetColumn::Counts(values) => {
            put::<Int64Type, _>(writer, values, |count| i64::try_from(*count).unwrap_or(i64::MAX))
        }
        FleetColumn::Flags(values) => put::<BoolType, _>(writer, values, |flag| *flag),
    }
}

/// The values that are there, and for every row whether one is.
fn put<D: DataType, V>(
    writer: &mut SerializedColumnWriter<'_>,
    values: &[Option<V>],
    encode: impl Fn(&V) -> D::T,
) -> Result<(), ParquetError> {
    let present: Vec<D::T> = values.iter().flatten().map(encode).collect();
    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
    writer.typed::<D>().write_batch(&present, Some(&levels), None).map(|_| ())
}
