//! Constants in which an effect is not linear, fitted by the score they give.

use super::fit::Fit;
use super::regression::{Score, Solution};
use pitchleak_core::effects::{EffectConstant, EffectConstants};

/// Steps of the search, its first and last step as shares of a constant's range, and what a step must gain.
const MOST_STEPS: usize = 40;
const FIRST_STEP: f64 = 0.2;
const LAST_STEP: f64 = 0.002;
const LEAST_CLIMB: f64 = 0.5;
/// A score below this (three standard deviations) is not worth the search.
const WORTH_SEARCHING: f64 = 9.0;
/// Places along the range of each constant from which the search starts.
const STARTS: [f64; 3] = [0.15, 0.5, 0.85];

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

/// The constants of an effect that are fitted: not those that only fix a reference.
fn free(fit: &Fit<'_>, term: usize) -> Vec<Range> {
    let Some(effect) = fit.terms[term].effect() else { return vec![] };
    effect.constants().iter().filter_map(|parameter| range(fit, *parameter)).collect()
}

fn range(fit: &Fit<'_>, parameter: EffectConstant) -> Option<Range> {
    let rows = &fit.rows.rows;
    let span = |value: &dyn Fn(&super::rows::Row) -> f64| {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        rows.iter().map(value).fold(ends, |(low, high), v| (low.min(v), high.max(v)))
    };
    let (low, high) = match parameter {
        EffectConstant::SpotPosition => span(&|row| row.mean.x_m),
        EffectConstant::SpotWidth => {
            let (low, high) = span(&|row| row.mean.x_m);
            (0.05 * (high - low), 0.7 * (high - low))
        }
        EffectConstant::StribeckSpeed => {
            let (_, high) = span(&|row| row.mean.v_mps.abs());
            (0.02 * high, 0.7 * high)
        }
        EffectConstant::Precharge => (0.0, span(&|row| row.mean.pa_pa.max(row.mean.pb_pa)).1),
        // Slow to fast.
        EffectConstant::PolytropicExponent => (1.0, 1.4),
        EffectConstant::SlipSpeed => {
            let (_, high) = span(&|row| row.mean.v_mps.abs());
            (fit.plain_shape.slip_speed_mps, 0.3 * high)
        }
        EffectConstant::ReferenceTemp => return None,
    };
    let spec = parameter.spec();
    let (low, high) = (low.max(spec.lower), high.min(spec.upper));
    (high > low).then_some(Range { parameter, low, high })
}

/// The constants with which the search for a candidate's begins: the present ones and a few places of each range.
fn starts(fit: &Fit<'_>, term: usize) -> Vec<EffectConstants<f64>> {
    let ranges = free(fit, term);
    let middle =
        ranges.iter().fold(fit.shapes[term], |shape, other| shape.with(other.parameter, other.at(0.3)));
    let places = ranges.iter().flat_map(|range| STARTS.map(|share| (range, share)));
    let plain = (fit.shapes[term] != fit.plain_shape).then_some(fit.plain_shape);
    plain
        .into_iter()
        .chain(places.map(|(range, share)| middle.with(range.parameter, range.at(share))))
        .collect()
}

/// The scores of a candidate with its present constants and over a few places of their ranges.
pub(super) fn first_scores(
    fit: &Fit<'_>,
    model: &Solution,
    term: usize,
) -> Vec<(Score, EffectConstants<f64>)> {
    let plain = fit.score(model, term).map(|score| (score, fit.shapes[term]));
    let tried = starts(fit, term).into_iter();
    let tried = tried.filter_map(|shape| Some((fit.score_shape(model, term, shape)?, shape)));
    plain.into_iter().chain(tried).collect()
}

/// Constants that stand for all a candidate can have: its own if it has none that are fitted.
pub(super) fn places(fit: &Fit<'_>, term: usize, also: &[EffectConstants<f64>]) -> Vec<EffectConstants<f64>> {
    let present = std::iter::once(fit.shapes[term]);
    let has_constants = fit.terms[term].effect().is_some_and(|effect| !effect.constants().is_empty());
    let shaped = if has_constants { also } else { &[] };
    present.chain(starts(fit, term)).chain(shaped.iter().copied()).collect()
}

/// The best score over its constants, from there on.
pub(super) fn best_score(
    fit: &Fit<'_>,
    model: &Solution,
    first: (Score, EffectConstants<f64>),
) -> (Score, EffectConstants<f64>) {
    let dispersion = fit.dispersion(model.chi2 - first.0.gain);
    if first.0.gain / dispersion < WORTH_SEARCHING {
        return first;
    }
    climb(fit, model, &free(fit, first.0.term), first)
}

/// Pattern search (Hooke and Jeeves 1961): a step along each constant, halved when none helps.
fn climb(
    fit: &Fit<'_>,
    model: &Solution,
    ranges: &[Range],
    start: (Score, EffectConstants<f64>),
) -> (Score, EffectConstants<f64>) {
    let term = start.0.term;
    let mut best = start;
    let mut share = FIRST_STEP;
    for _ in 0..MOST_STEPS {
        if share < LAST_STEP || ranges.is_empty() {
            break;
        }
        let steps = ranges.iter().flat_map(|range| [(range, share), (range, -share)]);
        let tried = steps.filter_map(|(range, share)| {
            let value = best.1.get(range.parameter) + share * (range.high - range.low);
            let shape = best.1.with(range.parameter, value.clamp(range.low, range.high));
            Some((fit.score_shape(model, term, shape)?, shape))
        });
        match tried.max_by(|a, b| a.0.gain.total_cmp(&b.0.gain)) {
            Some(better) if better.0.gain > best.0.gain + LEAST_CLIMB => best = better,
            _ => share /= 2.0,
        }
    }
    best
}
