//! The candidates at their best, held against one another: the constants in which an effect is not linear are fitted by the score they
//! give. How alike candidates look in given traces says what no method could tell apart.

use super::candidates::{self, Candidates, critical_sigma, open};
use crate::diagnose::data::{Declared, Series, check_sensors, thinned};
use crate::diagnose::fit::{Fit, PartialColumn, Problem, Score, Solution, UnknownConstant};
use crate::diagnose::thresholds::{HALVINGS, IN_THE_RUNNING, SEARCH_STARTS, SIGNIFICANT_SIGMA};
use pitchleak_core::effects::{EffectConstant, EffectConstants};
use pitchleak_core::{Effect, Signals};

/// Half of one of the parts of a range that the search starts in: so far it is from the middle to the ends.
const HALF_PART: f64 = 0.5 / SEARCH_STARTS as f64;

/// So much of a range is its end. Chosen.
const END_SHARE: f64 = 0.05;

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

/// What an effect's value has of spread because its constants are not known; where they were fitted the fit knows that.
pub(crate) fn std_of_constants(fit: &Fit<'_>, term: usize) -> f64 {
    if fit.constants(term) != fit.problem.usual(term) {
        return 0.0;
    }
    let ranges = free(fit, term);
    let unknown = |own: &Range| UnknownConstant { parameter: own.parameter, range: (own.low, own.high) };
    let unknown: Vec<_> = ranges.iter().map(unknown).collect();
    let linear = fit.std_of_constants(term, &unknown);
    let size = fit.estimate(term).map_or(0.0, |own| own.value.abs());
    let is_least = |own: &Range| fit.constants(term).get(own.parameter) <= own.low;
    // The constant can but grow, and a law that grows by a share x with it makes the size v / (1 + x): never less than nothing.
    if ranges.iter().any(is_least) && size > 0.0 { linear / (1.0 + linear / size) } else { linear }
}

/// A fitted constant of an effect that lies at the end of what these traces cover: of a flank alone neither the top's place nor its height
/// can be told.
pub(crate) fn constant_at_end(fit: &Fit<'_>, term: usize) -> Option<EffectConstant> {
    let is_at_end = |Range { parameter, low, high }: &Range| {
        let (value, near) = (fit.constants(term).get(*parameter), END_SHARE * (high - low));
        parameter.is_place() && (value <= low + near || value >= high - near)
    };
    free(fit, term).into_iter().find(is_at_end).map(|range| range.parameter)
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
    // The others stand low meanwhile: bells and bends are narrow.
    let low = ranges
        .iter()
        .fold(fit.constants(term), |constants, other| constants.with(other.parameter, other.at(HALF_PART)));
    let shares = (0..SEARCH_STARTS).map(|part| (2 * part + 1) as f64 * HALF_PART);
    let places = ranges.iter().flat_map(|range| shares.clone().map(move |share| (range, share)));
    (fit.constants(term) != usual)
        .then_some(usual)
        .into_iter()
        .chain(places.map(|(range, share)| low.with(range.parameter, range.at(share))))
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
    if first.0.chi2_drop / dispersion < SIGNIFICANT_SIGMA.powi(2) {
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
    let (mut share, mut halvings) = (HALF_PART, 0);
    while halvings < HALVINGS {
        let steps = ranges.iter().flat_map(|range| [(range, share), (range, -share)]);
        let tried = steps.filter_map(|(range, share)| {
            let value = best.1.get(range.parameter) + share * (range.high - range.low);
            let constants = best.1.with(range.parameter, value.clamp(range.low, range.high));
            Some((candidates.score(model, term, constants)?, constants))
        });
        match tried.max_by(|a, b| a.0.chi2_drop.total_cmp(&b.0.chi2_drop)) {
            Some(better) if better.0.chi2_drop > best.0.chi2_drop => best = better,
            _ => (share, halvings) = (share / 2.0, halvings + 1),
        }
    }
    best
}

/// A candidate at its best: with the constants it starts from, or with fitted ones, which have to be paid for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    pub(super) score: Score,
    pub(super) constants: EffectConstants<f64>,
    critical_sigma: f64,
}

impl Trial {
    /// By how much it passes what chance could bring: the measure by which candidates compete.
    pub(super) fn beyond(&self, dispersion: f64) -> f64 {
        self.score.chi2_drop / dispersion - self.critical_sigma.powi(2)
    }
}

impl Candidates<'_, '_> {
    /// Every candidate at its best against a model, the best first; those that are `gone` from it with other constants than they had.
    pub(super) fn trials(&mut self, model: &Solution, gone: &[usize]) -> Vec<Trial> {
        let mut scores = self.starts(model, gone);
        let best = scores.iter().flatten().map(|(score, _)| score.chi2_drop).fold(0.0, f64::max);
        for of_one in &mut scores {
            let top = of_one.iter().copied().max_by(|a, b| a.0.chi2_drop.total_cmp(&b.0.chi2_drop));
            let top = top.filter(|top| top.0.chi2_drop > IN_THE_RUNNING * best);
            of_one.extend(top.map(|top| best_score(self, model, top)));
        }
        self.ranked(model, scores)
    }

    /// The scores of each candidate with its usual constants and at a few places of their ranges.
    fn starts(&mut self, model: &Solution, gone: &[usize]) -> Vec<Vec<(Score, EffectConstants<f64>)>> {
        let terms = open(self.fit).into_iter().chain(gone.iter().copied());
        terms.map(|term| first_scores(self, model, term)).collect()
    }

    fn ranked(&self, model: &Solution, scores: Vec<Vec<(Score, EffectConstants<f64>)>>) -> Vec<Trial> {
        let dispersion = self.fit.dispersion(model.chi2);
        let trial = |(score, constants)| Trial {
            score,
            constants,
            critical_sigma: critical_sigma(self.fit, constants),
        };
        let best = |scores: Vec<(Score, EffectConstants<f64>)>| {
            let trials = scores.into_iter().map(trial);
            trials.max_by(|a, b| a.beyond(dispersion).total_cmp(&b.beyond(dispersion)))
        };
        let mut trials: Vec<Trial> = scores.into_iter().filter_map(best).collect();
        trials.sort_by(|a, b| b.beyond(dispersion).total_cmp(&a.beyond(dispersion)));
        trials
    }
}

/// An effect with the constants in which it is not linear.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// The effect.
    pub effect: Effect,
    /// Its constants.
    pub constants: EffectConstants<f64>,
    /// Standard deviation of its size with the declared model's constants free, in the effect's unit.
    pub std: f64,
    /// The size in standard deviations at which the diagnosis would name it.
    pub critical_sigma: f64,
}

/// The columns of all candidates in traces of a sound rig, with the declared model fitted, compared.
///
/// A candidate's score (Rao 1948) is normal with variance one. An effect of m standard deviations moves its own
/// score by m and that of a rival by ρ m, where ρ is the correlation of the two columns under
/// the noise: with ρ near one the exact likelihood itself tosses a coin between them.
#[derive(Clone, Debug)]
pub struct Collinearity {
    /// The candidates; one of several constants stands here several times.
    pub candidates: Vec<Candidate>,
    /// Correlation of each pair of them, in the same order.
    pub correlation: Vec<Vec<f64>>,
}

impl Collinearity {
    /// Compares all candidates on `traces` of a sound rig. Constants that are fitted are taken from a few places of
    /// their range, and from `also`.
    pub fn of(traces: &[Series], declared: &Declared, also: &[EffectConstants<f64>]) -> Self {
        let (traces, declared) = thinned(traces, declared);
        let problem = Problem::new(&traces, &declared, &check_sensors(&traces, &declared));
        let fit = Fit::declared(&problem, &|| ());
        let mut search = Candidates::of(&fit);
        let (candidates, columns): (Vec<_>, Vec<_>) = candidates::open(&fit)
            .into_iter()
            .flat_map(|term| places(&fit, term, also).into_iter().map(move |one| (term, one)))
            .filter_map(|(term, constants)| {
                let column = search.partial(&fit.free, term, constants)?;
                let effect = problem.terms[term].effect()?;
                let critical_sigma = candidates::critical_sigma(&fit, constants);
                Some((Candidate { effect, constants, std: column.std(), critical_sigma }, column))
            })
            .unzip();
        let row = |a: &PartialColumn| columns.iter().map(|b| a.correlation(b)).collect();
        let correlation = columns.iter().map(row).collect();
        Self { candidates, correlation }
    }
}
