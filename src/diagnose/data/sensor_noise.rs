//! The noise that the signals really carry, held against the data sheets.

use super::series::Series;
use crate::diagnose::thresholds::{LEAST_STEP_S, NOISIER, RIPPLE_COLOUR};
use pitchleak_core::Sensors;

/// How the noise of one kind of sensor compares with its data sheet.
pub(crate) struct SensorCheck {
    pub(crate) name: &'static str,
    pub(crate) declared_std: f64,
    pub(crate) found: FastNoise,
}

impl SensorCheck {
    pub(crate) fn is_noisier(&self) -> bool {
        self.found.std > NOISIER * self.declared_std
    }

    pub(crate) fn is_ripple(&self) -> bool {
        self.is_noisier() && self.found.colour > RIPPLE_COLOUR
    }
}

/// Compares each signal's fast part with the data sheet.
pub(crate) fn check_sensors(traces: &[Series], declared: &Sensors<f64>) -> Vec<SensorCheck> {
    type Column = fn(&Series) -> &[f64];
    let signals: [(&'static str, f64, Column); 6] = [
        ("position", declared.position.noise_std, |s| &s.x_m),
        ("pressure a", declared.pressure.noise_std, |s| &s.pa_pa),
        ("pressure b", declared.pressure.noise_std, |s| &s.pb_pa),
        ("flow a", declared.flow_a.noise_std, |s| &s.qa_m3s),
        ("flow b", declared.flow_b.noise_std, |s| &s.qb_m3s),
        ("force", declared.force.noise_std, |s| &s.force_n),
    ];
    let order = difference_order(traces.iter().map(Series::step_s).fold(0.0, f64::max));
    let check = |(name, declared_std, column): (_, _, Column)| {
        let found = fast_noise(traces.iter().map(column), order);
        SensorCheck { name, declared_std, found }
    };
    signals.map(check).into()
}

/// The declared noise, or what the traces really carry where that is more and `counts`.
pub(crate) fn effective(
    declared: &Sensors<f64>,
    checks: &[SensorCheck],
    counts: impl Fn(&SensorCheck) -> bool,
) -> Sensors<f64> {
    let found = |name: &str| {
        checks
            .iter()
            .filter(|c| c.name.starts_with(name) && c.is_noisier() && counts(c))
            .map(|c| c.found.std)
            .fold(0.0, f64::max)
    };
    let mut sensors = *declared;
    for (spread, name) in [
        (&mut sensors.position, "position"),
        (&mut sensors.pressure, "pressure"),
        (&mut sensors.flow_a, "flow a"),
        (&mut sensors.flow_b, "flow b"),
        (&mut sensors.force, "force"),
    ] {
        spread.noise_std = spread.noise_std.max(found(name));
    }
    sensors
}

/// Standard deviation and colour of the part of a signal that changes from sample to sample.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FastNoise {
    /// As if it were white, in the signal's unit.
    pub(crate) std: f64,
    /// Largest autocorrelation of the differences at nine lags beyond their order, which is zero for white noise.
    pub(crate) colour: f64,
}

/// Third differences see no motion at 100 Hz; slower samples take sixth ones: of a wave of 1.4 Hz sampled at 20 Hz the third leave 2 %
/// beside the noise, the sixth 0.02 %.
fn difference_order(step_s: f64) -> usize {
    if step_s > 1.5 * LEAST_STEP_S { 6 } else { 3 }
}

/// Differences of an order, oldest first, and their standard deviation for unit white noise.
fn differences(signal: &[f64], order: usize) -> (Vec<f64>, f64) {
    let (mut out, mut gain) = (signal.to_vec(), 1.0);
    for k in 1..=order {
        out = out.windows(2).map(|w| w[1] - w[0]).collect();
        // The binomial coefficient of 2k over k.
        gain *= (4 * k - 2) as f64 / k as f64;
    }
    (out, gain.sqrt())
}

/// Noise by differences of high order: what the machine does within so few samples is smooth, so that only
/// noise (and ripple faster than that) is left. The middle size of all `signals` counts: a few jolts, as where
/// a valve switches, are motion and no noise.
pub(crate) fn fast_noise<'a>(signals: impl Iterator<Item = &'a [f64]>, order: usize) -> FastNoise {
    let lags = order + 1..=order + 9;
    let (mut power, mut gain) = (0.0, 1.0);
    let mut sizes = Vec::new();
    let mut products = vec![0.0; order + 10];
    for signal in signals {
        let (mut fast, of_white) = differences(signal, order);
        fast.retain(|d| d.is_finite());
        gain = of_white;
        power += fast.iter().map(|d| d * d).sum::<f64>();
        for lag in lags.clone() {
            if let Some(later) = fast.get(lag..) {
                products[lag] += fast.iter().zip(later).map(|(a, b)| a * b).sum::<f64>();
            }
        }
        sizes.extend(fast.into_iter().map(f64::abs));
    }
    let middle = sizes.len() / 2;
    if sizes.is_empty() || power <= 0.0 {
        return FastNoise::default();
    }
    let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    let colour = lags.map(|lag| (products[lag] / power).abs()).fold(0.0, f64::max);
    FastNoise { std: median / NORMAL_MEDIAN / gain, colour }
}

/// Median of the size of a standard normal number.
const NORMAL_MEDIAN: f64 = 0.674_489_750_196_082;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ripple_is_coloured_and_a_smooth_signal_is_quiet() {
        let ripple: Vec<f64> = (0..2000).map(|i| (2.1 * f64::from(i)).sin()).collect();
        assert!(fast_noise(std::iter::once(ripple.as_slice()), 3).colour > 0.9);
        let smooth: Vec<f64> = (0..2000).map(|i| (0.06 * f64::from(i)).sin()).collect();
        assert!(fast_noise(std::iter::once(smooth.as_slice()), 3).std < 1e-4);
    }
}
