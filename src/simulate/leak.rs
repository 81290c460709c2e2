use crate::units::{self, Dimension, UnitError};
use pitchleak_core::PerLeak;

/// How large a simulated laminar leak is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LeakSize {
    /// Its mean flow over the run's first minute, m³/s. The coefficient follows from the run's own mean |P_L|, P_A
    /// or P_B.
    MeanFlow(f64),
    /// Its coefficient, m³/(s·Pa).
    Coefficient(f64),
}

impl Default for LeakSize {
    fn default() -> Self {
        Self::Coefficient(0.0)
    }
}

/// Why a text is no leak's size.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LeakSizeError {
    /// The quantity cannot be read.
    #[error("{0}; add `/bar` (or `/Pa`, `/MPa`) for a coefficient, e.g. \"0.02 L/min/bar\"")]
    Unit(#[from] UnitError),
    /// A leak does not flow backwards.
    #[error("a leak must not be negative")]
    Negative,
}

impl std::str::FromStr for LeakSize {
    type Err = LeakSizeError;

    /// A flow, as `0.5 L/min`, or a coefficient, as `0.02 L/min/bar`; a bare number is m³/s.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let per = |suffix: &str, pa: f64| Some((text.trim_end().strip_suffix(suffix)?, pa));
        let size = match per("/bar", 1e5).or(per("/MPa", 1e6)).or(per("/Pa", 1.0)) {
            Some((flow, pa)) => Self::Coefficient(units::parse(flow, Dimension::Flow)? / pa),
            None => Self::MeanFlow(units::parse(text, Dimension::Flow)?),
        };
        let (Self::MeanFlow(value) | Self::Coefficient(value)) = size;
        if value < 0.0 { Err(LeakSizeError::Negative) } else { Ok(size) }
    }
}

impl LeakSize {
    /// The coefficient at the mean driving pressure of a run, m³/(s·Pa); `None` where there is no
    /// pressure to drive the flow.
    fn coefficient(self, mean_pressure_pa: f64) -> Option<f64> {
        match self {
            Self::Coefficient(value) => Some(value),
            Self::MeanFlow(flow) => (mean_pressure_pa > 0.0).then(|| flow / mean_pressure_pa),
        }
    }
}

/// The coefficients of all leaks at mean |P_L|, P_A, P_B, m³/(s·Pa); `None` where one has no
/// pressure.
pub(super) fn coefficients(
    sizes: &PerLeak<LeakSize>,
    mean_pressures_pa: &PerLeak<f64>,
) -> Option<PerLeak<f64>> {
    sizes.zip(*mean_pressures_pa).map(|(size, pressure)| size.coefficient(pressure)).complete()
}

/// The next coefficients to try, from the last two pairs (tried, found at its pressures): each leak by
/// Wegstein's secant (1958, "Accelerating convergence of iterative processes"), on logarithms. A leak
/// takes pressure away but never more than in proportion, so the slope lies between 0 and 1; other
/// leaks that change at the same time may make it look otherwise.
pub(super) fn next_guess(
    last: Option<(PerLeak<f64>, PerLeak<f64>)>,
    (tried, found): (PerLeak<f64>, PerLeak<f64>),
) -> PerLeak<f64> {
    let Some((tried_last, found_last)) = last else { return found };
    tried.zip(found).zip(tried_last.zip(found_last)).map(|((c, g), (c_last, g_last))| {
        let slope = libm::log(g / g_last) / libm::log(c / c_last);
        if slope.is_finite() { c * libm::pow(g / c, 1.0 / (1.0 - slope.clamp(0.0, 0.8))) } else { g }
    })
}

/// Whether a leak is given by its flow, so that its coefficient has to be found.
pub(super) fn any_by_flow(sizes: &PerLeak<LeakSize>) -> bool {
    sizes.iter().any(|(_, size)| matches!(size, LeakSize::MeanFlow(flow) if *flow > 0.0))
}

/// Greatest relative difference between two sets of coefficients.
pub(super) fn differ(one: &PerLeak<f64>, other: &PerLeak<f64>) -> f64 {
    let relative = |(a, b): (f64, f64)| (a - b).abs() / a.abs().max(b.abs()).max(f64::MIN_POSITIVE);
    one.zip(*other).into_iter().map(|(_, pair)| relative(pair)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leak_is_a_flow_or_a_coefficient() {
        let size = |text: &str| text.parse::<LeakSize>();
        assert_eq!(size("6 L/min"), Ok(LeakSize::MeanFlow(1e-4)));
        assert_eq!(size("0.5e-5"), Ok(LeakSize::MeanFlow(5e-6)));
        let Ok(LeakSize::Coefficient(c)) = size("0.6 L/min/bar") else { panic!("a coefficient") };
        assert!((c - 1e-10).abs() < 1e-24, "1 m³/(s·Pa) is 6e9 L/min/bar");
        let Ok(LeakSize::Coefficient(c)) = size("3e-12 m^3/s/Pa") else { panic!("a coefficient") };
        assert!((c - 3e-12).abs() < 1e-26);
        assert_eq!(size("-1 L/min"), Err(LeakSizeError::Negative));
        assert!(size("1 L").is_err() && size("much").is_err());
    }
}
