//! A trace as columns, cut into stretches without a gap, and the noise that it really carries.

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
    pub(super) fn thinned(&self, least_s: f64) -> (Self, usize) {
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
    pub(super) fn stretches(&self) -> Vec<std::ops::Range<usize>> {
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

/// Standard deviation and colour of the part of a signal that changes from sample to sample.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FastNoise {
    /// As if it were white, in the signal's unit.
    pub(super) std: f64,
    /// Largest autocorrelation at lags 4 to 12 of the third difference, which is zero for white noise.
    pub(super) colour: f64,
}

/// Autocovariance at lag 0 of the third difference (1, −3, 3, −1) of unit white noise.
const THIRD_DIFFERENCE_GAIN: f64 = 20.0;

/// Noise by third differences: what the machine does within three samples is smooth, so that only
/// noise (and ripple faster than that) is left. The middle size of all `signals` counts: a few jolts, as where
/// a valve switches, are motion and no noise.
pub(super) fn fast_noise<'a>(signals: impl Iterator<Item = &'a [f64]>) -> FastNoise {
    const LAGS: std::ops::RangeInclusive<usize> = 4..=12;
    let mut power = 0.0;
    let mut sizes = Vec::new();
    let mut products = [0.0; 13];
    for signal in signals {
        let third: Vec<f64> =
            signal.windows(4).map(|w| w[3] - w[0] + 3.0 * (w[1] - w[2])).filter(|d| d.is_finite()).collect();
        power += third.iter().map(|d| d * d).sum::<f64>();
        for lag in LAGS {
            if let Some(later) = third.get(lag..) {
                products[lag] += third.iter().zip(later).map(|(a, b)| a * b).sum::<f64>();
            }
        }
        sizes.extend(third.into_iter().map(f64::abs));
    }
    let middle = sizes.len() / 2;
    if sizes.is_empty() || power <= 0.0 {
        return FastNoise::default();
    }
    let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    let colour = LAGS.map(|lag| (products[lag] / power).abs()).fold(0.0, f64::max);
    FastNoise { std: median / NORMAL_MEDIAN / THIRD_DIFFERENCE_GAIN.sqrt(), colour }
}

/// Median of the size of a standard normal number.
const NORMAL_MEDIAN: f64 = 0.674_489_750_196_082;

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

    #[test]
    fn a_ripple_is_coloured_and_a_smooth_signal_is_quiet() {
        let ripple: Vec<f64> = (0..2000).map(|i| (2.1 * f64::from(i)).sin()).collect();
        assert!(fast_noise(std::iter::once(ripple.as_slice())).colour > 0.9);
        let smooth: Vec<f64> = (0..2000).map(|i| (0.06 * f64::from(i)).sin()).collect();
        assert!(fast_noise(std::iter::once(smooth.as_slice())).std < 1e-4);
    }
}
