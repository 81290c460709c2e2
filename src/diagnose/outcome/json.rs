//! A diagnosis as `diagnose --json` prints it, field by field: schema `pitchleak.diagnose/1`.

use super::{
    BinnedResidual, Calibration, Diagnosis, EquationResidual, FoundEffect, FoundLeakChange, Holds,
    Interaction, LeakEstimates, NextMeasurement, Quality, Samples, Size, Verdict,
};
use crate::diagnose::equation::PerEquation;
use crate::wiring::Wiring;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    samples: Samples,
    before: QualityFields<'a>,
    effects: &'a [FoundEffect],
    #[serde(skip_serializing_if = "Option::is_none")]
    next_measurement: Option<NextMeasurement>,
    wiring: Option<&'a Wiring>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    interactions: &'a [Interaction],
    after: QualityFields<'a>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    calibration: &'a [Calibration],
    leaks: BeforeAfter<&'a LeakEstimates>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    leak_changes: &'a [FoundLeakChange],
    not_detectable_below: &'a BTreeMap<&'static str, Size>,
    verdict: Verdict,
    notes: &'a [String],
    /// Chamber A, chamber B, force.
    excess: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    holds: Option<&'a Holds>,
    residuals: BeforeAfter<&'a PerEquation<Option<EquationResidual>>>,
    remainder_before: &'a [BinnedResidual],
    remainder: &'a [BinnedResidual],
}

#[derive(Serialize)]
struct BeforeAfter<T> {
    before: T,
    after: T,
}

#[derive(Serialize)]
struct QualityFields<'a> {
    rmse: BTreeMap<&'static str, Option<f64>>,
    whiteness_p: &'a PerEquation<Option<f64>>,
}

impl<'a> From<&'a Quality> for QualityFields<'a> {
    fn from(quality: &'a Quality) -> Self {
        let rmse = quality.rmse.iter().map(|(equation, value)| (equation.id_with_unit(), *value)).collect();
        Self { rmse, whiteness_p: &quality.whiteness_p }
    }
}

impl Serialize for Diagnosis {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { before, after, effects, interactions, calibration, .. } = self;
        let PerEquation { chamber_a, chamber_b, force } = after.noise_ratio;
        Document {
            schema: "pitchleak.diagnose/1",
            samples: self.samples,
            before: (&before.quality).into(),
            effects,
            next_measurement: self.next_measurement,
            wiring: self.wiring.as_ref(),
            interactions,
            after: (&after.quality).into(),
            calibration,
            leaks: BeforeAfter { before: &before.leaks, after: &after.leaks },
            leak_changes: &self.leak_changes,
            not_detectable_below: &self.not_detectable_below,
            verdict: self.verdict,
            notes: &self.notes,
            excess: [chamber_a, chamber_b, force],
            holds: self.holds.as_ref(),
            residuals: BeforeAfter { before: &before.residuals, after: &after.residuals },
            remainder_before: &before.binned_residuals,
            remainder: &after.binned_residuals,
        }
        .serialize(serializer)
    }
}
