use crate::units::{self, Dimension, UnitError};
use pitchleak_core::{Leaks, PerLeak};

/// How large a simulated laminar leak is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LeakSize {
    /// Its mean flow over the run, m³/s. The coefficient follows from the run's own mean |P_L|, P_A
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

/// The coefficients of all leaks at mean |P_L|, P_A, P_B; `None` where one has no pressure.
pub(super) fn coefficients(
    sizes: &PerLeak<LeakSize>,
    mean_pressures_pa: &PerLeak<f64>,
) -> Option<Leaks<f64>> {
    let found = sizes.zip(*mean_pressures_pa).map(|(size, pressure)| size.coefficient(pressure));
    Some(Leaks {
        internal_m3spa: found.internal?,
        external_a_m3spa: found.external_a?,
        external_b_m3spa: found.external_b?,
    })
}

/// Whether a leak is given by its flow, so that its coefficient has to be found.
pub(super) fn any_by_flow(sizes: &PerLeak<LeakSize>) -> bool {
    let by_flow = |size| matches!(size, LeakSize::MeanFlow(flow) if flow > 0.0);
    by_flow(sizes.internal) || by_flow(sizes.external_a) || by_flow(sizes.external_b)
}

/// Greatest relative difference between two sets of coefficients.
pub(super) fn differ(one: &Leaks<f64>, other: &Leaks<f64>) -> f64 {
    let pairs = [
        (one.internal_m3spa, other.internal_m3spa),
        (one.external_a_m3spa, other.external_a_m3spa),
        (one.external_b_m3spa, other.external_b_m3spa),
    ];
    let relative = |(a, b): (f64, f64)| (a - b).abs() / a.abs().max(b.abs()).max(f64::MIN_POSITIVE);
    pairs.into_iter().map(relative).fold(0.0, f64::max)
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
