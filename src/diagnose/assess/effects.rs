//! What is said of each effect.

use super::confidence;
use super::leaks::std_with_oil;
use super::verdict::Judgement;
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::{Calibration, Doubt, FoundEffect};
use crate::diagnose::search::{self, Selected, Selection};
use pitchleak_core::{Effect, Estimate};

/// The effects of the answer.
pub(crate) fn found(selection: &Selection<'_>, judgement: &Judgement) -> Vec<FoundEffect> {
    let told = |one: &Selected| {
        let doubts = confidence::doubts(selection, one, judgement);
        found_one(&selection.fit, one, doubts)
    };
    selection.effects.iter().filter_map(told).collect()
}

fn found_one(fit: &Fit<'_>, one: &Selected, doubts: Vec<Doubt>) -> Option<FoundEffect> {
    let effect = fit.problem.terms[one.term].effect()?;
    let Estimate { value, std } = fit.estimate(one.term)?;
    let std = std_with_oil(fit, one.term).unwrap_or(std);
    let std = std.hypot(search::std_of_constants(fit, one.term));
    let spec = effect.spec();
    let confusable_with: Vec<_> = one.confusable_with.iter().map(|other| other.spec().id).collect();
    let constants = fit.constants(one.term);
    let constants = effect.constants().iter().map(|own| (own.spec().id, constants.get(*own))).collect();
    Some(FoundEffect {
        id: spec.id,
        value,
        std: (std * fit.dispersion(fit.bounded.chi2).sqrt()).hypot(confidence::unnamed_shift(fit, one.term)),
        unit: spec.unit,
        probability: confidence::probability(one, &doubts),
        confident: doubts.is_empty(),
        doubt: doubts.first().map(|doubt| doubt.text.clone()),
        doubts,
        rmse_reduction_percent: one.mended_percent.unwrap_or(0.0),
        p_value: one.p_value,
        separated_by: separation(effect, &one.confusable_with),
        confusable_with,
        constants,
        cause: spec.cause,
        remedy: spec.remedy,
    })
}

/// The measurements that tell an effect from its rivals: what shows each of them alone.
fn separation(effect: Effect, rivals: &[Effect]) -> Option<String> {
    let group = std::iter::once(&effect).chain(rivals);
    let measurements: Vec<_> = group.map(|one| one.spec().measurement).collect();
    (!rivals.is_empty()).then(|| measurements.join(" "))
}

/// The sensors' errors that the rig file declares possible, as the fit has them.
pub(crate) fn calibration(fit: &Fit<'_>) -> Vec<Calibration> {
    let known = |term: &usize| {
        fit.problem.priors[*term]?;
        let (spec, own) = (fit.problem.terms[*term].effect()?.spec(), fit.estimate(*term)?);
        Some(Calibration { id: spec.id, value: own.value, std: own.std, unit: spec.unit })
    };
    fit.active().iter().filter_map(known).collect()
}
