//! The effects named so far, and how one takes its place in the fit.

use super::candidates::Candidates;
use super::constants;
use super::trials::Trial;
use crate::diagnose::fit::{Fit, Progress};
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
    /// A product of signals without a name would have fitted better.
    pub(crate) beaten_by_nameless: bool,
}

#[cfg(test)]
impl Selected {
    /// An effect of which nothing is known but its place.
    pub(crate) fn unjudged(term: usize) -> Self {
        Self { term, p_value: 1.0, mended_percent: None, confusable_with: vec![], beaten_by_nameless: false }
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
    let is_usual = trial.constants == fit.problem.usual_constants;
    if is_usual { with } else { refine_constants(&with, term, progress) }
}

/// Fits the constants of a new effect again, now that what it leaves is no longer in the way.
fn refine_constants<'a>(fit: &Fit<'a>, term: usize, progress: Progress<'_>) -> Fit<'a> {
    let vacated = fit.vacated(term);
    let mut candidates = Candidates::of(&vacated);
    let starts = constants::first_scores(&mut candidates, &vacated.free, term);
    let first = starts.into_iter().max_by(|a, b| a.0.chi2_drop.total_cmp(&b.0.chi2_drop));
    let best = first.map(|first| constants::best_score(&mut candidates, &vacated.free, first));
    vacated.with(term, best.map_or(fit.constants(term), |(_, constants)| constants), progress)
}
