//! Trace files.

use crate::Motion;
use pitchleak_core::Sample;

/// Columns of the rows that [`row`] writes.
pub const HEADER: &str = "t_s,x_m,v_mps,pa_pa,pb_pa,qa_m3s,qb_m3s";

/// One row of a trace file. A resting flow leaves its cell empty.
pub fn row(t_s: f64, v_mps: f64, sample: &Sample<f64>) -> String {
    let Sample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, .. } = sample;
    let flow = |flow: &Option<f64>| flow.map_or_else(String::new, |flow| format!("{flow:.9e}"));
    format!("{t_s:.2},{x_m:.9},{v_mps:.9},{pa_pa:.3},{pb_pa:.3},{},{}", flow(qa_m3s), flow(qb_m3s))
}

impl Motion {
    /// The first `count` rows of a trace file at 100 Hz.
    pub fn rows(&self, count: u32) -> Vec<String> {
        let times = (0..count).map(|k| f64::from(k) * 0.01);
        times.map(|t| row(t, self.position_m.slope(t), &self.sample(t))).collect()
    }
}

/// A trace file of these rows.
pub fn file(rows: &[String]) -> String {
    format!("{HEADER}\n{}\n", rows.join("\n"))
}
