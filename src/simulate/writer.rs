use super::Truth;
use crate::units::LPM_PER_M3S;
use pitchleak_core::Sample;
use std::io::{self, Write};

/// The columns of a simulated trace, each fine enough that rounding stays below any sensor: 10 nm,
/// 1 Pa, 1e-6 L/min, 1 mN.
const HEADER: &str = "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm,force_n,q_int_lpm,q_ext_a_lpm,q_ext_b_lpm\n";

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
        out.write_all(HEADER.as_bytes())?;
        Ok(Self { out })
    }

    /// One row: the readings `shown`, and the leak flows of `truth`.
    ///
    /// # Errors
    /// Where the output cannot be written to.
    pub fn row(&mut self, truth: &Truth, shown: &Sample<f64>) -> io::Result<()> {
        let lpm = |flow_m3s: f64| flow_m3s * LPM_PER_M3S;
        let cell = |value: Option<f64>, decimals: usize| {
            value.map(|value| format!("{value:.decimals$}")).unwrap_or_default()
        };
        let leaks = truth.leaks_m3s.map(lpm);
        writeln!(
            self.out,
            "{},{:.5},{:.5},{:.5},{},{},{},{:.6},{:.6},{:.6}",
            // Sample times are shares of a second: rounding to 1 ns shows them as they are.
            (truth.t_s * 1e9).round() / 1e9,
            shown.x_m * 1e3,
            shown.pa_pa / 1e5,
            shown.pb_pa / 1e5,
            cell(shown.qa_m3s.map(lpm), 6),
            cell(shown.qb_m3s.map(lpm), 6),
            cell(shown.force_n, 3),
            leaks.internal,
            leaks.external_a,
            leaks.external_b,
        )
    }

    /// The output, to be finished by the caller.
    pub fn into_inner(self) -> W {
        self.out
    }
}
