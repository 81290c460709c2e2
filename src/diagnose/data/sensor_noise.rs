//! The noise that the signals really carry, held against the data sheets.

use super::series::Series;
use crate::diagnose::thresholds::{NOISIER, RIPPLE_COLOUR};
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
    let check = |(name, declared_std, column): (_, _, Column)| {
        let found = fast_noise(traces.iter().map(column));
        SensorCheck { name, declared_std, found }
    };
    signals.map(check).into()
}

/// The declared noise, or what the traces really carry where that is more.
pub(crate) fn effective(declared: &Sensors<f64>, checks: &[SensorCheck]) -> Sensors<f64> {
    let found = |name: &str| {
        checks
            .iter()
            .filter(|c| c.name.starts_with(name) && c.is_noisier())
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
    /// Largest autocorrelation at lags 4 to 12 of the third difference, which is zero for white noise.
    pub(crate) colour: f64,
}

/// Autocovariance at lag 0 of the third difference (1, −3, 3, −1) of unit white noise.
const THIRD_DIFFERENCE_GAIN: f64 = 20.0;

/// Noise by third differences: what the machine does within three samples is smooth, so that only
/// noise (and ripple faster than that) is left. The middle size of all `signals` counts: a few jolts, as where
/// a valve switches, are motion and no noise.
pub(crate) fn fast_noise<'a>(signals: impl Iterator<Item = &'a [f64]>) -> FastNoise {
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
    fn a_ripple_is_coloured_and_a_smooth_signal_is_quiet() {
        let ripple: Vec<f64> = (0..2000).map(|i| (2.1 * f64::from(i)).sin()).collect();
        assert!(fast_noise(std::iter::once(ripple.as_slice())).colour > 0.9);
        let smooth: Vec<f64> = (0..2000).map(|i| (0.06 * f64::from(i)).sin()).collect();
        assert!(fast_noise(std::iter::once(smooth.as_slice())).std < 1e-4);
    }
}
