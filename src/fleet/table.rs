//! A fleet's rows as columns, what CSV, Parquet and data frames hold, and as a file.

#[cfg(feature = "parquet")]
pub(super) use super::parquet_table::texts;

use super::{FleetError, FleetExplanation, FleetLeak, FleetRow};
use crate::output::{Inputs, OutputFile};
use jiff::Timestamp;
use pitchleak_core::{Leak, PerLeak};
use std::io;
use std::path::Path;

/// Columns of one length, each with its header.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetTable {
    rows: usize,
    columns: Vec<(String, FleetColumn)>,
}

/// The values of a column; none is an empty cell.
#[derive(Clone, Debug, PartialEq)]
pub enum FleetColumn {
    /// Texts; lists are joined by `, `.
    Texts(Vec<Option<String>>),
    /// Times.
    Times(Vec<Option<Timestamp>>),
    /// Numbers in the unit that the header ends in.
    Numbers(Vec<Option<f64>>),
    /// Counts.
    Counts(Vec<Option<u64>>),
    /// Yes or no.
    Flags(Vec<Option<bool>>),
}

impl FleetTable {
    /// The table of `rows`, one row each.
    pub fn of(rows: &[FleetRow]) -> Self {
        let judged = |row: &FleetRow| row.error.is_none();
        let texts = |text: &dyn Fn(&FleetRow) -> Option<String>| {
            FleetColumn::Texts(rows.iter().map(|row| text(row).filter(|text| !text.is_empty())).collect())
        };
        let counts = |count: fn(&FleetRow) -> u64| {
            FleetColumn::Counts(rows.iter().map(|row| judged(row).then(|| count(row))).collect())
        };
        let numbers = |number: fn(&FleetRow) -> Option<f64>| {
            FleetColumn::Numbers(rows.iter().map(|row| number(row).filter(|n| n.is_finite())).collect())
        };
        let faults = |row: &FleetRow| row.faults.iter().map(|leak| leak.id()).collect::<Vec<_>>().join(", ");
        let explanations = |row: &FleetRow| {
            row.explanations.iter().map(FleetExplanation::text).collect::<Vec<_>>().join(", ")
        };
        let mut columns: Vec<(String, FleetColumn)> = vec![
            ("cylinder".into(), texts(&|row| Some(row.cylinder.clone()))),
            ("path".into(), texts(&|row| Some(row.path.clone()))),
            ("begins".into(), FleetColumn::Times(rows.iter().map(|row| row.begins).collect())),
            ("rig".into(), texts(&|row| row.rig.clone())),
            ("status".into(), texts(&|row| row.status.map(|status| status.id().to_owned()))),
            ("faults".into(), texts(&|row| Some(faults(row)))),
            ("reasons".into(), texts(&|row| Some(row.reasons.join(", ")))),
        ];
        for leak in Leak::ALL {
            columns.extend(leak_columns(rows, leak));
        }
        columns.extend([
            ("explanations".to_owned(), texts(&|row| Some(explanations(row)))),
            ("alarms".to_owned(), counts(|row| row.alarms)),
            ("samples".to_owned(), counts(|row| row.samples)),
            ("skipped".to_owned(), counts(|row| row.skipped)),
            ("gaps".to_owned(), counts(|row| row.gaps)),
            ("duration_s".to_owned(), numbers(|row| row.duration_s)),
            ("sample_rate_hz".to_owned(), numbers(|row| row.sample_rate_hz)),
            ("warnings".to_owned(), texts(&|row| Some(row.warnings.join("; ")))),
            ("error".to_owned(), texts(&|row| row.error.clone())),
        ]);
        Self { rows: rows.len(), columns }
    }

    /// With one more column at its end; `values` are as many as the rows.
    #[must_use]
    pub(super) fn with_texts(mut self, name: &str, values: Vec<String>) -> Self {
        self.columns.push((name.to_owned(), FleetColumn::Texts(values.into_iter().map(Some).collect())));
        self
    }

    /// Headers and columns.
    pub fn columns(&self) -> &[(String, FleetColumn)] {
        &self.columns
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }
}

impl FleetColumn {
    /// A cell as text; numbers read back to the same.
    pub(super) fn cell(&self, row: usize) -> String {
        fn text<T: ToString>(values: &[Option<T>], row: usize) -> String {
            values.get(row).and_then(Option::as_ref).map_or_else(String::new, T::to_string)
        }
        match self {
            Self::Texts(values) => text(values, row),
            Self::Times(values) => text(values, row),
            Self::Numbers(values) => text(values, row),
            Self::Counts(values) => text(values, row),
            Self::Flags(values) => text(values, row),
        }
    }
}

fn leak_columns(rows: &[FleetRow], leak: Leak) -> Vec<(String, FleetColumn)> {
    let of = |row: &FleetRow| row.leaks.map(|leaks: PerLeak<FleetLeak>| leaks[leak]);
    let numbers = |number: &dyn Fn(FleetLeak) -> Option<f64>| {
        let values = rows.iter().map(|row| of(row).and_then(number).filter(|n| n.is_finite()));
        FleetColumn::Numbers(values.collect())
    };
    let identifiable = rows.iter().map(|row| of(row).map(|leak| leak.identifiable)).collect();
    let reached = |leak: FleetLeak| leak.trend?.reaches_threshold_in_s;
    [
        ("lpm", numbers(&|leak| Some(leak.mean_lpm))),
        ("std_lpm", numbers(&|leak| leak.std_lpm)),
        ("ci95_low_lpm", numbers(&|leak| leak.ci95.map(|[low, _]| low))),
        ("ci95_high_lpm", numbers(&|leak| leak.ci95.map(|[_, high]| high))),
        ("threshold_lpm", numbers(&|leak| Some(leak.threshold_lpm))),
        ("identifiable", FleetColumn::Flags(identifiable)),
        ("slope_lpm_per_h", numbers(&|leak| leak.trend.map(|trend| trend.slope_lpm_per_h))),
        ("slope_std_lpm_per_h", numbers(&|leak| leak.trend.map(|trend| trend.std))),
        ("reaches_threshold_in_s", numbers(&|leak| reached(leak).map(|time| time.value))),
        ("reaches_threshold_low_s", numbers(&|leak| reached(leak).map(|time| time.ci95[0]))),
        ("reaches_threshold_high_s", numbers(&|leak| reached(leak).map(|time| time.ci95[1]))),
    ]
    .map(|(name, column)| (format!("{}_{name}", leak.id()), column))
    .into()
}

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
            name if name.ends_with(".parquet") => super::parquet_table::write,
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
