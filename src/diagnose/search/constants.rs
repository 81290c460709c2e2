//! Constants in which an effect is not linear, fitted by the score they give.

use super::candidates::Candidates;
use crate::diagnose::fit::{Fit, Score, Solution, UnknownConstant};
use crate::diagnose::thresholds::{
    FIRST_STEP, LAST_STEP, LEAST_CLIMB, MOST_CLIMBS, OTHERS_SHARE, SEARCH_STARTS, WORTH_SEARCHING,
};
use pitchleak_core::Signals;
use pitchleak_core::effects::{EffectConstant, EffectConstants};

/// A constant and the values of it that these traces can tell apart.
#[derive(Clone, Copy, Debug)]
struct Range {
    parameter: EffectConstant,
    low: f64,
    high: f64,
}

impl Range {
    fn at(&self, share: f64) -> f64 {
        self.low + share * (self.high - self.low)
    }
}

/// The constants of an effect that are fitted.
fn free(fit: &Fit<'_>, term: usize) -> Vec<Range> {
    let Some(effect) = fit.problem.terms[term].effect() else { return vec![] };
    effect.fitted_constants().filter_map(|parameter| range(fit, parameter)).collect()
}

/// What an effect's value has of spread because its constants are not known.
pub(crate) fn std_of_constants(fit: &Fit<'_>, term: usize) -> f64 {
    let unknown = |Range { parameter, low, high }| UnknownConstant { parameter, range: (low, high) };
    let unknown: Vec<_> = free(fit, term).into_iter().map(unknown).collect();
    fit.std_of_constants(term, &unknown)
}

/// Whether an effect has such constants.
pub(super) fn are_fitted(fit: &Fit<'_>, term: usize) -> bool {
    !free(fit, term).is_empty()
}

fn range(fit: &Fit<'_>, parameter: EffectConstant) -> Option<Range> {
    let span = |value: fn(&Signals<f64>) -> f64| {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let values = fit.rows().rows.iter().map(|row| value(&row.mean));
        values.fold(ends, |(low, high), v| (low.min(v), high.max(v)))
    };
    let (low, high) = parameter.range(fit.problem.usual_constants.get(parameter), span)?;
    Some(Range { parameter, low, high })
}

/// The constants with which the search for a candidate's begins: the present ones and a few places of each range.
fn starts(fit: &Fit<'_>, term: usize) -> Vec<EffectConstants<f64>> {
    let (ranges, usual) = (free(fit, term), fit.problem.usual(term));
    let middle = ranges.iter().fold(fit.constants(term), |constants, other| {
        constants.with(other.parameter, other.at(OTHERS_SHARE))
    });
    let places = ranges.iter().flat_map(|range| SEARCH_STARTS.map(|share| (range, share)));
    (fit.constants(term) != usual)
        .then_some(usual)
        .into_iter()
        .chain(places.map(|(range, share)| middle.with(range.parameter, range.at(share))))
        .collect()
}

/// The scores of a candidate with its present constants and over a few places of their ranges.
pub(super) fn first_scores(
    candidates: &mut Candidates<'_, '_>,
    model: &Solution,
    term: usize,
) -> Vec<(Score, EffectConstants<f64>)> {
    let fit = candidates.fit;
    let present = fit.score(model, term).map(|score| (score, fit.constants(term)));
    let tried = starts(fit, term).into_iter();
    let tried = tried.filter_map(|constants| Some((candidates.score(model, term, constants)?, constants)));
    present.into_iter().chain(tried).collect()
}

/// Constants that stand for all a candidate can have: its own if it has none that are fitted.
pub(super) fn places(fit: &Fit<'_>, term: usize, also: &[EffectConstants<f64>]) -> Vec<EffectConstants<f64>> {
    let present = std::iter::once(fit.constants(term));
    let has_constants = fit.problem.terms[term].effect().is_some_and(|effect| !effect.constants().is_empty());
    let also = if has_constants { also } else { &[] };
    present.chain(starts(fit, term)).chain(also.iter().copied()).collect()
}

/// The best score over its constants, from there on.
pub(super) fn best_score(
    candidates: &mut Candidates<'_, '_>,
    model: &Solution,
    first: (Score, EffectConstants<f64>),
) -> (Score, EffectConstants<f64>) {
    let dispersion = candidates.fit.dispersion(model.chi2 - first.0.chi2_drop);
    if first.0.chi2_drop / dispersion < WORTH_SEARCHING {
        return first;
    }
    let ranges = free(candidates.fit, first.0.term);
    climb(candidates, model, &ranges, first)
}

/// Pattern search (Hooke and Jeeves 1961): a step along each constant, halved when none helps.
fn climb(
    candidates: &mut Candidates<'_, '_>,
    model: &Solution,
    ranges: &[Range],
    start: (Score, EffectConstants<f64>),
) -> (Score, EffectConstants<f64>) {
    let term = start.0.term;
    let mut best = start;
    let mut share = FIRST_STEP;
    for _ in 0..MOST_CLIMBS {
        if share < LAST_STEP || ranges.is_empty() {
            break;
        }
        let steps = ranges.iter().flat_map(|range| [(range, share), (range, -share)]);
        let tried = steps.filter_map(|(range, share)| {
            let value = best.1.get(range.parameter) + share * (range.high - range.low);
            let constants = best.1.with(range.parameter, value.clamp(range.low, range.high));
            Some((candidates.score(model, term, constants)?, constants))
        });
        match tried.max_by(|a, b| a.0.chi2_drop.total_cmp(&b.0.chi2_drop)) {
            Some(better) if better.0.chi2_drop > best.0.chi2_drop + LEAST_CLIMB => best = better,
            _ => share /= 2.0,
        }
    }
    best
}
