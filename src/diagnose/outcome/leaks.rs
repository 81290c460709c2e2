//! What is said of leaks.

use serde::Serialize;

/// An estimate with its spread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeakEstimate {
    /// Best value.
    pub value: f64,
    /// Standard deviation, widened where the remainder is more than sensor noise.
    pub std: f64,
    /// Holds the truth with 95 % probability.
    pub ci95: [f64; 2],
    /// SI.
    pub unit: &'static str,
    /// Whether these traces tell more than the rig file did.
    pub identifiable: bool,
    /// Whether physics allows the value: not more than three standard deviations below zero.
    pub physical: bool,
}

/// The declared model's constants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeakEstimates {
    /// C_ip.
    pub internal_leak_coefficient: LeakEstimate,
    /// C_epA.
    pub external_leak_a_coefficient: LeakEstimate,
    /// C_epB.
    pub external_leak_b_coefficient: LeakEstimate,
    /// β.
    pub bulk_modulus: LeakEstimate,
}

/// Leak flows at rest and as predicted from motion; none for a chamber that was never held under pressure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Holds {
    /// Out of chamber A.
    pub chamber_a: Option<HoldLeak>,
    /// Out of chamber B.
    pub chamber_b: Option<HoldLeak>,
}

/// Flow that leaves one chamber, to the outside or past the piston, while the piston stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HoldLeak {
    /// Holds of 1 s.
    pub count: usize,
    /// Mean pressure in them, Pa.
    pub mean_pressure_pa: f64,
    /// Mean leak flow, m³/s.
    pub leak_m3s: f64,
    /// Its standard deviation, m³/s: the larger of sensor noise and scatter between holds, and the declared bias
    /// and gain of the flow meter.
    pub std_m3s: f64,
    /// That flow as the declared model has it, fitted to the motion.
    pub predicted_before_m3s: f64,
    /// Its standard deviation, m³/s.
    pub predicted_before_std_m3s: f64,
    /// That flow as the model with the effects found has it.
    pub predicted_after_m3s: f64,
    /// Its standard deviation, m³/s.
    pub predicted_after_std_m3s: f64,
}

impl HoldLeak {
    /// How far flow at rest and prediction are apart in standard deviations, before and after.
    pub fn apart_sigma(&self) -> [f64; 2] {
        let apart = |value: f64, std: f64| (self.leak_m3s - value).abs() / self.std_m3s.hypot(std);
        [
            apart(self.predicted_before_m3s, self.predicted_before_std_m3s),
            apart(self.predicted_after_m3s, self.predicted_after_std_m3s),
        ]
    }
}
