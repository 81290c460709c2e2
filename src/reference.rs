//! What the emulator is asked to follow: piston position and load force over time.

use crate::curve::{Curve, CurveError};
use crate::units::{self, Dimension, Unit, UnitError};
use std::path::{Path, PathBuf};

/// Position and load references of the rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Piston position x, m.
    pub position_m: Curve,
    /// Load force F against extension, N.
    pub load_n: Curve,
    /// The wind behind them, m/s, where there is one.
    pub wind_mps: Option<Curve>,
    /// Share of the history whose position was held off the end stops.
    pub clipped_share: f64,
}

impl Reference {
    /// Position and load that never change.
    pub fn constant(position_m: f64, load_n: f64) -> Self {
        Self::of(Curve::constant(position_m), Curve::constant(load_n))
    }

    /// Position and load by their own curves.
    pub fn of(position_m: Curve, load_n: Curve) -> Self {
        Self { position_m, load_n, wind_mps: None, clipped_share: 0.0 }
    }

    /// First and last time between which any of the curves changes, s; `None` if all are constant.
    pub fn span_s(&self) -> Option<(f64, f64)> {
        let spans = [&self.position_m, &self.load_n].map(Curve::span_s).into_iter();
        spans.filter(|(start, end)| end > start).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }
}

/// Why a file gives no reference curve.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// The file cannot be read.
    #[error("{path}: {source}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What went wrong, with the line where it did.
        source: csv::Error,
    },
    /// A column is not there.
    #[error("{path}: has no column {signal} with one of the units {units}", path = path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The column, without its unit.
        signal: &'static str,
        /// The unit suffixes accepted.
        units: String,
    },
    /// A cell is not a number.
    #[error("{path}: line {line}, column {column}: not a number", path = path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Number of the column, from 1.
        column: usize,
    },
    /// The samples make no curve.
    #[error("{path}: {source}", path = path.display())]
    Curve {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        source: CurveError,
    },
    /// Neither a quantity nor a file.
    #[error("`{text}` is no file, and as a quantity: {error}")]
    Quantity {
        /// As given.
        text: String,
        /// Why it is no quantity.
        error: UnitError,
    },
}

/// A constant, as `100 mm`, or the curve in a file: see [`read_curve`].
///
/// # Errors
/// [`ReferenceError`].
pub fn constant_or_file(
    text: &str,
    signal: &'static str,
    measures: Dimension,
) -> Result<Curve, ReferenceError> {
    match units::parse(text, measures) {
        Ok(value) => Ok(Curve::constant(value)),
        Err(_) if Path::new(text).is_file() => read_curve(text.as_ref(), signal, measures),
        Err(error) => Err(ReferenceError::Quantity { text: text.into(), error }),
    }
}

/// Reads a reference from a CSV file with a header row, columns named as in traces: the time `t_s`
/// and `signal` with its unit, for instance `x_mm`.
///
/// # Errors
/// [`ReferenceError`] names file, line and column.
pub fn read_curve(path: &Path, signal: &'static str, measures: Dimension) -> Result<Curve, ReferenceError> {
    let read = |source| ReferenceError::Read { path: path.into(), source };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(read)?;
    let headers = reader.headers().map_err(read)?.clone();
    let find = |signal: &'static str, measures: Dimension| {
        let unit = |header: &str| measures.by_suffix(header.strip_prefix(signal)?.strip_prefix('_')?);
        let found = headers.iter().enumerate().find_map(|(index, header)| Some((index, unit(header)?)));
        found.ok_or_else(|| ReferenceError::Missing { path: path.into(), signal, units: measures.suffixes() })
    };
    let (time, value) = (find("t", Dimension::Time)?, find(signal, measures)?);
    let (mut t_s, mut values) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(read)?;
        let cell = |(index, unit): &(usize, Unit)| -> Result<f64, ReferenceError> {
            let number = record.get(*index).and_then(|text| text.parse().ok());
            number.map(|number| unit.to_si(number)).ok_or_else(|| ReferenceError::Cell {
                path: path.into(),
                line: record.position().map_or(0, csv::Position::line),
                column: index + 1,
            })
        };
        t_s.push(cell(&time)?);
        values.push(cell(&value)?);
    }
    Curve::through(&t_s, &values).map_err(|source| ReferenceError::Curve { path: path.into(), source })
}
