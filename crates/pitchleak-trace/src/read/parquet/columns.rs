//! The columns of a Parquet file.

use super::footer::Footer;
use super::leaf::Leaf;
use super::pages::Pages;
use parquet::column::reader::{ColumnReader, get_column_reader};
use parquet::errors::{ParquetError, Result};
use parquet::file::reader::ChunkReader;
use std::sync::Arc;

/// A file of columns, on a disk or in memory.
pub(super) trait Columns: Send + Sync {
    fn leaves(&self) -> &[Leaf];

    /// How many groups of rows there are.
    fn groups(&self) -> usize;

    /// The column at `place` of a group of rows.
    fn read(&self, group: usize, place: usize) -> Result<ColumnReader>;
}

pub(super) fn open(bytes: impl ChunkReader + 'static) -> Result<Arc<dyn Columns>> {
    let footer = Footer::of(&bytes)?;
    Ok(Arc::new(InFile { bytes: Arc::new(bytes), footer }))
}

struct InFile<R> {
    bytes: Arc<R>,
    footer: Footer,
}

impl<R: ChunkReader + 'static> Columns for InFile<R> {
    fn leaves(&self) -> &[Leaf] {
        &self.footer.leaves
    }

    fn groups(&self) -> usize {
        self.footer.groups.len()
    }

    fn read(&self, group: usize, place: usize) -> Result<ColumnReader> {
        let chunk = self.footer.groups.get(group).and_then(|chunks| chunks.get(place));
        let (Some(chunk), Some(leaf)) = (chunk, self.footer.leaves.get(place)) else {
            return Err(ParquetError::General("a column that is not there".to_owned()));
        };
        let pages = Pages::of(Arc::clone(&self.bytes), *chunk, leaf.is_optional())?;
        Ok(get_column_reader(leaf.descriptor()?, Box::new(pages)))
    }
}
