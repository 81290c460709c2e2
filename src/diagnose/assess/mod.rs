//! The residual once a model is fitted, and what it says about the model: the answer in a word, and the sentences that speak for it.

mod adequacy;
mod confidence;
mod estimates;
mod holds;
mod next_measurement;
mod residual;

pub(crate) use adequacy::{failures, judge};
pub(crate) use estimates::{calibration, detection_limits, found, is_excited, leak_changes};
pub(crate) use holds::check as check_holds;
pub(crate) use next_measurement::next_measurement;
pub(crate) use residual::{HeldOut, model_fit};

use self::adequacy::Judgement;
use self::estimates::{negative_leaks, ratio_note};
use crate::diagnose::outcome::{FoundEffect, Interaction, LeakEstimates, ModelFit, Verdict};
use crate::diagnose::search::Selection;
use crate::diagnose::thresholds::MOST_ROUNDS;

/// The answer in a word. Effects explain the traces where each can be believed, nothing speaks against the model with them,
/// and no leak is impossible. One that evidently is speaks against a model without any.
pub(crate) fn verdict(judgement: &Judgement, effects: &[FoundEffect], leaks: &LeakEstimates) -> Verdict {
    let is_adequate = judgement.complaints.is_empty();
    let is_believed = effects.iter().all(|effect| effect.confident) && leaks.are_physical();
    match (effects.is_empty(), is_adequate) {
        (true, true) if !leaks.let_oil_in() => Verdict::NoMissingEffect,
        (true, _) => Verdict::Unexplained,
        (false, true) if is_believed => Verdict::Explained,
        (false, _) => Verdict::PartlyExplained,
    }
}

/// All sentences for people: `after` is none where no effect was named.
pub(crate) fn notes(
    Selection { fit, effects, .. }: &Selection<'_>,
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
    notes.extend(estimates::change_notes(fit));
    if !fit.has_converged() {
        notes.push(format!("the fit still moved after {MOST_ROUNDS} linearisations: estimates may be off by more than they say"));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::equation::PerEquation;
    use crate::diagnose::outcome::LeakEstimate;

    /// A model whose residual is noise, with an external leak A of so many standard deviations.
    fn told(sigma: f64, physical: bool) -> (Verdict, Vec<String>) {
        let of = |value: f64, physical| LeakEstimate {
            value,
            std: 1e-12,
            ci95: [value - 2e-12, value + 2e-12],
            unit: "m3/(s*Pa)",
            identifiable: true,
            physical,
        };
        let leaks = LeakEstimates {
            internal_leak_coefficient: of(3e-12, true),
            external_leak_a_coefficient: of(1e-12 * sigma, physical),
            external_leak_b_coefficient: of(0.0, true),
            bulk_modulus: of(8e8, true),
        };
        let judgement = Judgement {
            complaints: Vec::new(),
            failures: Vec::new(),
            left: PerEquation::default(),
            fell: PerEquation::default(),
            interactions: Vec::new(),
        };
        (verdict(&judgement, &[], &leaks), negative_leaks(&leaks, "the declared model"))
    }

    /// A residual that is noise is no proof beside a leak that lets oil in; and of one that does so for some time the mean says nothing.
    #[test]
    fn a_leak_that_lets_oil_in_is_evidence_of_a_missing_effect() {
        assert_eq!(told(1.0, true), (Verdict::NoMissingEffect, vec![]));
        let (verdict, notes) = told(-9.0, false);
        assert_eq!(verdict, Verdict::Unexplained);
        assert!(notes[0].contains("a negative external leak A (9 sigma below zero)"), "{notes:?}");
        let (verdict, notes) = told(2.0, false);
        assert_eq!(verdict, Verdict::NoMissingEffect);
        assert!(notes[0].contains("an external leak A that is below zero for some time"), "{notes:?}");
    }
}
