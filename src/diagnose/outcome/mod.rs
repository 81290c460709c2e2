//! What a diagnosis says, in JSON too, and as a rig file.

use super::data::Series;
use super::equation::PerEquation;
use crate::Rig;
use crate::rig::EffectValue;
use crate::wiring::Wiring;
use pitchleak_core::effects::{EffectConstants, EffectKind};
use pitchleak_core::{Effect, Fluid};
use serde::Serialize;
use std::collections::BTreeMap;

mod effects;
mod json;
mod residual;

pub use effects::{
    Calibration, Doubt, DoubtId, FoundEffect, FoundLeakChange, HoldLeak, Holds, Interaction, LeakEstimate,
    LeakEstimates, NextMeasurement, Size,
};
pub use residual::{BinnedResidual, Correlation, EquationResidual};

/// The answer in a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// With the effects named the residual is sensor noise, each of them can be believed, and no leak is impossible.
    Explained,
    /// The effects named mend much, but more than sensor noise is left, one of them is doubtful, or a leak is impossible.
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
    /// Root mean square of the residual, averaged over test functions of 0.2 s, on held-out samples, m³/s and N; none
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
    /// The same over time: s, and m³/s or N, averaged over test functions of 0.2 s.
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
    /// What to measure next; none where no effect has a rival.
    pub next_measurement: Option<NextMeasurement>,
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
    /// Where a leak changes, if that explains the traces better than leaks that stay.
    pub leak_changes: Vec<FoundLeakChange>,
    /// Leaks while the piston stands, against those found in motion; none without such holds.
    pub holds: Option<Holds>,
}

impl Diagnosis {
    /// The rig file with the effects in it, so that replay and simulation use them; numbers of the cylinder are mended. The bulk
    /// modulus is that of the fit too: volumes and hoses are measured only as V/β.
    pub fn rig(&self, rig: &Rig) -> Rig {
        let mut with = rig.clone();
        if !self.effects.is_empty() {
            let bulk = &self.after.leaks.bulk_modulus;
            let relative = rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa;
            let std = bulk.std.min(relative * bulk.value);
            with.fluid = Fluid { bulk_modulus_pa: bulk.value, bulk_modulus_std_pa: std };
        }
        let sizes = self.calibration.iter().map(|c| (c.id, c.value, c.std, None));
        let sizes = sizes.chain(self.effects.iter().map(|e| (e.id, e.value, e.std, Some(&e.constants))));
        for (id, value, std, found) in sizes {
            let Ok(effect) = id.parse::<Effect>() else { continue };
            if effect.spec().kind == EffectKind::Cylinder
                && let Some(declared) = effect.adds_to(&mut with.cylinder)
            {
                *declared += value;
                continue;
            }
            let mut constants = EffectConstants::default();
            for own in effect.constants() {
                let value = found.and_then(|found| found.get(own.spec().id));
                constants = value.map_or(constants, |value| constants.with(*own, *value));
            }
            with.effects.insert(effect, EffectValue { value, std: Some(std), constants });
        }
        with
    }
}
