//! A trace as columns, cut into stretches without a gap.

use crate::channels::ChannelMonitor;
use crate::diagnose::thresholds::LONG_STEP;
use crate::rig::ColumnMap;
use crate::trace::{Record, TraceError, TraceReader};
use pitchleak_core::Sample;
use std::ops::Range;

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
    /// The columns of the file, as they were read; empty where there is none.
    pub columns: ColumnMap,
    /// Further samples of the recording in each one, which is their mean: none in the recording itself.
    pub merged: usize,
    /// Samples of the recording that are not held here.
    pub left_out: u64,
    /// What each channel shows by itself, of all samples that were recorded.
    pub channels: ChannelMonitor,
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
        self.channels.add(&Record { t_s, sample: *sample, ..Record::default() });
    }

    /// Reads a whole trace.
    ///
    /// # Errors
    /// Those of [`TraceReader::next_record`].
    pub fn read(reader: &mut TraceReader<'_>) -> Result<Self, TraceError> {
        let mut series = Self { name: reader.name().to_owned(), ..Self::default() };
        let mut record = Record::default();
        let mut t_s = 0.0;
        while reader.next_record(&mut record)? {
            t_s += Self::step_to(&record);
            series.push(t_s, &record.sample, record.temperature_k);
        }
        Ok(series)
    }

    /// Time from the record before, s: it goes on over a restart of the clock, with a gap there.
    pub(super) fn step_to(record: &Record) -> f64 {
        if record.after_gap { record.dt_s.max(GAP_S) } else { record.dt_s }
    }

    /// The samples as records.
    pub(super) fn records(&self) -> impl Iterator<Item = Record> + '_ {
        let read = |value: f64| value.is_finite().then_some(value);
        let longest = LONG_STEP * self.step_s();
        (0..self.len()).map(move |at| {
            let dt_s = if at == 0 { 0.0 } else { self.t_s[at] - self.t_s[at - 1] };
            let sample = Sample {
                x_m: self.x_m[at],
                pa_pa: self.pa_pa[at],
                pb_pa: self.pb_pa[at],
                qa_m3s: read(self.qa_m3s[at]),
                qb_m3s: read(self.qb_m3s[at]),
                force_n: read(self.force_n[at]),
            };
            let after_gap = at == 0 || !(dt_s > 0.0 && dt_s <= longest);
            Record { t_s: self.t_s[at], dt_s, after_gap, sample, ..Record::default() }
        })
    }

    /// Neighbours whose mean lasts `least_s`.
    pub(super) fn samples_per(&self, least_s: f64) -> usize {
        (least_s / self.step_s().max(1e-9) + 1e-6) as usize
    }

    /// Means over `count` neighbours: where these are faster than the machine, nothing but white noise is lost. A flow
    /// missing within is missing.
    pub(super) fn thinned(&self, count: usize) -> Self {
        if count < 2 {
            return self.clone();
        }
        let mut thin = Self { merged: (self.merged + 1) * count - 1, ..self.like() };
        for stretch in self.stretches() {
            for start in stretch.clone().step_by(count) {
                let group = start..start + count;
                if group.end <= stretch.end {
                    let mean = |values: &[f64]| values.iter().sum::<f64>() / count as f64;
                    thin.append(self, group, |out, values| out.push(mean(values)));
                }
            }
        }
        thin
    }

    /// A series without samples of the same trace.
    pub(super) fn like(&self) -> Self {
        let (name, columns) = (self.name.clone(), self.columns.clone());
        let channels = self.channels.clone();
        Self { name, columns, merged: self.merged, left_out: self.left_out, channels, ..Self::default() }
    }

    /// Adds all samples of `more`.
    pub(super) fn extend(&mut self, more: &Self) {
        self.merged = self.merged.min(more.merged);
        self.append(more, 0..more.len(), |out, values| out.extend_from_slice(values));
    }

    /// Adds what `add` makes of each column's samples in `range`.
    fn append(&mut self, from: &Self, range: Range<usize>, add: impl Fn(&mut Vec<f64>, &[f64])) {
        let into = [
            (&mut self.t_s, &from.t_s),
            (&mut self.x_m, &from.x_m),
            (&mut self.pa_pa, &from.pa_pa),
            (&mut self.pb_pa, &from.pb_pa),
            (&mut self.qa_m3s, &from.qa_m3s),
            (&mut self.qb_m3s, &from.qb_m3s),
            (&mut self.force_n, &from.force_n),
            (&mut self.temp_k, &from.temp_k),
        ];
        into.into_iter().for_each(|(out, values)| add(out, &values[range.clone()]));
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Samples of the recording that are held, each or as a mean.
    pub fn held(&self) -> u64 {
        self.len() as u64 * (self.merged as u64 + 1)
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
        let longest = LONG_STEP * self.step_s();
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
