//! The answer in a word, and the sentences that speak for it.

use super::adequacy::{Inadequacy, inadequacy};
use super::confidence::ratio_note;
use super::leaks::negative_leaks;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::{Interaction, ModelFit, Verdict};
use crate::diagnose::search::{self, Selection};
use crate::diagnose::thresholds::MOST_ROUNDS;

/// What the search makes of the traces.
pub(crate) struct Judgement {
    pub(crate) verdict: Verdict,
    /// What speaks against the model with the effects.
    pub(crate) complaints: Vec<String>,
    /// The complaints among them of sensors that fail by themselves.
    pub(crate) failures: Vec<String>,
    /// The residual of each equation beyond noise, as a part of the sum of squares.
    pub(crate) left: PerEquation<f64>,
    /// Where the effects together made the error on held-out samples smaller.
    pub(crate) fell: PerEquation<bool>,
    /// Pairs of effects that act on each other.
    pub(crate) interactions: Vec<Interaction>,
}

impl Judgement {
    /// What the strongest product of two effects would mend of the sum of squares, `beside` being none of them: their laws are wrong by that.
    pub(crate) fn mended_by_products(&self, fit: &Fit<'_>, beside: Option<&str>) -> f64 {
        let is_beside = |found: &&Interaction| !found.effects.iter().any(|id| Some(*id) == beside);
        let percents = self.interactions.iter().filter(is_beside).map(|found| found.mended_percent);
        percents.fold(0.0, f64::max) / 100.0 * fit.free.chi2
    }
}

/// Judges the model with the effects by its errors on held-out samples, `before` without them and `after`, and by what is
/// left, beside what is wrong with the sensors.
pub(crate) fn judge(
    selection: &Selection<'_>,
    excited: bool,
    failures: Vec<String>,
    [before, after]: [&ModelFit; 2],
) -> Judgement {
    let Selection { fit, effects } = selection;
    let Inadequacy { mut complaints, left } = inadequacy(fit);
    complaints.extend_from_slice(&failures);
    if effects.iter().any(|one| one.worse_than_product) {
        complaints.push("a product of signals without a name fits better than any known effect".to_owned());
    }
    let [before, after] = [before, after].map(|model| &model.quality.rmse);
    let fell = PerEquation::from_fn(|equation| after[equation] < before[equation]);
    if !effects.is_empty() && Equation::ALL.into_iter().all(|equation| !fell[equation]) {
        complaints.push("samples that were not fitted are met no better than without the effects".to_owned());
    }
    let verdict = match (excited, effects.is_empty(), complaints.is_empty()) {
        (false, ..) => Verdict::InsufficientExcitation,
        (true, true, true) => Verdict::NoMissingEffect,
        (true, true, false) => Verdict::Unexplained,
        (true, false, true) => Verdict::Explained,
        (true, false, false) => Verdict::PartlyExplained,
    };
    let interactions = search::interactions(fit, effects);
    Judgement { verdict, complaints, failures, left, fell, interactions }
}

/// All sentences for people: `after` is none where no effect was named.
pub(crate) fn notes(
    Selection { fit, effects }: &Selection<'_>,
    complaints: Vec<String>,
    before: &ModelFit,
    after: Option<&ModelFit>,
    interactions: &[Interaction],
) -> Vec<String> {
    let mut notes = complaints;
    notes.extend(negative_leaks(&before.leaks, "the declared model"));
    notes.extend(interactions.iter().map(|found| {
        let Interaction { effects: [one, other], sigma, mended_percent } = found;
        format!("{one} and {other} act on each other: the product of their terms shows at {sigma:.1} sigma and would mend {mended_percent:.1} %")
    }));
    let after = after.map(|after| negative_leaks(&after.leaks, "the model with the effects"));
    notes.extend(after.into_iter().flatten());
    notes.extend(effects.iter().filter_map(|one| ratio_note(fit, one)));
    if !fit.has_converged() {
        notes.push(format!("the fit still moved after {MOST_ROUNDS} linearisations: estimates may be off by more than they say"));
    }
    notes
}
