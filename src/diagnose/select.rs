//! Which effect is missing: forward selection by the score test, with backward elimination, each
//! step confirmed on data that it did not fit.

use super::Progress;
use super::fit::Fit;
use super::regression::{FOLDS, Score};
use super::shape;
use super::term::Term;
use super::whiteness;
use pitchleak_core::Effect;
use pitchleak_core::effects::Shape;

/// Share of sound rigs on which the search may name anything, shared out over all candidates (Bonferroni).
const FALSE_EFFECT_RATE: f64 = 1e-3;
/// A shape fitted to the data counts as this many candidates.
const SHAPE_TRIALS: usize = 20;
/// Effects that one diagnosis names at most.
const MOST_EFFECTS: usize = 5;
/// While the remainder is larger than the noise, an effect must mend this share of it to be named.
const LEAST_MENDED_SHARE: f64 = 0.02;
/// A candidate below this share of the best is not worth a search for its shape.
const IN_THE_RUNNING: f64 = 0.4;
/// Candidates whose fit is this close (three standard deviations) cannot be told apart.
const CONFUSABLE_GAIN: f64 = 9.0;

/// One effect of the answer, as an index into the fit's terms.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub(super) term: usize,
    /// Chance of so large a score without the effect.
    pub(super) p_value: f64,
    pub(super) confusable_with: Vec<Effect>,
    /// A shape without a name would have fitted better.
    pub(super) outdone: bool,
}

/// Indices of the candidates that can be named.
pub(super) fn candidates(fit: &Fit<'_>) -> Vec<usize> {
    let open =
        |i: &usize| fit.terms[*i].effect().is_some() && !fit.active.contains(i) && fit.regression.shows(*i);
    (0..fit.terms.len()).filter(open).collect()
}

/// The size in σ that a candidate's score needs.
pub(super) fn critical_sigma(fit: &Fit<'_>, term: usize) -> f64 {
    let count = fit.terms.iter().filter(|term| term.effect().is_some()).count();
    let trials = if shape::is_fitted(fit, term) { SHAPE_TRIALS } else { 1 };
    whiteness::bonferroni_sigma(FALSE_EFFECT_RATE, count * trials)
}

/// Adds the next effect and fits again; none when nothing further is significant.
pub(super) fn add_next(fit: &mut Fit<'_>, progress: Progress<'_>) -> Option<Named> {
    let added =
        fit.active.iter().filter(|i| fit.priors[**i].is_none() && fit.terms[**i].effect().is_some()).count();
    if added >= MOST_EFFECTS {
        return None;
    }
    let mut scores: Vec<(Score, Shape<f64>)> =
        candidates(fit).into_iter().filter_map(|term| shape::first_score(fit, &fit.scoring, term)).collect();
    let best = scores.iter().map(|(score, _)| score.gain).fold(0.0, f64::max);
    for entry in scores.iter_mut().filter(|(score, _)| score.gain > IN_THE_RUNNING * best) {
        *entry = shape::best_score(fit, entry.0.term, *entry);
    }
    scores.sort_by(|a, b| b.0.gain.total_cmp(&a.0.gain));
    let nameless = nameless_gain(fit);
    for (score, shape) in scores {
        let dispersion = fit.dispersion(fit.scoring.chi2 - score.gain);
        let significance = score.gain / dispersion;
        if significance < critical_sigma(fit, score.term).powi(2) {
            continue;
        }
        let mended = score.gain / fit.scoring.chi2;
        if fit.is_incomplete() && mended < LEAST_MENDED_SHARE {
            continue;
        }
        fit.reshape(score.term, shape);
        if !holds_out(fit, &score) {
            continue;
        }
        let outdone = nameless > score.gain + CONFUSABLE_GAIN * dispersion;
        fit.active.push(score.term);
        fit.refit(progress);
        polish(fit, score.term, progress);
        let p_value = whiteness::chi2_p(significance, 1.0);
        return Some(Named { term: score.term, p_value, confusable_with: vec![], outdone });
    }
    None
}

/// Fits the constants of a new effect again, now that what it leaves is no longer in the way.
fn polish(fit: &mut Fit<'_>, term: usize, progress: Progress<'_>) {
    if !shape::is_fitted(fit, term) {
        return;
    }
    fit.set_aside(term, progress);
    if let Some(first) = shape::first_score(fit, &fit.scoring, term) {
        let (_, shape) = shape::best_score(fit, term, first);
        fit.reshape(term, shape);
    }
    fit.active.push(term);
    fit.refit(progress);
}

/// Whether the effect also helps where it was not fitted.
fn holds_out(fit: &Fit<'_>, score: &Score) -> bool {
    let priors = fit.increments();
    let mut with = fit.active.clone();
    with.push(score.term);
    let before = fit.regression.held_out(&fit.active, &priors);
    let after = fit.regression.held_out(&with, &priors);
    let better = before.iter().zip(&after).filter(|(b, a)| a < b).count();
    let sum: f64 = before.iter().zip(&after).map(|(b, a)| b - a).sum();
    sum > 0.0 && 2 * better > FOLDS
}

/// Drops effects that those added later have made needless.
pub(super) fn drop_needless(fit: &mut Fit<'_>, named: &mut Vec<Named>, progress: Progress<'_>) {
    let dispersion = fit.dispersion(fit.scoring.chi2);
    let needless = |fit: &Fit<'_>, term: usize| {
        let loss = fit.solve_without(term).chi2 - fit.scoring.chi2;
        loss / dispersion < critical_sigma(fit, term).powi(2)
    };
    let Some(at) = named.iter().position(|n| needless(fit, n.term)) else { return };
    let gone = named.remove(at).term;
    fit.remove(gone);
    fit.refit(progress);
}

/// Names for each effect those candidates that would explain the data nearly as well in its place.
pub(super) fn find_confusable(fit: &Fit<'_>, named: &mut [Named]) {
    let dispersion = fit.dispersion(fit.scoring.chi2);
    let open = candidates(fit);
    for one in named {
        let without = fit.solve_without(one.term);
        let lost = without.chi2 - fit.scoring.chi2;
        let close = |term: &usize| {
            let score = shape::first_score(fit, &without, *term).map(|(score, _)| score);
            score.is_some_and(|score| lost - score.gain < CONFUSABLE_GAIN * dispersion)
        };
        let groups = open.iter().copied().filter(close);
        one.confusable_with = groups.filter_map(|term| fit.terms[term].effect()).collect();
    }
}

/// Largest gain of a shape that has no name.
pub(super) fn nameless_gain(fit: &Fit<'_>) -> f64 {
    let nameless = (0..fit.terms.len()).filter(|i| matches!(fit.terms[*i], Term::Nameless(_)));
    nameless.filter_map(|i| fit.score(&fit.scoring, i)).map(|score| score.gain).fold(0.0, f64::max)
}
