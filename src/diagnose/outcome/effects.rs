//! What is said of effects and of leaks.

use crate::diagnose::thresholds::EVIDENT_SIGMA;
use pitchleak_core::Estimate;
use serde::Serialize;
use std::collections::BTreeMap;

/// An effect that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundEffect {
    /// Name as in the table of effects.
    pub id: &'static str,
    /// Its size and standard deviation in `unit`.
    pub value: f64,
    /// See `value`.
    pub std: f64,
    /// SI; 1 for a share.
    pub unit: &'static str,
    /// Probability of the name among all that could stand in its place: every other effect of the table and the laws that it does not
    /// list, each weighed by its likelihood and by the constants that were fitted to it. Halved where something else speaks against it.
    pub probability: f64,
    /// Whether the name can be believed, by itself: nothing speaks against it.
    pub confident: bool,
    /// The first of `doubts` in a sentence.
    pub doubt: Option<String>,
    /// Why not, the reason that says most first.
    pub doubts: Vec<Doubt>,
    /// By how much the held-out error of the balance it mends most falls when it is added.
    pub rmse_reduction_percent: f64,
    /// Chance of so large a score without the effect.
    pub p_value: f64,
    /// Effects that these traces cannot tell from it.
    pub confusable_with: Vec<&'static str>,
    /// The measurements that would tell them apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub separated_by: Option<String>,
    /// Constants in which the effect is not linear.
    #[serde(rename = "shape", skip_serializing_if = "BTreeMap::is_empty")]
    pub constants: BTreeMap<&'static str, f64>,
    /// When this is the cause.
    pub cause: &'static str,
    /// What to do about it.
    pub remedy: &'static str,
}

impl FoundEffect {
    /// All of its doubts in a sentence.
    pub fn doubts_in_words(&self) -> Option<String> {
        let texts: Vec<&str> = self.doubts.iter().map(|doubt| doubt.text.as_str()).collect();
        (!texts.is_empty()).then(|| texts.join("; "))
    }
}

/// A reason not to believe an effect's name or its value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Doubt {
    /// Which.
    pub id: DoubtId,
    /// For people.
    pub text: String,
}

/// What speaks against an effect's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum DoubtId {
    /// Other effects fit as well in its place.
    Rivals,
    /// A law that the table does not list fits as well or better.
    UnlistedLaw,
    /// The residual where it acts is not small beside what it explains.
    Residual,
    /// The residual where it acts goes with another effect, which is too weak for a name.
    WeakRival,
    /// It is as small as an error in the law of a larger effect of the same equation.
    SmallBesideOther,
    /// It is dry friction or a constant force, which together are dry friction that is larger one way.
    OneWayFriction,
    /// Its value is at the end of what is possible.
    AtBound,
    /// It would take away all that the rig file declares.
    TakesAllDeclared,
    /// Beside an effect too weak for a name it could be none.
    MayBeNone,
    /// With it a leak comes out below zero.
    NegativeLeak,
    /// The error on held-out samples did not fall where it acts.
    HeldOut,
    /// A sensor fails by itself.
    SensorFault,
    /// A doubtful effect of the same equation may have taken some of its share.
    DoubtfulNeighbour,
}

/// The one measurement that would settle most: whose answer is the least certain beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NextMeasurement {
    /// What to do.
    pub measurement: &'static str,
    /// The two explanations that it parts.
    pub between: [&'static str; 2],
    /// The probability that it finds the first of them.
    pub probability: f64,
}

/// Two effects that act on each other: the product of their terms explains more than chance would.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interaction {
    /// The two.
    pub effects: [&'static str; 2],
    /// Score of the product, in standard deviations.
    pub sigma: f64,
    /// Share of the whitened sum of squares that it would mend, percent.
    pub mended_percent: f64,
}

/// A sensor's error that the rig file declares possible, as these traces show it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// Name as in the table of effects.
    pub id: &'static str,
    /// Its size and standard deviation in `unit`.
    pub value: f64,
    /// See `value`.
    pub std: f64,
    /// SI; 1 for a share.
    pub unit: &'static str,
}

/// A leak that is another from a moment on: a part of the declared model, no effect.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FoundLeakChange {
    /// `internal`, `external_a` or `external_b`.
    pub fault: &'static str,
    /// In which of the traces, from 0.
    pub trace: usize,
    /// s since that began.
    pub time_s: f64,
    /// The coefficient before, m³/(s·Pa), …
    pub before: Estimate<f64>,
    /// … and after it.
    pub after: Estimate<f64>,
}

/// A size with its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Size {
    /// In `unit`.
    pub value: f64,
    /// SI; 1 for a share.
    pub unit: &'static str,
}

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

impl LeakEstimates {
    /// Whether physics allows all three leaks.
    pub fn are_physical(&self) -> bool {
        self.leaks().iter().all(|leak| leak.physical)
    }

    /// Whether a leak is below zero, for certain.
    pub(crate) fn let_oil_in(&self) -> bool {
        self.leaks().iter().any(|leak| leak.value < -EVIDENT_SIGMA * leak.std)
    }

    fn leaks(&self) -> [&LeakEstimate; 3] {
        [
            &self.internal_leak_coefficient,
            &self.external_leak_a_coefficient,
            &self.external_leak_b_coefficient,
        ]
    }
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
