//! Which effect is missing: forward selection by the score test, with backward elimination, each
//! step confirmed on data that it did not fit.

use super::Progress;
use super::fit::Fit;
use super::regression::{FOLDS, Score};
use super::term::Term;
use super::whiteness;
use pitchleak_core::Effect;
use pitchleak_core::effects::Shape;

/// Share of sound rigs on which the search may name anything, shared out over all candidates (Bonferroni).
const FALSE_EFFECT_RATE: f64 = 1e-3;
/// A shape fitted to the data counts as this many candidates.
const SHAPE_TRIALS: usize = 20;
/// The search for a shape ends after so many steps, and steps must gain this much.
const START_WIDTH: f64 = 0.15;
const MOST_STEPS: usize = 24;
const LEAST_CLIMB: f64 = 0.5;
/// Effects that one diagnosis names at most.
const MOST_EFFECTS: usize = 5;
/// While the remainder is larger than the noise, an effect must mend this share of it to be named.
const LEAST_MENDED_SHARE: f64 = 0.02;
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
    let trials = if starts(fit, term).is_empty() { 1 } else { SHAPE_TRIALS };
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
        candidates(fit).into_iter().filter_map(|term| best_shape(fit, term)).collect();
    scores.sort_by(|a, b| b.0.gain.total_cmp(&a.0.gain));
    let nameless = nameless_gain(fit);
    for (score, shape) in scores {
        let dispersion = fit.dispersion(fit.solution.chi2 - score.gain);
        let significance = score.gain / dispersion;
        if significance < critical_sigma(fit, score.term).powi(2) {
            continue;
        }
        let mended = score.gain / fit.solution.chi2;
        if fit.is_incomplete() && mended < LEAST_MENDED_SHARE || !holds_out(fit, &score) {
            continue;
        }
        let outdone = nameless > score.gain + CONFUSABLE_GAIN * dispersion;
        fit.shapes[score.term] = shape;
        fit.active.push(score.term);
        fit.refit(progress);
        let p_value = whiteness::chi2_p(significance, 1.0);
        return Some(Named { term: score.term, p_value, confusable_with: vec![], outdone });
    }
    None
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
    let dispersion = fit.dispersion(fit.solution.chi2);
    let needless = |fit: &Fit<'_>, term: usize| {
        let loss = fit.solve_without(term).chi2 - fit.solution.chi2;
        loss / dispersion < critical_sigma(fit, term).powi(2)
    };
    let Some(at) = named.iter().position(|n| needless(fit, n.term)) else { return };
    let gone = named.remove(at).term;
    fit.remove(gone);
    fit.refit(progress);
}

/// Names for each effect those candidates that would explain the data nearly as well in its place.
pub(super) fn find_confusable(fit: &Fit<'_>, named: &mut [Named]) {
    let dispersion = fit.dispersion(fit.solution.chi2);
    let open = candidates(fit);
    for one in named {
        let without = fit.solve_without(one.term);
        let lost = without.chi2 - fit.solution.chi2;
        let close = |term: &usize| {
            let score = fit.regression.score(&without, *term).filter(|score| fit.allowed(score));
            score.is_some_and(|score| lost - score.gain < CONFUSABLE_GAIN * dispersion)
        };
        let groups = open.iter().copied().filter(close);
        one.confusable_with = groups.filter_map(|term| fit.terms[term].effect()).collect();
    }
}

/// Largest gain of a shape that has no name.
pub(super) fn nameless_gain(fit: &Fit<'_>) -> f64 {
    let nameless = (0..fit.terms.len()).filter(|i| matches!(fit.terms[*i], Term::Nameless(_)));
    nameless.filter_map(|i| fit.score(i)).map(|score| score.gain).fold(0.0, f64::max)
}

/// Shapes from which the fit of a nonlinear effect starts; none for a linear effect.
fn starts(fit: &Fit<'_>, term: usize) -> Vec<Shape<f64>> {
    let shape = fit.shapes[term];
    match fit.terms[term] {
        Term::Effect(Effect::PositionDependentLeak) => {
            let (low, high) = fit.rows.rows.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), row| {
                (l.min(row.mean.x_m), h.max(row.mean.x_m))
            });
            let range = high - low;
            if range.is_nan() || range <= 0.0 {
                return vec![];
            }
            let place = |share: f64| Shape {
                spot_position_m: low + share * range,
                spot_width_m: START_WIDTH * range,
                ..shape
            };
            [0.1, 0.3, 0.5, 0.7, 0.9].map(place).to_vec()
        }
        Term::Effect(Effect::StribeckFriction) => [0.3, 1.0, 3.0]
            .map(|f| Shape { stribeck_speed_mps: f * shape.stribeck_speed_mps, ..shape })
            .to_vec(),
        _ => vec![],
    }
}

/// The numbers of a shape that are fitted, and the shape with other such numbers.
fn free_numbers(term: Term, shape: &Shape<f64>) -> Vec<f64> {
    match term {
        Term::Effect(Effect::PositionDependentLeak) => vec![shape.spot_position_m, shape.spot_width_m],
        Term::Effect(Effect::StribeckFriction) => vec![shape.stribeck_speed_mps],
        _ => vec![],
    }
}

fn with_numbers(term: Term, shape: &Shape<f64>, numbers: &[f64]) -> Shape<f64> {
    match (term, numbers) {
        (Term::Effect(Effect::PositionDependentLeak), [position, width]) => {
            Shape { spot_position_m: *position, spot_width_m: *width, ..*shape }
        }
        (Term::Effect(Effect::StribeckFriction), [speed]) => Shape { stribeck_speed_mps: *speed, ..*shape },
        _ => *shape,
    }
}

/// Shapes that these traces can tell from a constant: a spot on the path and narrower than it, a
/// Stribeck speed that is passed.
fn within(fit: &Fit<'_>, term: usize, numbers: &[f64]) -> bool {
    let starts = starts(fit, term);
    let Some(first) = starts.first() else { return false };
    match (fit.terms[term], numbers) {
        (Term::Effect(Effect::PositionDependentLeak), [position, width]) => {
            let range = first.spot_width_m / START_WIDTH;
            let low = first.spot_position_m - 0.1 * range;
            (low..=low + range).contains(position) && (0.03 * range..=0.5 * range).contains(width)
        }
        (Term::Effect(Effect::StribeckFriction), [speed]) => {
            (0.3 * first.stribeck_speed_mps..=10.0 * first.stribeck_speed_mps).contains(speed)
        }
        _ => false,
    }
}

/// The candidate's best score over its shape.
fn best_shape(fit: &Fit<'_>, term: usize) -> Option<(Score, Shape<f64>)> {
    let plain = fit.score(term).map(|score| (score, fit.shapes[term]));
    let tried =
        starts(fit, term).into_iter().filter_map(|shape| Some((fit.score_shape(term, shape)?, shape)));
    let best = tried.chain(plain).max_by(|a, b| a.0.gain.total_cmp(&b.0.gain))?;
    let dispersion = fit.dispersion(fit.solution.chi2 - best.0.gain);
    // Far from significant: not worth the search.
    if free_numbers(fit.terms[term], &best.1).is_empty() || best.0.gain / dispersion < 9.0 {
        return Some(best);
    }
    Some(climb(fit, term, best))
}

/// Pattern search from a start: steps of a share of the width, halved when none helps
/// (Hooke and Jeeves 1961).
fn climb(fit: &Fit<'_>, term: usize, start: (Score, Shape<f64>)) -> (Score, Shape<f64>) {
    let mut best = start;
    let mut share = 0.4;
    for _ in 0..MOST_STEPS {
        if share < 0.02 {
            break;
        }
        let numbers = free_numbers(fit.terms[term], &best.1);
        // A position moves by shares of the width, a width or speed by shares of itself.
        let unit = *numbers.last().unwrap_or(&0.0);
        let steps = (0..numbers.len()).flat_map(|i| [(i, share * unit), (i, -share * unit)]);
        let tried = steps.filter_map(|(i, step)| {
            let mut numbers = numbers.clone();
            numbers[i] += step;
            if !within(fit, term, &numbers) {
                return None;
            }
            let shape = with_numbers(fit.terms[term], &best.1, &numbers);
            Some((fit.score_shape(term, shape)?, shape))
        });
        match tried.max_by(|a, b| a.0.gain.total_cmp(&b.0.gain)) {
            Some(better) if better.0.gain > best.0.gain + LEAST_CLIMB => best = better,
            _ => share /= 2.0,
        }
    }
    best
}
