//! What a diagnosis says.

mod effects;
mod leaks;
mod residual;

pub use effects::{Calibration, FoundEffect, Interaction, Size};
pub use leaks::{HoldLeak, Holds, LeakEstimate, LeakEstimates};
pub use residual::{BinnedResidual, Correlation, EquationResidual};

use super::data::Series;
use super::equation::PerEquation;
use crate::wiring::Wiring;
use serde::Serialize;
use std::collections::BTreeMap;

/// The answer in a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// With the effects named, the residual is sensor noise.
    Explained,
    /// The effects named explain much, but the residual is more than sensor noise.
    PartlyExplained,
    /// The residual of the declared model is sensor noise.
    NoMissingEffect,
    /// Something is missing, and no known effect fits.
    Unexplained,
    /// Too little happens in these traces to tell.
    InsufficientExcitation,
}

/// How well a model fits: on samples it did not see (`rmse`), and as noise (`whiteness_p`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quality {
    /// Root mean square of the residual, averaged over 0.2 s, on held-out samples, m³/s and N; none
    /// where the traces lack the equation.
    pub rmse: PerEquation<Option<f64>>,
    /// Probability that the residual is white noise of the declared size (portmanteau test).
    pub whiteness_p: PerEquation<Option<f64>>,
}

/// One model fitted to the traces: the declared one, or that with the effects found.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFit {
    /// How well it fits.
    pub quality: Quality,
    /// Leaks and bulk modulus.
    pub leaks: LeakEstimates,
    /// Size of the residual as a multiple of the sensors' noise.
    pub noise_ratio: PerEquation<f64>,
    /// The residual of the fitted samples, whitened and tested; none where the traces lack the equation.
    pub residuals: PerEquation<Option<EquationResidual>>,
    /// The residual of held-out samples against each variable.
    pub binned_residuals: Vec<BinnedResidual>,
    /// The residual of held-out samples over time: s, and m³/s or N, averaged over 0.2 s.
    pub residual_over_time: PerEquation<Vec<(f64, f64)>>,
}

/// How much of the traces was fitted: all, or pieces evenly over those that are too long.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Samples {
    /// Samples of the traces.
    pub read: u64,
    /// Those among them that were fitted.
    pub fitted: u64,
}

impl Samples {
    pub(super) fn of(traces: &[Series]) -> Self {
        let fitted = traces.iter().map(Series::held).sum();
        Self { read: fitted + traces.iter().map(|series| series.left_out).sum::<u64>(), fitted }
    }
}

/// All that a diagnosis found.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// How much was fitted.
    pub samples: Samples,
    /// Best fit of the declared model.
    pub before: ModelFit,
    /// With the effects.
    pub after: ModelFit,
    /// The effects, strongest first.
    pub effects: Vec<FoundEffect>,
    /// The mistake of wiring, sign or unit that explains the traces. Then no effect was looked for, unless the mistake
    /// is one that a sensor's lag or offset might have done.
    pub wiring: Option<Wiring>,
    /// Pairs of these effects that act on each other.
    pub interactions: Vec<Interaction>,
    /// Offsets and gains that the rig file declares possible, as found with the effects.
    pub calibration: Vec<Calibration>,
    /// Smallest size of each further effect that these traces would have shown at five standard deviations.
    pub not_detectable_below: BTreeMap<&'static str, Size>,
    /// The answer.
    pub verdict: Verdict,
    /// Sentences for people: what speaks for the verdict.
    pub notes: Vec<String>,
    /// Leaks while the piston stands, against those found in motion; none without such holds.
    pub holds: Option<Holds>,
}
