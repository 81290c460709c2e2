use super::Truth;
use crate::units::LPM_PER_M3S;
use pitchleak_core::Sample;
use std::io::{self, Write};

/// The columns of a simulated trace and their decimals: rounding stays below any sensor (10 nm, 1 Pa,
/// 1e-6 L/min, 1 mN). Times are shares of a second: rounding to 1 ns shows them as they are.
const COLUMNS: [(&str, usize); 10] = [
    ("t_s", 9),
    ("x_mm", 5),
    ("pa_bar", 5),
    ("pb_bar", 5),
    ("qa_lpm", 6),
    ("qb_lpm", 6),
    ("force_n", 3),
    ("q_int_lpm", 6),
    ("q_ext_a_lpm", 6),
    ("q_ext_b_lpm", 6),
];

/// One row: the readings `shown`, and the leak flows of `truth`, rounded; NaN where there is no reading.
pub(super) fn row(truth: &Truth, shown: &Sample<f64>) -> [f64; COLUMNS.len()] {
    let lpm = |flow_m3s: f64| flow_m3s * LPM_PER_M3S;
    let leaks = truth.leaks_m3s.map(lpm);
    let mut cells = [
        truth.t_s,
        shown.x_m * 1e3,
        shown.pa_pa / 1e5,
        shown.pb_pa / 1e5,
        shown.qa_m3s.map_or(f64::NAN, lpm),
        shown.qb_m3s.map_or(f64::NAN, lpm),
        shown.force_n.unwrap_or(f64::NAN),
        leaks.internal,
        leaks.external_a,
        leaks.external_b,
    ];
    for (cell, (_, decimals)) in cells.iter_mut().zip(COLUMNS) {
        // The double nearest to the decimal number: what a reader of its text gets.
        let scale = 10f64.powi(decimals as i32);
        *cell = (*cell * scale).round() / scale;
    }
    cells
}

/// A simulated trace in memory: header and values of each column, as a reader of its file has them.
pub type Columns = Vec<(&'static str, Vec<f64>)>;

/// The columns without a row.
pub(super) fn columns() -> Columns {
    COLUMNS.iter().map(|(header, _)| (*header, Vec::new())).collect()
}

/// Writes a trace as CSV with the reference leak columns.
pub struct TraceWriter<W> {
    out: W,
}

impl<W: Write> TraceWriter<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// Where `out` cannot be written to.
    pub fn new(mut out: W) -> io::Result<Self> {
        writeln!(out, "{}", COLUMNS.map(|(header, _)| header).join(","))?;
        Ok(Self { out })
    }

    /// One row: the readings `shown`, and the leak flows of `truth`.
    ///
    /// # Errors
    /// Where the output cannot be written to.
    pub fn row(&mut self, truth: &Truth, shown: &Sample<f64>) -> io::Result<()> {
        for (index, (value, (_, decimals))) in row(truth, shown).into_iter().zip(COLUMNS).enumerate() {
            let comma = if index > 0 { "," } else { "" };
            match index {
                _ if value.is_nan() => write!(self.out, "{comma}")?,
                0 => write!(self.out, "{value}")?,
                _ => write!(self.out, "{comma}{value:.decimals$}")?,
            }
        }
        writeln!(self.out)
    }

    /// The output, to be finished by the caller.
    pub fn into_inner(self) -> W {
        self.out
    }
}
