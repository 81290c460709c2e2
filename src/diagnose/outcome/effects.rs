//! What is said of effects.

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
    /// Whether the name can be believed, by itself: no rival fits as well, the residual is small where it acts, no
    /// larger effect beside it could pass for it, and neither its value nor a leak beside it is impossible.
    pub confident: bool,
    /// Why not.
    pub doubt: Option<String>,
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

/// A size with its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Size {
    /// In `unit`.
    pub value: f64,
    /// SI; 1 for a share.
    pub unit: &'static str,
}
