//! The effects that could be named next, each with what it would bring to a model.

use super::constants;
use crate::diagnose::fit::{Fit, PartialColumn, Score, Solution};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{CONSTANTS_TRIALS, FALSE_EFFECT_RATE, IN_THE_RUNNING};
use crate::diagnose::weak_form::Term;
use pitchleak_core::effects::EffectConstants;

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

/// Places of the terms that could be named.
pub(crate) fn open(fit: &Fit<'_>) -> Vec<usize> {
    let terms = &fit.problem.terms;
    let is_open =
        |i: &usize| terms[*i].effect().is_some() && !fit.active().contains(i) && fit.regression.shows(*i);
    (0..terms.len()).filter(is_open).collect()
}

/// The size in σ that the score of a candidate with these constants needs.
pub(super) fn critical_sigma(fit: &Fit<'_>, constants: EffectConstants<f64>) -> f64 {
    let problem = fit.problem;
    let count = problem.terms.iter().filter(|term| term.effect().is_some()).count();
    let trials = if constants == problem.usual_constants { 1 } else { CONSTANTS_TRIALS };
    statistics::bonferroni_sigma(FALSE_EFFECT_RATE, count * trials)
}

/// Largest fall of the sum of squares by a product of signals that has no name.
pub(crate) fn nameless_chi2_drop(fit: &Fit<'_>) -> f64 {
    let terms = &fit.problem.terms;
    let nameless = (0..terms.len()).filter(|i| matches!(terms[*i], Term::Nameless(_)));
    nameless.filter_map(|i| fit.score(&fit.free, i)).map(|score| score.chi2_drop).fold(0.0, f64::max)
}

/// A whitened column of a term with constants that are not its present ones.
struct WhiteColumn {
    term: usize,
    constants: EffectConstants<f64>,
    white: Vec<f64>,
}

/// The search for candidates beside one fit; keeps the columns that it has built.
pub(super) struct Candidates<'f, 'a> {
    pub(super) fit: &'f Fit<'a>,
    columns: Vec<WhiteColumn>,
}

impl<'f, 'a> Candidates<'f, 'a> {
    pub(super) fn of(fit: &'f Fit<'a>) -> Self {
        Self { fit, columns: vec![] }
    }

    /// What a term with these constants would bring to a model; none where it can't be or would be unphysical.
    pub(super) fn score(
        &mut self,
        model: &Solution,
        term: usize,
        constants: EffectConstants<f64>,
    ) -> Option<Score> {
        let column = self.partial(model, term, constants)?;
        let score = self.fit.regression.score_column(model, term, &column)?;
        self.fit.problem.allows(term, score.value).then_some(score)
    }

    /// The column of a term with these constants beside a model.
    pub(super) fn partial(
        &mut self,
        model: &Solution,
        term: usize,
        constants: EffectConstants<f64>,
    ) -> Option<PartialColumn> {
        let known = |one: &WhiteColumn| one.term == term && one.constants == constants;
        let place = self.columns.iter().position(known).unwrap_or_else(|| {
            let white = self.fit.white_column(self.fit.problem.terms[term], constants);
            self.columns.push(WhiteColumn { term, constants, white });
            self.columns.len() - 1
        });
        self.fit.partial(model, &self.columns[place].white)
    }

    /// Every candidate against a model, its constants only tried at a few places; the best first.
    pub(super) fn rough_trials(&mut self, model: &Solution) -> Vec<Trial> {
        let scores = self.starts(model);
        self.ranked(model, scores)
    }

    /// Every candidate at its best against a model; the best first.
    pub(super) fn trials(&mut self, model: &Solution) -> Vec<Trial> {
        let mut scores = self.starts(model);
        let best = scores.iter().flatten().map(|(score, _)| score.chi2_drop).fold(0.0, f64::max);
        for of_one in &mut scores {
            let top = of_one.iter().copied().max_by(|a, b| a.0.chi2_drop.total_cmp(&b.0.chi2_drop));
            let top = top.filter(|top| top.0.chi2_drop > IN_THE_RUNNING * best);
            of_one.extend(top.map(|top| constants::best_score(self, model, top)));
        }
        self.ranked(model, scores)
    }

    /// The scores of each candidate with its usual constants and at a few places of their ranges.
    fn starts(&mut self, model: &Solution) -> Vec<Vec<(Score, EffectConstants<f64>)>> {
        open(self.fit).into_iter().map(|term| constants::first_scores(self, model, term)).collect()
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
