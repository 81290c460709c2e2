//! Estimates over time as Parquet: doubles, a row group each 65,536 rows.

use super::{EstimateFileError, EstimateRow};
use crate::output::parquet::ParquetWriter;
use crate::output::{OutputError, OutputFile};
use parquet::basic::{Repetition, Type as Physical};
use parquet::data_type::DoubleType;
use parquet::schema::types::Type;
use std::io;

const COLUMNS: usize = EstimateRow::COLUMNS.len();
/// Rows held until they are written.
const GROUP: usize = 1 << 16;

pub(super) struct ParquetFile {
    name: String,
    writer: ParquetWriter<OutputFile>,
    columns: [Vec<f64>; COLUMNS],
}

impl ParquetFile {
    pub(super) fn begin(file: OutputFile, name: String) -> Result<Self, EstimateFileError> {
        let field = |name: &&str| {
            let field = Type::primitive_type_builder(name, Physical::DOUBLE);
            field.with_repetition(Repetition::REQUIRED).build()
        };
        let writer = ParquetWriter::begin(file, "estimates", EstimateRow::COLUMNS.iter().map(field));
        let writer = writer.map_err(|source| failed(&name, source))?;
        Ok(Self { name, writer, columns: std::array::from_fn(|_| Vec::new()) })
    }

    pub(super) fn write(&mut self, values: &[f64; COLUMNS]) -> Result<(), EstimateFileError> {
        self.columns.iter_mut().zip(values).for_each(|(column, value)| column.push(*value));
        let full = self.columns.first().is_some_and(|column| column.len() == GROUP);
        if full { self.write_group() } else { Ok(()) }
    }

    pub(super) fn finish(mut self) -> Result<(), EstimateFileError> {
        self.write_group()?;
        let file = self.writer.finish().map_err(|source| failed(&self.name, source))?;
        Ok(file.finish()?)
    }

    fn write_group(&mut self) -> Result<(), EstimateFileError> {
        let written = self.writer.group(&self.columns, |writer, column| {
            writer.typed::<DoubleType>().write_batch(column, None, None).map(|_| ())
        });
        self.columns.iter_mut().for_each(Vec::clear);
        written.map_err(|source| failed(&self.name, source))
    }
}

fn failed(name: &str, source: io::Error) -> EstimateFileError {
    OutputError::Write { path: name.into(), source }.into()
}
