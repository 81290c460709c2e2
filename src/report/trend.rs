use pitchleak_core::Estimate;
use serde::{Deserialize, Serialize};

/// How fast a leak changes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeakTrend {
    /// L/min per hour, positive where it grows.
    pub slope_lpm_per_h: f64,
    /// Standard deviation of its error, L/min per hour.
    pub std: f64,
    /// Time from the trace's end until the leak is at its alarm's threshold if it goes on like this; none where it is there
    /// already, or does not grow beyond doubt.
    pub reaches_threshold_in_s: Option<ReachTime>,
    /// The part of the slope that follows the oil's viscosity, and the rest; none without readings of the oil's temperature.
    pub oil: Option<OilShare>,
}

/// A slope in two parts, L/min per hour.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OilShare {
    /// What a leak of this size through a narrow gap gains as the oil thins (Hagen and Poiseuille): the oil's.
    pub with_viscosity: Slope,
    /// What is left: the seal's, or the connector's.
    pub beyond_viscosity: Slope,
}

/// Part of a trend.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slope {
    /// L/min per hour.
    pub slope_lpm_per_h: f64,
    /// Standard deviation of its error, L/min per hour.
    pub std: f64,
}

impl From<Estimate<f64>> for Slope {
    fn from(Estimate { value, std }: Estimate<f64>) -> Self {
        Self { slope_lpm_per_h: value, std }
    }
}

/// A time to come.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReachTime {
    /// Best value, s.
    pub value: f64,
    /// The interval that holds it with 95 % probability, s.
    pub ci95: [f64; 2],
}

const S_PER_H: f64 = 3600.0;

impl LeakTrend {
    /// The trend of a leak that is `flow_lpm` now and changes by `slope_lpm_ps` (L/min per s); none where the data don't
    /// tell: where neither the slope differs from none nor its interval is narrower than the threshold per hour.
    pub fn new(flow_lpm: Estimate<f64>, slope_lpm_ps: Estimate<f64>, threshold_lpm: f64) -> Option<Self> {
        let slope = slope_lpm_ps.scaled(S_PER_H);
        let told = is_significant(&slope) || slope.half_width95() < threshold_lpm;
        (told && slope.value.is_finite()).then(|| Self {
            slope_lpm_per_h: slope.value,
            std: slope.std,
            reaches_threshold_in_s: reach_time(flow_lpm, slope_lpm_ps, threshold_lpm),
            oil: None,
        })
    }

    /// The trend, told apart where the oil thins by `thinning_ps` (share of its viscosity per second) and the leak is
    /// `flow_lpm`.
    pub fn apart(self, flow_lpm: Estimate<f64>, thinning_ps: Estimate<f64>) -> Self {
        let per_h = thinning_ps.scaled(S_PER_H);
        let with = Estimate {
            value: flow_lpm.value * per_h.value,
            std: (flow_lpm.value * per_h.std).hypot(flow_lpm.std * per_h.value),
        };
        let beyond = Estimate { value: self.slope_lpm_per_h - with.value, std: self.std.hypot(with.std) };
        Self { oil: Some(OilShare { with_viscosity: with.into(), beyond_viscosity: beyond.into() }), ..self }
    }

    /// The slope with its spread, L/min per hour.
    pub fn slope(&self) -> Estimate<f64> {
        Estimate { value: self.slope_lpm_per_h, std: self.std }
    }

    /// Whether the leak changes at all, with 95 % probability.
    pub(crate) fn is_significant(&self) -> bool {
        is_significant(&self.slope())
    }
}

fn is_significant(slope: &Estimate<f64>) -> bool {
    slope.value.abs() > slope.half_width95()
}

/// (threshold − flow)/slope with the interval of a ratio (Fieller 1954, "Some problems in interval estimation", with level
/// and slope taken as independent).
fn reach_time(flow: Estimate<f64>, slope: Estimate<f64>, threshold: f64) -> Option<ReachTime> {
    let missing = threshold - flow.value;
    if missing <= 0.0 || slope.value <= 0.0 || !is_significant(&slope) {
        return None;
    }
    let square = slope.value.powi(2) - slope.half_width95().powi(2);
    let linear = missing * slope.value;
    let constant = missing.powi(2) - flow.half_width95().powi(2);
    let root = (linear * linear - square * constant).max(0.0).sqrt();
    let ci95 = [((linear - root) / square).max(0.0), (linear + root) / square];
    ci95.iter().all(|bound| bound.is_finite()).then_some(ReachTime { value: missing / slope.value, ci95 })
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Estimate<f64> = Estimate { value: 0.04, std: 0.001 };

    #[test]
    fn a_leak_that_grows_says_when_it_is_at_its_threshold() {
        let trend = LeakTrend::new(NOW, Estimate { value: 1e-4, std: 1e-5 }, 0.1).unwrap();
        assert!((trend.slope_lpm_per_h - 0.36).abs() < 1e-12 && (trend.std - 0.036).abs() < 1e-12);
        let time = trend.reaches_threshold_in_s.unwrap();
        assert!((time.value - 600.0).abs() < 1e-9);
        let [low, high] = time.ci95;
        assert!((480.0..505.0).contains(&low) && (740.0..760.0).contains(&high), "{low} to {high}");
    }

    #[test]
    fn warming_oil_has_its_part_of_a_trend() {
        let flow = Estimate { value: 0.5, std: 0.01 };
        let trend = LeakTrend::new(flow, Estimate { value: 1e-4, std: 1e-6 }, 0.1).unwrap();
        assert_eq!(trend.oil, None);
        let oil = trend.apart(flow, Estimate { value: 2e-4, std: 3e-5 }).oil.unwrap();
        assert!((oil.with_viscosity.slope_lpm_per_h - 0.36).abs() < 1e-12);
        assert!(oil.beyond_viscosity.slope_lpm_per_h.abs() < 1e-12);
        assert!(
            (oil.with_viscosity.std - 0.054).abs() < 1e-3
                && oil.beyond_viscosity.std > oil.with_viscosity.std
        );
    }

    #[test]
    fn what_the_data_do_not_tell_is_none() {
        assert_eq!(LeakTrend::new(NOW, Estimate { value: 1e-4, std: 1e-4 }, 0.1), None);
        let stays = LeakTrend::new(NOW, Estimate { value: 1e-7, std: 1e-6 }, 0.1).unwrap();
        assert!(!stays.is_significant() && stays.reaches_threshold_in_s.is_none());
        let above =
            LeakTrend::new(Estimate { value: 0.2, std: 0.01 }, Estimate { value: 1e-4, std: 1e-5 }, 0.1);
        assert_eq!(above.unwrap().reaches_threshold_in_s, None);
    }
}
