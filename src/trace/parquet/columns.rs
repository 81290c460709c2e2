//! The columns of a Parquet file.

use super::zstd::ZstdPages;
use parquet::basic::Compression;
use parquet::column::page::PageReader;
use parquet::column::reader::{ColumnReader, get_column_reader};
use parquet::errors::Result;
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader, RowGroupMetaData};
use parquet::file::reader::ChunkReader;
use parquet::file::serialized_reader::SerializedPageReader;
use parquet::schema::types::ColumnDescPtr;
use std::sync::Arc;

/// A file of columns, on a disk or in memory.
pub(super) trait Columns: Send + Sync {
    fn metadata(&self) -> &ParquetMetaData;

    /// The column at `place` of a group of rows.
    fn read(&self, group: usize, place: usize) -> Result<ColumnReader>;

    fn row_groups(&self) -> &[RowGroupMetaData] {
        self.metadata().row_groups()
    }

    fn described(&self) -> &[ColumnDescPtr] {
        self.metadata().file_metadata().schema_descr().columns()
    }
}

pub(super) fn open(bytes: impl ChunkReader + 'static) -> Result<Arc<dyn Columns>> {
    let metadata = ParquetMetaDataReader::new().parse_and_finish(&bytes)?;
    Ok(Arc::new(Pages { bytes: Arc::new(bytes), metadata }))
}

struct Pages<R> {
    bytes: Arc<R>,
    metadata: ParquetMetaData,
}

impl<R: ChunkReader + 'static> Columns for Pages<R> {
    fn metadata(&self) -> &ParquetMetaData {
        &self.metadata
    }

    fn read(&self, group: usize, place: usize) -> Result<ColumnReader> {
        let group = self.metadata.row_group(group);
        let (column, rows) = (group.column(place), usize::try_from(group.num_rows())?);
        let of = |column| SerializedPageReader::new(Arc::clone(&self.bytes), column, rows, None);
        let pages: Box<dyn PageReader> = match column.compression() {
            // Said to be plain, so that its pages come as they are.
            Compression::ZSTD(_) => {
                let plain = column.clone().into_builder().set_compression(Compression::UNCOMPRESSED);
                Box::new(ZstdPages(of(&plain.build()?)?))
            }
            _ => Box::new(of(column)?),
        };
        Ok(get_column_reader(column.column_descr_ptr(), pages))
    }
}
