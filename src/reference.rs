//! What the emulator is asked to follow: piston position and load force over time.

use crate::curve::{Curve, CurveError};
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

    /// Last time at which any of the curves still changes, s; `None` if all are constant.
    pub fn end_s(&self) -> Option<f64> {
        let ends = [&self.position_m, &self.load_n].map(Curve::span_s).into_iter();
        ends.filter(|(start, end)| end > start).map(|(_, end)| end).reduce(f64::max)
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
    #[error("{path}: has no column {column}", path = path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
    },
    /// A cell is not a number.
    #[error("{path}: line {line}, column {column}: not a number", path = path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Name of the column.
        column: String,
    },
    /// The samples make no curve.
    #[error("{path}: {source}", path = path.display())]
    Curve {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        source: CurveError,
    },
}

/// Reads the curve of `column` over `t_s` from a CSV file with a header row; values are taken times
/// `factor`, the unit of the column in SI.
///
/// # Errors
/// [`ReferenceError`] names file, line and column.
pub fn read_curve(path: &Path, column: &str, factor: f64) -> Result<Curve, ReferenceError> {
    let read = |source| ReferenceError::Read { path: path.into(), source };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(read)?;
    let headers = reader.headers().map_err(read)?.clone();
    let find = |name: &str| {
        headers
            .iter()
            .position(|h| h.eq_ignore_ascii_case(name))
            .map(|index| (index, name.to_owned()))
            .ok_or_else(|| ReferenceError::Missing { path: path.into(), column: name.into() })
    };
    let (time, value) = (find("t_s")?, find(column)?);
    let (mut t_s, mut values) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(read)?;
        let cell = |(index, column): &(usize, String)| -> Result<f64, ReferenceError> {
            record.get(*index).and_then(|text| text.parse().ok()).ok_or_else(|| ReferenceError::Cell {
                path: path.into(),
                line: record.position().map_or(0, csv::Position::line),
                column: column.clone(),
            })
        };
        t_s.push(cell(&time)?);
        values.push(factor * cell(&value)?);
    }
    Curve::through(&t_s, &values).map_err(|source| ReferenceError::Curve { path: path.into(), source })
}
