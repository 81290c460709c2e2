//! The effects that could be named next, and the score of each beside a model.

use crate::diagnose::fit::{Fit, PartialColumn, Score, Solution};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{CONSTANTS_TRIALS, FALSE_RATE};
use crate::diagnose::weak_form::Unlisted;
use pitchleak_core::effects::EffectConstants;

/// Places of the terms that could be named.
pub(crate) fn open(fit: &Fit<'_>) -> Vec<usize> {
    let terms = &fit.problem.terms;
    let is_open =
        |i: &usize| terms[*i].effect().is_some() && !fit.active().contains(i) && fit.regression.shows(*i);
    (0..terms.len()).filter(is_open).collect()
}

/// The size in σ that the score of a candidate with these constants needs.
pub(crate) fn critical_sigma(fit: &Fit<'_>, constants: EffectConstants<f64>) -> f64 {
    let problem = fit.problem;
    let count = problem.terms.iter().filter(|term| term.effect().is_some()).count();
    let trials = CONSTANTS_TRIALS.pow(problem.fitted_constants(constants) as u32);
    statistics::bonferroni_sigma(FALSE_RATE, count * trials)
}

/// Places of the products of signals that the table does not list, and by how much each would make a model's sum of squares fall; none
/// that is another sight of an effect `named`.
pub(super) fn unlisted<'f>(
    fit: &'f Fit<'_>,
    model: &'f Solution,
    named: &'f [usize],
) -> impl Iterator<Item = (usize, f64)> + 'f {
    let terms = &fit.problem.terms;
    let is_sight = |law: Unlisted| {
        named.iter().filter_map(|place| terms[*place].effect()).any(|effect| law.is_sight_of(effect))
    };
    let places =
        (0..terms.len()).filter(move |place| terms[*place].unlisted().is_some_and(|law| !is_sight(law)));
    places.filter_map(|place| Some((place, fit.score(model, place)?.chi2_drop)))
}

/// The strongest of them.
pub(crate) fn strongest_unlisted(
    fit: &Fit<'_>,
    model: &Solution,
    named: &[usize],
) -> Option<(Unlisted, f64)> {
    let (place, chi2_drop) = unlisted(fit, model, named).max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((fit.problem.terms[place].unlisted()?, chi2_drop))
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fit::Problem;
    use crate::diagnose::testing::{declared, sound};
    use pitchleak_core::effects::EffectConstant;

    /// A law with one more constant fits noise a little better, wherever it is looked for.
    #[test]
    fn each_constant_that_is_fitted_asks_for_more() {
        let (traces, declared) = ([sound(20)], declared());
        let problem = Problem::new(&traces, &declared, &[]);
        let fit = Fit::declared(&problem, &|| ());
        let usual = problem.usual_constants;
        let one = usual.with(EffectConstant::SlipSpeed, 2.0 * usual.slip_speed_mps);
        let two = one.with(EffectConstant::StribeckSpeed, 2.0 * usual.stribeck_speed_mps);
        let needed = [usual, one, two].map(|constants| critical_sigma(&fit, constants).powi(2));
        let dearer = [needed[1] - needed[0], needed[2] - needed[1]];
        // ln of the count of trials, twice.
        assert!(dearer.iter().all(|more| (4.0..8.0).contains(more)), "{needed:?}");
    }
}
