//! A fleet's table as a file.

use super::{FleetError, FleetTable};
use crate::output::{Inputs, OutputFile};
use std::io;
use std::path::Path;

#[cfg(feature = "parquet")]
mod parquet;

#[cfg(feature = "parquet")]
pub(super) use parquet::texts;

/// Reading back needs what writing does.
#[cfg(not(feature = "parquet"))]
pub(super) fn texts<const N: usize>(_: std::fs::File, _: [&str; N]) -> io::Result<Vec<[String; N]>> {
    Err(io::Error::other("Parquet needs a build with the cargo feature `parquet`"))
}

/// What a table is written as.
#[cfg(feature = "parquet")]
pub(super) const FORMATS: &str = ".parquet, .csv or .csv.gz";
/// What a table is written as.
#[cfg(not(feature = "parquet"))]
pub(super) const FORMATS: &str = ".csv or .csv.gz (.parquet needs the cargo feature `parquet`)";

/// A file for the table, `.csv`, `.csv.gz` or `.parquet` by its name. It is there once the table is
/// [written](Self::write).
pub struct FleetFile {
    file: OutputFile,
    format: fn(&FleetTable, &mut OutputFile) -> io::Result<()>,
}

impl FleetFile {
    /// Makes sure that the file can be written and is not one of `inputs`.
    ///
    /// # Errors
    /// Where its name says no format, or it cannot be written.
    pub fn create(path: &Path, inputs: &Inputs) -> Result<Self, FleetError> {
        let name = path.display().to_string();
        let format = match name.to_ascii_lowercase() {
            #[cfg(feature = "parquet")]
            name if name.ends_with(".parquet") => parquet::write,
            name if name.ends_with(".csv") || name.ends_with(".csv.gz") => write_csv,
            _ => return Err(FleetError::Kind(name)),
        };
        Ok(Self { file: OutputFile::create(path, inputs)?, format })
    }

    /// Writes the table and puts the file in its place.
    ///
    /// # Errors
    /// Where that fails: what was there before is there still.
    pub fn write(mut self, table: &FleetTable) -> Result<(), FleetError> {
        (self.format)(table, &mut self.file).map_err(|source| self.file.error(source))?;
        Ok(self.file.finish()?)
    }
}

fn write_csv(table: &FleetTable, file: &mut OutputFile) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(file);
    csv.write_record(table.columns().iter().map(|(name, _)| name))?;
    for row in 0..table.rows() {
        csv.write_record(table.columns().iter().map(|(_, column)| column.cell(row)))?;
    }
    csv.flush()
}
