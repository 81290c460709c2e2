//! Forward selection by the score test, with backward elimination, each step confirmed on data that it did not fit.

use super::candidates::{Candidates, critical_sigma, product_chi2_drop, strongest_product};
use super::selection::{Selected, Selection, loss, with};
use super::trials::Trial;
use crate::diagnose::fit::{Fit, Progress};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{AGREED_SIGMA, CONFUSABLE_CHI2, LEAST_MENDED_SHARE, MOST_EFFECTS};
use crate::diagnose::weak_form::SignalProduct;

impl Selection<'_> {
    /// Adds the next effect; false when nothing further is significant.
    pub(super) fn add_next(&mut self, progress: Progress<'_>) -> bool {
        self.add_best(|_, _| true, progress)
    }

    /// Adds the best of the wanted effects; false when none is significant.
    pub(super) fn add_best(
        &mut self,
        is_wanted: impl Fn(&Fit<'_>, usize) -> bool,
        progress: Progress<'_>,
    ) -> bool {
        let fit = &self.fit;
        let is_added =
            |i: &&usize| fit.problem.priors[**i].is_none() && fit.problem.terms[**i].effect().is_some();
        if fit.active().iter().filter(is_added).count() >= MOST_EFFECTS {
            return false;
        }
        let trials = Candidates::of(fit).trials(&fit.free);
        let is_next = |trial: &Trial| is_wanted(fit, trial.score.term) && deserves_a_name(fit, trial);
        let Some(trial) = trials.into_iter().find(is_next) else { return false };
        let chi2_drop = trial.score.chi2_drop;
        let dispersion = fit.dispersion(fit.free.chi2 - chi2_drop);
        self.effects.push(Selected {
            term: trial.score.term,
            p_value: statistics::chi2_p(chi2_drop / dispersion, 1.0),
            mended_percent: None,
            confusable_with: vec![],
            like_product: None,
            worse_than_product: product_chi2_drop(fit, &fit.free) > chi2_drop + CONFUSABLE_CHI2 * dispersion,
        });
        self.fit = with(fit, &[], &trial, progress);
        true
    }

    /// Drops effects that those added later have made needless.
    pub(super) fn drop_needless(&mut self, progress: Progress<'_>) {
        while let Some(at) = self.first_needless() {
            self.drop_at(at, progress);
        }
    }

    fn first_needless(&self) -> Option<usize> {
        let fit = &self.fit;
        let dispersion = fit.dispersion(fit.free.chi2);
        let is_needless = |one: &Selected| {
            let needed = critical_sigma(fit, fit.constants(one.term)).powi(2);
            loss(fit, &[one.term]) / dispersion < needed
        };
        self.effects.iter().position(is_needless)
    }

    /// Drops effects that the pieces of the data do not agree upon: where the model stays incomplete, a good score
    /// alone may be the work of something else.
    pub(super) fn drop_doubtful(&mut self, progress: Progress<'_>) {
        while self.fit.is_incomplete() {
            let ratio =
                |one: &Selected| self.fit.estimate(one.term).map_or(0.0, |own| own.value.abs() / own.std);
            let ratios = self.effects.iter().map(ratio).enumerate();
            let weakest = ratios.min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((at, _)) = weakest.filter(|(_, ratio)| *ratio < AGREED_SIGMA) else { return };
            self.drop_at(at, progress);
        }
    }

    /// Names for each effect those candidates that would explain the data nearly as well in its place, and
    /// orders the effects by what the fit loses without them.
    pub(super) fn find_confusable(&mut self) {
        let fit = &self.fit;
        let dispersion = fit.dispersion(fit.free.chi2);
        let mut candidates = Candidates::of(fit);
        for one in &mut self.effects {
            let without = fit.solve_without(&[one.term]);
            let lost = without.chi2 - fit.free.chi2;
            let is_close = |trial: &Trial| lost - trial.score.chi2_drop < CONFUSABLE_CHI2 * dispersion;
            let rivals = candidates.trials(&without).into_iter().filter(is_close);
            let is_near =
                |(_, chi2_drop): &(SignalProduct, f64)| lost - chi2_drop < CONFUSABLE_CHI2 * dispersion;
            one.like_product = strongest_product(fit, &without).filter(is_near).map(|(product, _)| product);
            one.confusable_with =
                rivals.filter_map(|trial| fit.problem.terms[trial.score.term].effect()).collect();
        }
        self.effects.sort_by(|a, b| loss(fit, &[b.term]).total_cmp(&loss(fit, &[a.term])));
    }
}

/// Whether a candidate is significant, mends enough, and helps where it was not fitted.
fn deserves_a_name(fit: &Fit<'_>, trial: &Trial) -> bool {
    let chi2_drop = trial.score.chi2_drop;
    let is_significant = trial.beyond(fit.dispersion(fit.free.chi2 - chi2_drop)) >= 0.0;
    let mends_enough = !fit.is_incomplete() || chi2_drop / fit.free.chi2 >= LEAST_MENDED_SHARE;
    is_significant && mends_enough && fit.holds_out(trial.score.term, trial.constants)
}
