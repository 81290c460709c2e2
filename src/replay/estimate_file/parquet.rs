//! Estimates over time as Parquet: doubles, Snappy, a row group each 65,536 rows.

use super::{EstimateFileError, EstimateRow};
use crate::output::{OutputError, OutputFile};
use parquet::basic::{Compression, Repetition, Type as Physical};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::io;
use std::sync::Arc;

const COLUMNS: usize = EstimateRow::COLUMNS.len();
/// Rows held until they are written.
const GROUP: usize = 1 << 16;

pub(super) struct ParquetFile {
    name: String,
    writer: SerializedFileWriter<OutputFile>,
    columns: [Vec<f64>; COLUMNS],
}

impl ParquetFile {
    pub(super) fn begin(file: OutputFile, name: String) -> Result<Self, EstimateFileError> {
        let writer = writer(file).map_err(|error| failed(&name, error))?;
        Ok(Self { name, writer, columns: std::array::from_fn(|_| Vec::new()) })
    }

    pub(super) fn write(&mut self, values: &[f64; COLUMNS]) -> Result<(), EstimateFileError> {
        self.columns.iter_mut().zip(values).for_each(|(column, value)| column.push(*value));
        let full = self.columns.first().is_some_and(|column| column.len() == GROUP);
        if full { self.write_group() } else { Ok(()) }
    }

    pub(super) fn finish(mut self) -> Result<(), EstimateFileError> {
        self.write_group()?;
        let file = self.writer.into_inner().map_err(|error| failed(&self.name, error))?;
        Ok(file.finish()?)
    }

    fn write_group(&mut self) -> Result<(), EstimateFileError> {
        let written = write_group(&mut self.writer, &self.columns);
        self.columns.iter_mut().for_each(Vec::clear);
        written.map_err(|error| failed(&self.name, error))
    }
}

fn writer(file: OutputFile) -> Result<SerializedFileWriter<OutputFile>, ParquetError> {
    let field = |name: &&str| {
        let field =
            Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::REQUIRED);
        field.build().map(Arc::new)
    };
    let fields = EstimateRow::COLUMNS.iter().map(field).collect::<Result<Vec<_>, _>>()?;
    let schema = Arc::new(Type::group_type_builder("estimates").with_fields(fields).build()?);
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    SerializedFileWriter::new(file, schema, Arc::new(properties))
}

fn write_group(
    writer: &mut SerializedFileWriter<OutputFile>,
    columns: &[Vec<f64>; COLUMNS],
) -> Result<(), ParquetError> {
    let mut group = writer.next_row_group()?;
    let mut columns = columns.iter();
    while let (Some(mut writer), Some(column)) = (group.next_column()?, columns.next()) {
        writer.typed::<DoubleType>().write_batch(column, None, None)?;
        writer.close()?;
    }
    group.close().map(|_| ())
}

fn failed(name: &str, error: ParquetError) -> EstimateFileError {
    let source = match error {
        ParquetError::External(source) => match source.downcast::<io::Error>() {
            Ok(source) => *source,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    };
    EstimateFileError::Output(OutputError::Write { path: name.into(), source })
}
