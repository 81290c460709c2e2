use crate::output::{Inputs, OutputError, OutputFile};
use crate::units::LPM_PER_M3S;
use pitchleak_core::{Estimate, Leak, PerLeak};
use std::io::Write;
use std::path::Path;

#[cfg(feature = "parquet")]
mod parquet;

/// The estimates after one record, for a file of estimates over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimateRow {
    /// Time in the trace, s.
    pub t_s: f64,
    /// Coefficients, m³/(s·Pa).
    pub coefficients: PerLeak<Estimate<f64>>,
    /// Leak flows at this instant's pressures, eq. (15), m³/s.
    pub flows_m3s: PerLeak<f64>,
    /// Active alarms.
    pub active: PerLeak<bool>,
}

impl EstimateRow {
    /// What [`values`](Self::values) are, as column headers: coefficients and their standard deviations in
    /// m³/(s·Pa), flows in L/min, active alarms as 1.
    pub const COLUMNS: [&str; 13] = [
        "t_s",
        "internal_leak_coefficient",
        "internal_leak_coefficient_std",
        "external_leak_a_coefficient",
        "external_leak_a_coefficient_std",
        "external_leak_b_coefficient",
        "external_leak_b_coefficient_std",
        "internal_leak_lpm",
        "external_leak_a_lpm",
        "external_leak_b_lpm",
        "internal_alarm",
        "external_a_alarm",
        "external_b_alarm",
    ];

    /// A row of [`COLUMNS`](Self::COLUMNS).
    pub fn values(&self) -> [f64; 13] {
        let coefficients = Leak::ALL
            .into_iter()
            .flat_map(|leak| [self.coefficients[leak].value, self.coefficients[leak].std]);
        let flows_lpm = Leak::ALL.map(|leak| self.flows_m3s[leak] * LPM_PER_M3S);
        let alarms = Leak::ALL.map(|leak| f64::from(u8::from(self.active[leak])));
        let mut all = [self.t_s].into_iter().chain(coefficients).chain(flows_lpm).chain(alarms);
        std::array::from_fn(|_| all.next().unwrap_or(f64::NAN))
    }
}

/// What estimates are written as.
#[cfg(feature = "parquet")]
const FORMATS: &str = ".csv, .csv.gz or .parquet";
/// What estimates are written as.
#[cfg(not(feature = "parquet"))]
const FORMATS: &str = ".csv or .csv.gz (.parquet needs the cargo feature `parquet`)";

/// Error returned by [`EstimateFile`].
#[derive(Debug, thiserror::Error)]
pub enum EstimateFileError {
    /// Not a kind of file that estimates are written to.
    #[error("{0}: estimates over time are written as {FORMATS}")]
    Kind(String),
    /// The file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A file of estimates over time, a row per record: coefficients in m³/(s·Pa), flows with those of the rig file's effects, in L/min at the
/// instant's pressures, active alarms as 1. It is there once it is [finished](Self::finish).
pub struct EstimateFile(Form);

enum Form {
    Csv(OutputFile),
    #[cfg(feature = "parquet")]
    Parquet(Box<parquet::ParquetFile>),
}

impl EstimateFile {
    /// Begins the file, `.csv`, `.csv.gz` or `.parquet` by its name, which is not one of `inputs`.
    ///
    /// # Errors
    /// Where it has another name, or cannot be written.
    pub fn create(path: impl AsRef<Path>, inputs: &Inputs) -> Result<Self, EstimateFileError> {
        let name = path.as_ref().display().to_string();
        #[cfg(feature = "parquet")]
        if name.ends_with(".parquet") {
            let file = OutputFile::create(path, inputs)?;
            return Ok(Self(Form::Parquet(Box::new(parquet::ParquetFile::begin(file, name)?))));
        }
        if !name.ends_with(".csv") && !name.ends_with(".csv.gz") {
            return Err(EstimateFileError::Kind(name));
        }
        let mut file = OutputFile::create(path, inputs)?;
        write_line(&mut file, format_args!("{}", EstimateRow::COLUMNS.join(",")))?;
        Ok(Self(Form::Csv(file)))
    }

    /// Writes one row.
    ///
    /// # Errors
    /// Where the file cannot be written on.
    pub fn write(&mut self, point: &EstimateRow) -> Result<(), EstimateFileError> {
        match &mut self.0 {
            Form::Csv(file) => write_row(file, point),
            #[cfg(feature = "parquet")]
            Form::Parquet(file) => file.write(&point.values()),
        }
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// Where that fails: what was there before is there still.
    pub fn finish(self) -> Result<(), EstimateFileError> {
        match self.0 {
            Form::Csv(file) => Ok(file.finish()?),
            #[cfg(feature = "parquet")]
            Form::Parquet(file) => file.finish(),
        }
    }
}

fn write_row(file: &mut OutputFile, point: &EstimateRow) -> Result<(), EstimateFileError> {
    let [t_s, numbers @ .., internal, external_a, external_b] = point.values();
    let numbers = numbers.map(|number| format!("{number:e}")).join(",");
    write_line(file, format_args!("{t_s},{numbers},{internal},{external_a},{external_b}"))
}

fn write_line(file: &mut OutputFile, line: std::fmt::Arguments<'_>) -> Result<(), EstimateFileError> {
    writeln!(file, "{line}").map_err(|source| file.error(source).into())
}
