//! The candidates at their best, held against one another.

use super::candidates::{Candidates, critical_sigma, open};
use super::constants;
use crate::diagnose::fit::{Score, Solution};
use crate::diagnose::thresholds::IN_THE_RUNNING;
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

impl Candidates<'_, '_> {
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
