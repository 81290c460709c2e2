//! Which effect is missing: forward selection by the score test, with backward elimination, each
//! step confirmed on data that it did not fit.

use super::Progress;
use super::fit::Fit;
use super::regression::{FOLDS, Score, Solution};
use super::shape;
use super::term::Term;
use super::whiteness;
use pitchleak_core::Effect;
use pitchleak_core::effects::EffectConstants;

/// Share of sound rigs on which the search may name anything, shared out over all candidates (Bonferroni).
const FALSE_EFFECT_RATE: f64 = 1e-3;
/// A shape fitted to the data counts as this many candidates.
const SHAPE_TRIALS: usize = 20;
/// Effects that one diagnosis names at most.
const MOST_EFFECTS: usize = 6;
/// While the remainder is larger than the noise, an effect must mend this share of it to be named.
const LEAST_MENDED_SHARE: f64 = 0.02;
/// A candidate below this share of the best is not worth a search for its shape.
const IN_THE_RUNNING: f64 = 0.4;
/// Standard deviations by the jackknife that an effect must have beside an unexplained remainder.
const AGREED_SIGMA: f64 = 3.0;
/// Candidates whose fit is this close (three standard deviations) cannot be told apart.
pub(super) const CONFUSABLE_GAIN: f64 = 9.0;

/// One effect of the answer, as an index into the fit's terms.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub(super) term: usize,
    /// Chance of so large a score without the effect.
    pub(super) p_value: f64,
    /// Fall of the held-out error when it was added, percent; none before that is known.
    pub(super) mended_percent: Option<f64>,
    pub(super) confusable_with: Vec<Effect>,
    /// A shape without a name would have fitted better.
    pub(super) outdone: bool,
}

/// A candidate at its best: with the constants it starts from, or with fitted ones, which have to be paid for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    pub(super) score: Score,
    pub(super) shape: EffectConstants<f64>,
    critical_sigma: f64,
}

impl Trial {
    fn of(fit: &Fit<'_>, (score, shape): (Score, EffectConstants<f64>)) -> Self {
        Self { score, shape, critical_sigma: critical_sigma(fit, shape) }
    }

    /// By how much its gain passes what chance could bring: the measure by which candidates compete.
    pub(super) fn beyond(&self, dispersion: f64) -> f64 {
        self.score.gain / dispersion - self.critical_sigma.powi(2)
    }
}

/// Indices of the candidates that can be named.
pub(super) fn candidates(fit: &Fit<'_>) -> Vec<usize> {
    let open =
        |i: &usize| fit.terms[*i].effect().is_some() && !fit.active.contains(i) && fit.regression.shows(*i);
    (0..fit.terms.len()).filter(open).collect()
}

/// The size in σ that the score of a candidate with these constants needs.
pub(super) fn critical_sigma(fit: &Fit<'_>, shape: EffectConstants<f64>) -> f64 {
    let count = fit.terms.iter().filter(|term| term.effect().is_some()).count();
    let trials = if shape == fit.plain_shape { 1 } else { SHAPE_TRIALS };
    whiteness::bonferroni_sigma(FALSE_EFFECT_RATE, count * trials)
}

/// The scores of each candidate with its usual constants and at a few places of their ranges.
fn starts(fit: &Fit<'_>, model: &Solution) -> Vec<Vec<(Score, EffectConstants<f64>)>> {
    candidates(fit).into_iter().map(|term| shape::first_scores(fit, model, term)).collect()
}

/// One trial of each candidate, the best first.
fn ranked(fit: &Fit<'_>, model: &Solution, scores: Vec<Vec<(Score, EffectConstants<f64>)>>) -> Vec<Trial> {
    let dispersion = fit.dispersion(model.chi2);
    let best = |scores: Vec<(Score, EffectConstants<f64>)>| {
        let trials = scores.into_iter().map(|one| Trial::of(fit, one));
        trials.max_by(|a, b| a.beyond(dispersion).total_cmp(&b.beyond(dispersion)))
    };
    let mut trials: Vec<Trial> = scores.into_iter().filter_map(best).collect();
    trials.sort_by(|a, b| b.beyond(dispersion).total_cmp(&a.beyond(dispersion)));
    trials
}

/// Every candidate against a model, its constants only tried at a few places.
pub(super) fn rough_trials(fit: &Fit<'_>, model: &Solution) -> Vec<Trial> {
    ranked(fit, model, starts(fit, model))
}

/// Every candidate at its best against a model.
pub(super) fn trials(fit: &Fit<'_>, model: &Solution) -> Vec<Trial> {
    let mut scores = starts(fit, model);
    let worth = IN_THE_RUNNING * scores.iter().flatten().map(|(score, _)| score.gain).fold(0.0, f64::max);
    for of_one in &mut scores {
        let top = of_one.iter().copied().max_by(|a, b| a.0.gain.total_cmp(&b.0.gain));
        let top = top.filter(|top| top.0.gain > worth);
        of_one.extend(top.map(|top| shape::best_score(fit, model, top)));
    }
    ranked(fit, model, scores)
}

/// Adds the next effect and fits again; none when nothing further is significant.
pub(super) fn add_next(fit: &mut Fit<'_>, progress: Progress<'_>) -> Option<Named> {
    let added =
        fit.active.iter().filter(|i| fit.priors[**i].is_none() && fit.terms[**i].effect().is_some()).count();
    if added >= MOST_EFFECTS {
        return None;
    }
    let nameless = nameless_gain(fit);
    for trial in trials(fit, &fit.scoring) {
        let score = trial.score;
        let dispersion = fit.dispersion(fit.scoring.chi2 - score.gain);
        if trial.beyond(dispersion) < 0.0 {
            continue;
        }
        let mended = score.gain / fit.scoring.chi2;
        if fit.is_incomplete() && mended < LEAST_MENDED_SHARE {
            continue;
        }
        fit.reshape(score.term, trial.shape);
        if !holds_out(fit, &score) {
            fit.reshape(score.term, fit.plain_shape);
            continue;
        }
        let outdone = nameless > score.gain + CONFUSABLE_GAIN * dispersion;
        let p_value = whiteness::chi2_p(score.gain / dispersion, 1.0);
        take(fit, &trial, progress);
        return Some(Named {
            term: score.term,
            p_value,
            mended_percent: None,
            confusable_with: vec![],
            outdone,
        });
    }
    None
}

/// Takes a candidate into the model and fits again, its constants too.
pub(super) fn take(fit: &mut Fit<'_>, trial: &Trial, progress: Progress<'_>) {
    let term = trial.score.term;
    fit.reshape(term, trial.shape);
    fit.active.push(term);
    fit.refit(progress);
    if trial.shape != fit.plain_shape {
        polish(fit, term, progress);
    }
}

/// Fits the constants of a new effect again, now that what it leaves is no longer in the way.
fn polish(fit: &mut Fit<'_>, term: usize, progress: Progress<'_>) {
    fit.set_aside(term, progress);
    let starts = shape::first_scores(fit, &fit.scoring, term);
    if let Some(first) = starts.into_iter().max_by(|a, b| a.0.gain.total_cmp(&b.0.gain)) {
        let (_, shape) = shape::best_score(fit, &fit.scoring, first);
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
        loss(fit, &[term]) / dispersion < critical_sigma(fit, fit.shapes[term]).powi(2)
    };
    let Some(at) = named.iter().position(|n| needless(fit, n.term)) else { return };
    let gone = named.remove(at).term;
    fit.remove(gone);
    fit.refit(progress);
}

/// Drops effects that the pieces of the data do not agree upon: where the model stays incomplete, a good score alone
/// may be the work of something else.
pub(super) fn drop_doubtful(fit: &mut Fit<'_>, named: &mut Vec<Named>, progress: Progress<'_>) {
    while fit.is_incomplete() {
        let ratio = |one: &Named| fit.estimate(one.term).map_or(0.0, |(value, std)| value.abs() / std);
        let weakest = named.iter().enumerate().min_by(|a, b| ratio(a.1).total_cmp(&ratio(b.1)));
        let Some((at, one)) = weakest.filter(|(_, one)| ratio(one) < AGREED_SIGMA) else { return };
        fit.remove(one.term);
        fit.refit(progress);
        named.remove(at);
    }
}

/// By how much the sum of squares rises without some of the effects.
pub(super) fn loss(fit: &Fit<'_>, terms: &[usize]) -> f64 {
    fit.solve_without(terms).chi2 - fit.scoring.chi2
}

/// Names for each effect those candidates that would explain the data nearly as well in its place, and
/// orders the effects by what the fit loses without them.
pub(super) fn find_confusable(fit: &Fit<'_>, named: &mut [Named]) {
    let dispersion = fit.dispersion(fit.scoring.chi2);
    for one in named.iter_mut() {
        let without = fit.solve_without(&[one.term]);
        let lost = without.chi2 - fit.scoring.chi2;
        let close = |trial: &Trial| lost - trial.score.gain < CONFUSABLE_GAIN * dispersion;
        let rivals = trials(fit, &without).into_iter().filter(close);
        one.confusable_with = rivals.filter_map(|trial| fit.terms[trial.score.term].effect()).collect();
    }
    named.sort_by(|a, b| loss(fit, &[b.term]).total_cmp(&loss(fit, &[a.term])));
}

/// Largest gain of a shape that has no name.
pub(super) fn nameless_gain(fit: &Fit<'_>) -> f64 {
    let nameless = (0..fit.terms.len()).filter(|i| matches!(fit.terms[*i], Term::Nameless(_)));
    nameless.filter_map(|i| fit.score(&fit.scoring, i)).map(|score| score.gain).fold(0.0, f64::max)
}
