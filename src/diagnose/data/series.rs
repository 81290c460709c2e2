//! A trace as columns, cut into stretches without a gap.

use crate::trace::{Record, TraceError, TraceReader};
use pitchleak_core::Sample;

/// One trace in SI units. A flow or force is NaN where it was not measured: that balance rests there.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// How the trace is named in messages.
    pub name: String,
    /// Time, s, increasing.
    pub t_s: Vec<f64>,
    /// Piston position, m.
    pub x_m: Vec<f64>,
    /// Pressure of chamber A, Pa gauge.
    pub pa_pa: Vec<f64>,
    /// Pressure of chamber B, Pa gauge.
    pub pb_pa: Vec<f64>,
    /// Flow into chamber A, m³/s.
    pub qa_m3s: Vec<f64>,
    /// Flow into chamber B, m³/s.
    pub qb_m3s: Vec<f64>,
    /// Load force against extension, N.
    pub force_n: Vec<f64>,
    /// Oil temperature, K.
    pub temp_k: Vec<f64>,
}

/// A pause that cannot be mistaken for a step, s.
const GAP_S: f64 = 1e3;

impl Series {
    /// Adds one sample; what was not measured is `None`.
    pub fn push(&mut self, t_s: f64, sample: &Sample<f64>, temp_k: Option<f64>) {
        self.t_s.push(t_s);
        self.x_m.push(sample.x_m);
        self.pa_pa.push(sample.pa_pa);
        self.pb_pa.push(sample.pb_pa);
        self.qa_m3s.push(sample.qa_m3s.unwrap_or(f64::NAN));
        self.qb_m3s.push(sample.qb_m3s.unwrap_or(f64::NAN));
        self.force_n.push(sample.force_n.unwrap_or(f64::NAN));
        self.temp_k.push(temp_k.unwrap_or(f64::NAN));
    }

    /// Reads a whole trace.
    ///
    /// # Errors
    /// Those of [`TraceReader::next_record`].
    pub fn read(reader: &mut TraceReader<'_>) -> Result<Self, TraceError> {
        let mut series = Self { name: reader.name().to_owned(), ..Self::default() };
        let mut record = Record::default();
        // Time goes on over a restart of the clock, with a gap there.
        let mut t_s = 0.0;
        while reader.next_record(&mut record)? {
            t_s += if record.after_gap { record.dt_s.max(GAP_S) } else { record.dt_s };
            series.push(t_s, &record.sample, record.temperature_k);
        }
        Ok(series)
    }

    /// Means over so many neighbours that a step lasts at least `least_s`: the machine moves slower
    /// than that, and white noise falls with the root. A flow missing within is missing.
    pub(crate) fn thinned(&self, least_s: f64) -> (Self, usize) {
        let count = (least_s / self.step_s().max(1e-9) + 1e-6) as usize;
        if count < 2 {
            return (self.clone(), 1);
        }
        let mut thin = Self { name: self.name.clone(), ..Self::default() };
        for range in self.stretches() {
            for group in range.collect::<Vec<_>>().chunks_exact(count) {
                let mean = |values: &[f64]| group.iter().map(|i| values[*i]).sum::<f64>() / count as f64;
                let into = [
                    (&mut thin.t_s, &self.t_s),
                    (&mut thin.x_m, &self.x_m),
                    (&mut thin.pa_pa, &self.pa_pa),
                    (&mut thin.pb_pa, &self.pb_pa),
                    (&mut thin.qa_m3s, &self.qa_m3s),
                    (&mut thin.qb_m3s, &self.qb_m3s),
                    (&mut thin.force_n, &self.force_n),
                    (&mut thin.temp_k, &self.temp_k),
                ];
                into.into_iter().for_each(|(out, values)| out.push(mean(values)));
            }
        }
        (thin, count)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// The usual time between two samples, s; zero with fewer than two.
    pub fn step_s(&self) -> f64 {
        let mut steps: Vec<f64> = self.t_s.windows(2).map(|w| w[1] - w[0]).collect();
        let middle = steps.len() / 2;
        if steps.is_empty() { 0.0 } else { *steps.select_nth_unstable_by(middle, f64::total_cmp).1 }
    }

    /// Index ranges without a gap: neighbours are at most 1.5 usual steps apart.
    pub(crate) fn stretches(&self) -> Vec<std::ops::Range<usize>> {
        let longest = 1.5 * self.step_s();
        let mut start = 0;
        let mut found = Vec::new();
        for (at, pair) in self.t_s.windows(2).enumerate() {
            let step = pair[1] - pair[0];
            if step > longest || step <= 0.0 {
                found.push(start..at + 1);
                start = at + 1;
            }
        }
        found.push(start..self.len());
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_or_a_step_back_ends_a_stretch() {
        let mut series = Series::default();
        for t in [0.0, 0.1, 0.2, 0.5, 0.6, 0.55, 0.65] {
            series.push(t, &Sample::default(), None);
        }
        assert_eq!(series.stretches(), vec![0..3, 3..5, 5..7]);
    }
}
