//! What a fit says without another pass over the data, as far as it is linear: with a further term, with effects held at zero, or with the
//! constants of a law where they are.

use super::gauss_newton::{Fit, bounded};
use super::regression::{Prior, Solution};
use super::score::{PartialColumn, Score};
use crate::diagnose::thresholds::ROUNDING;
use crate::diagnose::weak_form::Term;
use pitchleak_core::effects::EffectConstants;

impl Fit<'_> {
    /// What one further term would bring to a model; none where it can't be or would be unphysical.
    pub(crate) fn score(&self, model: &Solution, term: usize) -> Option<Score> {
        let score = self.regression.score(model, term)?;
        self.problem.allows(term, score.value).then_some(score)
    }

    /// The whitened column of a term with these constants.
    pub(crate) fn white_column(&self, term: Term, constants: EffectConstants<f64>) -> Vec<f64> {
        self.weak_form.white_column(term, constants)
    }

    /// Fall of the sum of squares by a term that is not among the candidates.
    pub(crate) fn chi2_drop(&self, term: Term, constants: EffectConstants<f64>) -> Option<f64> {
        let column = self.partial(&self.free, &self.white_column(term, constants))?;
        Some(self.regression.chi2_drop(&self.free, &column))
    }

    /// What a model's terms do not explain of a whitened column.
    pub(crate) fn partial(&self, model: &Solution, white: &[f64]) -> Option<PartialColumn> {
        self.regression.partial(model, white)
    }

    /// The fit with some effects held at zero: no new pass over the data.
    pub(crate) fn solve_without(&self, terms: &[usize]) -> Solution {
        self.regression.solve(self.active(), &self.priors_without(terms))
    }

    /// The priors with some effects held at zero.
    pub(super) fn priors_without(&self, terms: &[usize]) -> Vec<Option<Prior>> {
        let mut priors = self.problem.increments(&self.weak_form.at);
        for term in terms {
            let mean = -self.weak_form.at.value(self.problem.terms[*term]);
            priors[*term] = self.held_at(*term, mean).or(priors[*term]);
            self.hold_constants(*term, &mut priors);
        }
        priors
    }

    /// Holds the constants of a term's law where they are.
    fn hold_constants(&self, term: usize, priors: &mut [Option<Prior>]) {
        for constant in self.problem.constants_of(term) {
            priors[constant] = self.held_at(constant, 0.0).or(priors[constant]);
        }
    }

    /// What holds a fitted term so far from its linearisation.
    fn held_at(&self, term: usize, mean: f64) -> Option<Prior> {
        let own = self.estimate(term)?;
        Some(Prior { mean, std: ROUNDING.sqrt() * own.std })
    }

    /// A fitted term's standard deviation while the constants of its law stay: which law it is may be open where it is certain that there
    /// is one.
    pub(crate) fn std_with_law_held(&self, term: usize) -> Option<f64> {
        if !self.problem.constants_of(term).any(|constant| self.active().contains(&constant)) {
            return self.estimate(term).map(|own| own.std);
        }
        let mut priors = self.held_priors();
        self.hold_constants(term, &mut priors);
        let held = bounded(&self.regression, self.active(), &priors, self.assumed_error);
        held.terms.iter().position(|one| *one == term).map(|place| held.std[place])
    }

    /// By how much one further term would move the value of a fitted one: no new pass over the data.
    pub(crate) fn shift_by(&self, further: usize, term: usize) -> Option<f64> {
        let own = self.bounded.terms.iter().position(|one| *one == term)?;
        let terms = [self.active(), &[further]].concat();
        let with = self.regression.solve(&terms, &self.held_priors());
        Some(with.value.get(own)? - self.bounded.value[own])
    }

    /// Whether a further term with these constants also helps where it was not fitted.
    pub(crate) fn helps_held_out(&self, term: usize, constants: EffectConstants<f64>) -> bool {
        let priors = self.problem.increments(&self.weak_form.at);
        let column = || self.white_column(self.problem.terms[term], constants);
        let other = (constants != self.constants(term)).then(|| self.regression.with_column(term, column()));
        let regression = other.as_ref().unwrap_or(&self.regression);
        let mut with = self.active().to_vec();
        with.push(term);
        let before = regression.held_out(self.active(), &priors);
        let after = regression.held_out(&with, &priors);
        let better = before.iter().zip(&after).filter(|(b, a)| a < b).count();
        let sum: f64 = before.iter().zip(&after).map(|(b, a)| b - a).sum();
        sum > 0.0 && 2 * better > before.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fit::Problem;
    use crate::diagnose::testing::{declared, gas_beside};
    use pitchleak_core::Effect;

    /// Gas of which these pressures tell neither volume nor precharge apart is certain all the same.
    #[test]
    fn that_an_effect_is_there_may_be_certain_where_the_constants_of_its_law_are_not() {
        let traces = [gas_beside(0.0, 60)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let term = problem.place(Term::Effect(Effect::AccumulatorA)).expect("is a term");
        let usual = problem.usual(term);
        let plain = Fit::declared(&problem, &|| ());
        let sigmas = |fit: &Fit<'_>| {
            let own = fit.estimate(term).expect("is fitted");
            [own.value / own.std, own.value / fit.std_with_law_held(term).expect("is fitted")]
        };
        let [of_value, there] = sigmas(&plain.with(term, usual, &|| ()));
        assert!((of_value / there - 1.0).abs() < 1e-3 && there > 50.0, "{of_value} {there}");
        let unknown = EffectConstants { precharge_pa: 3e5, ..usual };
        let [of_value, there] = sigmas(&plain.with(term, unknown, &|| ()));
        assert!(of_value < 1.0 && there > 50.0, "{of_value} {there}");
    }
}
