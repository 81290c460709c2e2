//! Parquet with Snappy, a row group at a time.

use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;
use std::io::{self, Write};
use std::sync::Arc;

/// A table being written.
pub(crate) struct ParquetWriter<W: Write + Send>(SerializedFileWriter<W>);

impl<W: Write + Send> ParquetWriter<W> {
    /// Begins the table `name` of these columns.
    pub fn begin(
        out: W,
        name: &str,
        columns: impl Iterator<Item = Result<Type, ParquetError>>,
    ) -> io::Result<Self> {
        let fields = columns.map(|column| column.map(Arc::new)).collect::<Result<Vec<_>, _>>();
        let schema = fields.and_then(|fields| Type::group_type_builder(name).with_fields(fields).build());
        let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let writer =
            schema.and_then(|schema| SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties)));
        writer.map(Self).map_err(cause)
    }

    /// Writes a row group, each of whose columns `fill` writes.
    pub fn group<C>(
        &mut self,
        columns: &[C],
        fill: impl Fn(&mut SerializedColumnWriter<'_>, &C) -> Result<(), ParquetError>,
    ) -> io::Result<()> {
        let mut written = || {
            let mut group = self.0.next_row_group()?;
            let mut columns = columns.iter();
            while let (Some(mut writer), Some(column)) = (group.next_column()?, columns.next()) {
                fill(&mut writer, column)?;
                writer.close()?;
            }
            group.close().map(|_| ())
        };
        written().map_err(cause)
    }

    /// Ends the table; what it was written to.
    pub fn finish(self) -> io::Result<W> {
        self.0.into_inner().map_err(cause)
    }
}

/// What the system says, where it does.
pub(crate) fn cause(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(source) => match source.downcast::<io::Error>() {
            Ok(source) => *source,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}
