use super::EstimateRow;
use crate::output::{Inputs, OutputError, OutputFile};
use std::io::Write;
use std::path::Path;

/// Error returned by [`EstimateFile`].
#[derive(Debug, thiserror::Error)]
pub enum EstimateFileError {
    /// Not a kind of file that estimates are written to.
    #[error("{0}: estimates over time are written as .csv or .csv.gz")]
    Kind(String),
    /// The file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A CSV file of estimates over time, a row per record: coefficients in m³/(s·Pa), flows in L/min at the
/// instant's pressures, active alarms as 1. It is there once it is [finished](Self::finish).
pub struct EstimateFile(OutputFile);

impl EstimateFile {
    /// Begins the file, `.csv` or `.csv.gz` by its name, which is none of `inputs`.
    ///
    /// # Errors
    /// Where it has another name, or cannot be written.
    pub fn create(path: impl AsRef<Path>, inputs: &Inputs) -> Result<Self, EstimateFileError> {
        let name = path.as_ref().display().to_string();
        if !name.ends_with(".csv") && !name.ends_with(".csv.gz") {
            return Err(EstimateFileError::Kind(name));
        }
        let mut created = Self(OutputFile::create(path, inputs)?);
        created.write_line(format_args!("{}", EstimateRow::COLUMNS.join(",")))?;
        Ok(created)
    }

    /// Writes one row.
    ///
    /// # Errors
    /// Where the file cannot be written on.
    pub fn write(&mut self, point: &EstimateRow) -> Result<(), EstimateFileError> {
        let [t_s, numbers @ .., internal, external_a, external_b] = point.values();
        let [a, b, c, d, e, f, g, h, i] = numbers;
        self.write_line(format_args!(
            "{t_s},{a:e},{b:e},{c:e},{d:e},{e:e},{f:e},{g:e},{h:e},{i:e},{internal},{external_a},{external_b}",
        ))
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// Where that fails: what was there before is there still.
    pub fn finish(self) -> Result<(), EstimateFileError> {
        Ok(self.0.finish()?)
    }

    fn write_line(&mut self, line: std::fmt::Arguments<'_>) -> Result<(), EstimateFileError> {
        writeln!(self.0, "{line}").map_err(|source| self.0.error(source).into())
    }
}
