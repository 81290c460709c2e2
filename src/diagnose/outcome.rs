//! What a diagnosis says, field by field as `diagnose --json` prints it.

use super::holds::Holds;
use super::residual::Residuals;
use serde::Serialize;
use std::collections::BTreeMap;

/// The answer in a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// With the effects named, what is left is sensor noise.
    Explained,
    /// The effects named mend much, but more than sensor noise is left.
    PartlyExplained,
    /// What the declared model leaves over is sensor noise.
    NoMissingEffect,
    /// Something is missing, and no known effect fits.
    Unexplained,
    /// Too little happens in these traces to tell.
    InsufficientExcitation,
}

/// One number per balance; none where the traces lack it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Rmse {
    /// Continuity of chamber A, m³/s.
    pub chamber_a_m3s: Option<f64>,
    /// Continuity of chamber B, m³/s.
    pub chamber_b_m3s: Option<f64>,
    /// Force balance, N.
    pub force_n: Option<f64>,
}

/// Probability per balance that what is left is white noise of the declared size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct WhitenessP {
    /// Chamber A.
    pub chamber_a: Option<f64>,
    /// Chamber B.
    pub chamber_b: Option<f64>,
    /// Forces.
    pub force: Option<f64>,
}

/// How well a model fits: on samples it did not see (`rmse`), and as noise (`whiteness_p`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quality {
    /// Root mean square of what is left, averaged over hats of 0.2 s, on held-out samples.
    pub rmse: Rmse,
    /// Portmanteau test.
    pub whiteness_p: WhitenessP,
}

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
    /// Whether the name can be believed: false while much is left that no effect explains.
    pub confident: bool,
    /// Why not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doubt: Option<&'static str>,
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
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub shape: BTreeMap<&'static str, f64>,
    /// When this is the cause.
    pub cause: &'static str,
    /// What to do about it.
    pub remedy: &'static str,
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

/// The same with the declared model alone and with the effects found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeaksBeforeAfter {
    /// Best fit of the declared model.
    pub before: LeakEstimates,
    /// With the effects.
    pub after: LeakEstimates,
}

/// What the declared model leaves over, and what is left with the effects found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResidualsBeforeAfter {
    /// Best fit of the declared model.
    pub before: Residuals,
    /// With the effects.
    pub after: Residuals,
}

/// A size with its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Size {
    /// In `unit`.
    pub value: f64,
    /// SI; 1 for a share.
    pub unit: &'static str,
}

/// What is left of each balance over time (s), averaged over hats of 0.2 s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residual {
    /// Chamber A, m³/s.
    pub chamber_a_m3s: Vec<(f64, f64)>,
    /// Chamber B, m³/s.
    pub chamber_b_m3s: Vec<(f64, f64)>,
    /// Forces, N.
    pub force_n: Vec<(f64, f64)>,
}

/// What is left against one variable: means in bins of equal count.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BinnedResidual {
    /// `chamber_a`, `chamber_b` or `force`.
    pub balance: &'static str,
    /// The variable.
    pub against: &'static str,
    /// Middle of each bin, SI.
    pub at: Vec<f64>,
    /// Mean of what is left there, SI.
    pub mean: Vec<f64>,
    /// Standard error of each mean, as if the hats were independent, SI.
    pub std_error: Vec<f64>,
    /// Correlation of the two.
    pub correlation: f64,
}

/// All that a diagnosis found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Version of this structure.
    pub schema: &'static str,
    /// Best fit of the declared model.
    pub before: Quality,
    /// Strongest first.
    pub effects: Vec<FoundEffect>,
    /// Pairs of these effects that act on each other.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub interactions: Vec<Interaction>,
    /// With the effects.
    pub after: Quality,
    /// Offsets and gains that the rig file declares possible, as found with the effects.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub calibration: Vec<Calibration>,
    /// Leaks before and after.
    pub leaks: LeaksBeforeAfter,
    /// Smallest size of each further effect that these traces would have shown at five standard deviations.
    pub not_detectable_below: BTreeMap<&'static str, Size>,
    /// The answer.
    pub verdict: Verdict,
    /// Sentences for people: what speaks for the verdict.
    pub notes: Vec<String>,
    /// Size of what is left as a multiple of the sensors' noise: chamber A, chamber B, force.
    pub excess: [f64; 3],
    /// Leaks while the piston stands, against those found in motion; none without such holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub holds: Option<Holds>,
    /// What is left of the fitted samples, whitened and tested.
    pub residuals: ResidualsBeforeAfter,
    /// What the declared model leaves over, against each variable.
    pub remainder_before: Vec<BinnedResidual>,
    /// What is left with the effects.
    pub remainder: Vec<BinnedResidual>,
    /// The same over time.
    #[serde(skip)]
    pub residual_before: Residual,
    /// The same over time.
    #[serde(skip)]
    pub residual: Residual,
}
