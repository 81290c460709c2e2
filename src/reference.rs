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
    /// How it goes on after its end.
    pub after_end: AfterEnd,
}

/// How a reference goes on after its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AfterEnd {
    /// It keeps its last values.
    Held,
    /// It runs back to its beginning, then forth again: position and load stay continuous.
    Mirrored,
}

impl Reference {
    /// Position and load that never change.
    pub fn constant(position_m: f64, load_n: f64) -> Self {
        Self::of(Curve::constant(position_m), Curve::constant(load_n))
    }

    /// Position and load by their own curves.
    pub fn of(position_m: Curve, load_n: Curve) -> Self {
        Self { position_m, load_n, wind_mps: None, clipped_share: 0.0, after_end: AfterEnd::Held }
    }

    /// Position (m) and load (N) at a time; before its beginning it has its first values.
    pub fn at(&self, t_s: f64) -> (f64, f64) {
        let t_s = self.own_time_s(t_s);
        (self.position_m.at(t_s), self.load_n.at(t_s))
    }

    /// The time within the reference that stands for one after its end.
    fn own_time_s(&self, t_s: f64) -> f64 {
        match (self.after_end, self.span_s()) {
            (AfterEnd::Mirrored, Some((begin_s, end_s))) if t_s > end_s => {
                let length_s = end_s - begin_s;
                let phase_s = (t_s - begin_s).rem_euclid(2.0 * length_s);
                begin_s + phase_s.min(2.0 * length_s - phase_s)
            }
            _ => t_s,
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wind_runs_back_and_forth_without_a_jump() {
        let curve = |values: &[f64]| Curve::through(&[1.0, 2.0, 3.0], values).expect("a curve");
        let held = Reference::of(curve(&[0.0, 1.0, 4.0]), curve(&[5.0, 3.0, 2.0]));
        let mirrored = Reference { after_end: AfterEnd::Mirrored, ..held.clone() };
        assert_eq!((held.at(9.0), mirrored.at(0.0)), ((4.0, 2.0), (0.0, 5.0)));
        for (after, within) in [(3.5, 2.5), (4.0, 2.0), (5.0, 1.0), (5.5, 1.5), (7.0, 3.0), (7.25, 2.75)] {
            let (there, here) = (mirrored.at(after), mirrored.at(within));
            assert!((there.0 - here.0).abs() < 1e-12 && (there.1 - here.1).abs() < 1e-12, "{after} s");
        }
        for k in 0..2000 {
            let (before, after) = (mirrored.at(0.01 * f64::from(k)), mirrored.at(0.01 * f64::from(k + 1)));
            assert!((before.0 - after.0).abs() < 0.06 && (before.1 - after.1).abs() < 0.06, "step {k}");
        }
    }
}
