//! The effects named so far, and how one takes its place in the fit.

use super::candidates::Candidates;
use super::constants;
use super::trials::Trial;
use crate::diagnose::fit::{Fit, Progress};
use crate::diagnose::thresholds::{CONFUSABLE_CHI2, LEAST_CLIMB};
use crate::diagnose::weak_form::SignalProduct;
use pitchleak_core::Effect;

/// One effect of the answer, by its place among the problem's terms.
#[derive(Clone, Debug)]
pub(crate) struct Selected {
    pub(crate) term: usize,
    /// Chance of so large a score without the effect.
    pub(crate) p_value: f64,
    /// Fall of the held-out error when it was added, percent; none before that is known.
    pub(crate) mended_percent: Option<f64>,
    pub(crate) confusable_with: Vec<Effect>,
    /// A product of signals without a name that fits nearly as well in its place.
    pub(crate) like_product: Option<SignalProduct>,
    /// A product of signals without a name would have fitted better.
    pub(crate) worse_than_product: bool,
}

#[cfg(test)]
impl Selected {
    /// An effect of which nothing is known but its place.
    pub(crate) fn unjudged(term: usize) -> Self {
        Self {
            term,
            p_value: 1.0,
            mended_percent: None,
            confusable_with: vec![],
            like_product: None,
            worse_than_product: false,
        }
    }
}

/// The effects named so far and the fit with them.
pub(crate) struct Selection<'a> {
    pub(crate) fit: Fit<'a>,
    pub(crate) effects: Vec<Selected>,
}

impl<'a> Selection<'a> {
    /// No effect beside the declared model.
    pub(crate) fn none(declared: Fit<'a>) -> Self {
        Self { fit: declared, effects: vec![] }
    }

    /// Fits friction's constants again beside what has been named since: at the noise of an incomplete model any slip speed will do.
    pub(super) fn refine_friction(&mut self, progress: Progress<'_>) {
        for one in self.effects.iter().filter(|one| self.fit.problem.terms[one.term].in_force()) {
            if let Some(better) = with_better_constants(&self.fit, one.term, progress) {
                self.fit = better;
            }
        }
    }

    pub(super) fn drop_at(&mut self, at: usize, progress: Progress<'_>) {
        let gone = self.effects.remove(at);
        self.fit = self.fit.without(gone.term, progress);
    }
}

/// By how much the sum of squares rises without some of the effects.
pub(crate) fn loss(fit: &Fit<'_>, terms: &[usize]) -> f64 {
    fit.solve_without(terms).chi2 - fit.free.chi2
}

/// The fit with a candidate in the place of others, its constants fitted too.
pub(super) fn with<'a>(fit: &Fit<'a>, old: &[usize], trial: &Trial, progress: Progress<'_>) -> Fit<'a> {
    let term = trial.score.term;
    let with = fit.changed(old, &[(term, trial.constants)], progress);
    let is_usual = trial.constants == fit.problem.usual(term);
    if is_usual { with } else { with_better_constants(&with, term, progress).unwrap_or(with) }
}

/// The fit with an effect's constants fitted again, now that what it leaves is no longer in the way; none where they stay. The usual
/// ones are kept unless the traces speak against them.
fn with_better_constants<'a>(fit: &Fit<'a>, term: usize, progress: Progress<'_>) -> Option<Fit<'a>> {
    if !constants::are_fitted(fit, term) {
        return None;
    }
    let vacated = fit.vacated(term);
    let mut candidates = Candidates::of(&vacated);
    let present = vacated.score(&vacated.free, term).map_or(0.0, |own| own.chi2_drop);
    let starts = constants::first_scores(&mut candidates, &vacated.free, term);
    let first = starts.into_iter().max_by(|a, b| a.0.chi2_drop.total_cmp(&b.0.chi2_drop))?;
    let (best, found) = constants::best_score(&mut candidates, &vacated.free, first);
    let is_usual = fit.constants(term) == fit.problem.usual(term);
    let needed = if is_usual { CONFUSABLE_CHI2 } else { LEAST_CLIMB };
    let is_better = best.chi2_drop > present + needed * vacated.dispersion(fit.free.chi2);
    is_better.then(|| vacated.with(term, found, progress))
}
