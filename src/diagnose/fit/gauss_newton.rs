//! Gauss–Newton on the generalised least-squares criterion: rows are rebuilt around the last estimate,
//! with sensor effects undone on the readings. Columns that carry the residual's own noise are corrected
//! for it (errors in variables: Söderström 2018, "Errors-in-Variables Methods in System Identification").

use super::problem::Problem;
use super::regression::{self, Prior, Regression, Solution};
use super::structure::Structure;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::thresholds::{MOST_ROUNDS, ROUNDING, SMALL_SHARE};
use crate::diagnose::weak_form::{Columns, Linearisation, Term, WeakForm, Whitening};
use pitchleak_core::Estimate;
use pitchleak_core::effects::EffectConstants;
use std::sync::OnceLock;

/// Called at every round of a fit.
pub type Progress<'a> = &'a dyn Fn();

/// A fit: the regression around one linearisation, and its solution. It never changes; another effect makes another fit.
pub(crate) struct Fit<'a> {
    pub(crate) problem: &'a Problem<'a>,
    structure: Structure,
    pub(super) weak_form: WeakForm<'a>,
    pub(crate) regression: Regression,
    /// With 1/β within the oil's range.
    pub(crate) bounded: Solution,
    /// With 1/β free to leave its range: what candidates are scored against, since the right one
    /// takes it back.
    pub(crate) free: Solution,
    /// The end of the oil's range at which 1/β is held, because the data would take it further.
    pub(crate) held_compressibility: Option<f64>,
    /// Variance of each equation's error that the regression was weighted with.
    pub(super) assumed_error: PerEquation<f64>,
    /// The same as it shows in this fit's residual, m⁶/s² and N²: zero while that can be the sensors' noise.
    pub(super) equation_error: PerEquation<f64>,
    /// Filled when it is asked for.
    pub(super) colour: PerEquation<OnceLock<Option<f64>>>,
}

/// By how much more one fit leaves than another. So an equation times a constant is the same equation.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Beyond {
    /// Squares of what is left over, each fit's at the noise that its own model gives; what the priors pay; and twice the ln of how much
    /// wider the equations' error makes that noise. A fit that leaves more than noise pays for it as a likelihood does.
    pub(crate) chi2: f64,
    /// Twice the ln of how wide the noise of the sensors alone is, in what the meters and the load cell read.
    pub(crate) width: f64,
}

impl<'a> Fit<'a> {
    /// Best fit of the declared model.
    pub(crate) fn declared(problem: &'a Problem<'a>, progress: Progress<'_>) -> Self {
        let constants = (0..problem.terms.len()).map(|term| problem.usual(term)).collect();
        let structure = Structure { active: problem.declared_terms(), constants };
        Self::settled(problem, structure, problem.start.clone(), PerEquation::default(), progress)
    }

    /// Best fit with one more effect.
    pub(crate) fn with(&self, term: usize, constants: EffectConstants<f64>, progress: Progress<'_>) -> Self {
        self.changed(&[], &[(term, constants)], progress)
    }

    /// Best fit without an effect.
    pub(crate) fn without(&self, term: usize, progress: Progress<'_>) -> Self {
        self.changed(&[term], &[], progress)
    }

    /// Best fit without the `old` effects and with the `new` ones.
    pub(crate) fn changed(
        &self,
        old: &[usize],
        new: &[(usize, EffectConstants<f64>)],
        progress: Progress<'_>,
    ) -> Self {
        let (structure, at) = self.exchanged(old, new);
        Self::settled(self.problem, structure, at, self.equation_error, progress)
    }

    /// Best fit without the `old` effects and with the `new` ones, with no columns but its own: see [`beyond`](Self::beyond).
    pub(crate) fn in_place_of(
        &self,
        old: &[usize],
        new: &[(usize, EffectConstants<f64>)],
        progress: Progress<'_>,
    ) -> Self {
        let (structure, at) = self.exchanged(old, new);
        Self::linearised(self.problem, &structure, (at, self.equation_error), progress)
    }

    /// How it does beside another fit of the same traces, on the rows that count for both.
    pub(crate) fn beyond(&self, other: &Self) -> Beyond {
        let counts = self.regression.counted.iter().zip(&other.regression.counted);
        let counts: Vec<bool> = counts.map(|(own, others)| *own && *others).collect();
        let (own, others) = (self.left(&counts), other.left(&counts));
        Beyond { chi2: own.chi2 + self.paid() - others.chi2 - other.paid(), width: own.width - others.width }
    }

    /// What it leaves of the entries that count.
    fn left(&self, counts: &[bool]) -> Beyond {
        let covariances = self.weak_form.covariances(self.assumed_error).counting(counts);
        let whitening = Whitening::of(&covariances, &self.assumed_error);
        let of_sensors = Whitening::of(&covariances, &PerEquation::default());
        let white = whitening.whiten(&regression::residual(self.rows(), &self.free));
        let widths = whitening.widths().zip(of_sensors.widths()).zip(self.weak_form.left_gains());
        let counted = white.iter().zip(widths).zip(counts).filter(|(_, counts)| **counts);
        counted.fold(Beyond::default(), |sum, ((value, ((width, of_sensors), gain)), _)| Beyond {
            chi2: sum.chi2 + value * value + 2.0 * (width / of_sensors).ln(),
            width: sum.width + 2.0 * (of_sensors / gain).ln(),
        })
    }

    /// What the priors add to the sum of squares.
    fn paid(&self) -> f64 {
        let priors = self.problem.increments(&self.weak_form.at);
        let terms = self.free.terms.iter().zip(&self.free.value);
        let of = |(term, value): (&usize, &f64)| {
            priors[*term].map_or(0.0, |prior| ((value - prior.mean) / prior.std).powi(2))
        };
        terms.map(of).sum()
    }

    /// The fit with an effect's place empty, at the noise of the fit with it: where its rivals are scored.
    pub(crate) fn vacated(&self, term: usize) -> Self {
        let (structure, at) = self.left_by(&[term]);
        let vacated = Self::around(
            &self.problem.every_place(&structure.active),
            self.problem,
            structure,
            (at, self.solved()),
            self.equation_error,
        );
        Self { equation_error: self.equation_error, ..vacated }
    }

    /// Structure and linearisation without the `old` effects and with the `new` ones, these where this linearisation foresees them if
    /// it has their columns, else at zero.
    fn exchanged(&self, old: &[usize], new: &[(usize, EffectConstants<f64>)]) -> (Structure, Linearisation) {
        let (structure, at) = self.left_by(old);
        let structure =
            new.iter().fold(structure, |all, (term, constants)| all.with(*term, *constants, self.problem));
        let has_column = |(term, constants): &(usize, EffectConstants<f64>)| {
            self.regression.shows(*term) && self.constants(*term) == *constants
        };
        if !new.iter().all(has_column) {
            return (structure, at);
        }
        let further: Vec<usize> = new.iter().map(|(term, _)| *term).collect();
        let foreseen = self.regression.solve(&[self.active(), &further].concat(), &self.priors_without(old));
        (structure, self.with_none_of(old, self.moved_by(&foreseen)))
    }

    /// Structure and linearisation once some effects are gone.
    fn left_by(&self, old: &[usize]) -> (Structure, Linearisation) {
        let without = |structure: Structure, term: &usize| structure.without(*term, self.problem);
        (old.iter().fold(self.structure.clone(), without), self.with_none_of(old, self.solved()))
    }

    /// A linearisation with some effects at zero.
    fn with_none_of(&self, old: &[usize], at: Linearisation) -> Linearisation {
        let gone =
            |at: Linearisation, term: &usize| at.with(self.problem.terms[*term], 0.0, &self.constants(*term));
        old.iter().fold(at, gone)
    }

    /// One linearisation and its solution, with the columns of some terms, all that are fitted among them, and the noise taken elsewhere.
    fn around(
        places: &[usize],
        problem: &'a Problem<'a>,
        structure: Structure,
        (at, noise_at): (Linearisation, Linearisation),
        assumed_error: PerEquation<f64>,
    ) -> Self {
        let columns = Columns { terms: &problem.terms, constants: &structure.constants, places };
        let traces = (problem.traces, &problem.unresolved[..]);
        let weak_form = WeakForm::new(traces, &problem.sensors, (at, noise_at), columns, assumed_error);
        Self::solving(weak_form, columns, problem, structure.clone(), assumed_error)
    }

    /// The solution of a weak form with these columns.
    fn solving(
        weak_form: WeakForm<'a>,
        columns: Columns<'_>,
        problem: &'a Problem<'a>,
        structure: Structure,
        assumed_error: PerEquation<f64>,
    ) -> Self {
        let WeakForm { at, rows, whitening, .. } = &weak_form;
        // An incomplete equation's error outweighs the noise of storage and friction, whose sizes are not yet to be believed.
        let is_noisy =
            |place: &usize| assumed_error == PerEquation::default() || problem.terms[*place].is_left_side();
        let noisy: Vec<usize> = columns.places.iter().copied().filter(is_noisy).collect();
        let noisy = Columns { places: &noisy, ..columns };
        let pieces = regression::pieces(rows);
        let shared = weak_form.shared_noise(&problem.white, noisy, &pieces);
        let regression = Regression::new((rows, pieces), whitening, &shared);
        let mut priors = problem.increments(at);
        let free = regression.solve(&structure.active, &priors);
        let held_compressibility = beyond_range(problem, at, &free);
        hold(&mut priors, problem, at, held_compressibility);
        let bounded = bounded(&regression, &structure.active, &priors, assumed_error);
        let equation_error = regression::equation_error(&weak_form, &regression, &bounded);
        Self {
            problem,
            structure,
            weak_form,
            regression,
            bounded,
            free,
            held_compressibility,
            assumed_error,
            equation_error,
            colour: PerEquation::default(),
        }
    }

    /// Linearises anew until a further time would change nothing that matters. Columns of what is not fitted cost
    /// most and matter to candidates only: they are built once, at the end.
    fn settled(
        problem: &'a Problem<'a>,
        structure: Structure,
        at: Linearisation,
        assumed_error: PerEquation<f64>,
        progress: Progress<'_>,
    ) -> Self {
        let fit = Self::linearised(problem, &structure, (at, assumed_error), progress);
        let structure = fit.structure.clone();
        let columns = Columns {
            terms: &problem.terms,
            constants: &structure.constants,
            places: &problem.every_place(&structure.active),
        };
        let weak_form = fit.weak_form.with_columns(columns);
        Self::solving(weak_form, columns, problem, structure.clone(), fit.assumed_error)
    }

    /// Linearises anew, with the equations' error as it shows, until that changes nothing; without the effects that turn out to be none.
    fn linearised(
        problem: &'a Problem<'a>,
        structure: &Structure,
        (at, assumed_error): (Linearisation, PerEquation<f64>),
        progress: Progress<'_>,
    ) -> Self {
        let round = |at: Linearisation, assumed_error: PerEquation<f64>| {
            let structure = structure.clone().standing_at(&at, problem);
            Self::around(&structure.active.clone(), problem, structure, (at.clone(), at), assumed_error)
        };
        let mut fit = round(at, assumed_error);
        for _ in 1..MOST_ROUNDS {
            if fit.has_converged() {
                break;
            }
            progress();
            fit = round(fit.solved(), fit.equation_error);
        }
        let none: Vec<usize> = fit.active().iter().copied().filter(|term| fit.is_none(*term)).collect();
        if none.is_empty() {
            return fit;
        }
        let (structure, at) = fit.left_by(&none);
        Self::linearised(problem, &structure, (at, fit.equation_error), progress)
    }

    /// Whether linearising once more would move every estimate by a small share of its standard deviation only, and
    /// the noise is as it was assumed.
    pub(crate) fn has_converged(&self) -> bool {
        let (assumed, found) = (self.noise_ratios(self.assumed_error), self.noise_ratio());
        let is_as_assumed =
            |equation: Equation| (found[equation] / assumed[equation] - 1.0).abs() <= SMALL_SHARE;
        self.stands_still() && Equation::ALL.into_iter().all(is_as_assumed)
    }

    /// Whether linearising once more would move every estimate by a small share of its standard deviation only.
    pub(crate) fn stands_still(&self) -> bool {
        let (at, solved) = (&self.weak_form.at, self.solved());
        let is_still = |(term, std): (&usize, &f64)| {
            let term = self.problem.terms[*term];
            (solved.known(term) - at.known(term)).abs() <= SMALL_SHARE * std
        };
        self.bounded.terms.iter().zip(&self.bounded.std).all(is_still)
    }

    /// The linearisation at the solution.
    pub(super) fn solved(&self) -> Linearisation {
        self.moved_by(&self.bounded)
    }

    /// The linearisation once terms have moved.
    fn moved_by(&self, solution: &Solution) -> Linearisation {
        let step = |at: Linearisation, (place, increment): (&usize, &f64)| {
            let term = self.problem.terms[*place];
            let value = at.value(term) + increment;
            at.with(term, value, &self.structure.constants[*place])
        };
        // A term stands before its constants.
        solution.terms.iter().zip(&solution.value).fold(self.weak_form.at.clone(), step)
    }

    /// Terms that are fitted.
    pub(crate) fn active(&self) -> &[usize] {
        &self.structure.active
    }

    /// The constants with which a term's column stands: those it was last fitted with.
    pub(crate) fn constants(&self, term: usize) -> EffectConstants<f64> {
        self.structure.constants[term]
    }

    /// The priors with 1/β held where it would leave its range.
    pub(super) fn held_priors(&self) -> Vec<Option<Prior>> {
        let mut priors = self.problem.increments(&self.weak_form.at);
        hold(&mut priors, self.problem, &self.weak_form.at, self.held_compressibility);
        priors
    }

    /// Value and standard deviation of a fitted term.
    pub(crate) fn estimate(&self, term: usize) -> Option<Estimate<f64>> {
        let at = self.bounded.terms.iter().position(|one| *one == term)?;
        let (lower, upper) = self.problem.terms[term].bounds();
        let value = self.weak_form.at.value(self.problem.terms[term]) + self.bounded.value[at];
        Some(Estimate { value: value.clamp(lower, upper), std: self.bounded.std[at] })
    }

    /// Whether physics leaves nothing of a fitted effect, which is not declared: it would be the way that it can't.
    fn is_none(&self, term: usize) -> bool {
        let is_effect = self.problem.terms[term].effect().is_some() && self.problem.priors[term].is_none();
        is_effect && self.estimate(term).is_some_and(|own| own.value.abs() <= 0.0)
    }

    /// Whether a fitted term lies at an end of what physics allows, or within its standard deviation of it.
    pub(crate) fn is_at_bound(&self, term: usize) -> bool {
        let (lower, upper) = self.problem.terms[term].bounds();
        // Zero is the end of one-sided effects, where they are not named.
        let ends = [lower, upper].map(|end| if end == 0.0 { f64::INFINITY } else { end });
        self.estimate(term).is_some_and(|own| ends.iter().any(|end| (own.value - end).abs() <= own.std))
    }

    /// Whether the residual is more than the sensors' noise.
    pub(crate) fn is_incomplete(&self) -> bool {
        self.equation_error.iter().any(|(_, error)| *error > 0.0)
    }

    /// Size of the residual as a multiple of the noise that the sensors bring.
    pub(crate) fn noise_ratio(&self) -> PerEquation<f64> {
        self.noise_ratios(self.equation_error)
    }

    fn noise_ratios(&self, equation_error: PerEquation<f64>) -> PerEquation<f64> {
        PerEquation::from_fn(|equation| {
            let rows = &self.weak_form.rows;
            let entry = rows.entries.iter().find(|entry| entry.equation == equation && rows.counts(entry));
            let variance = |error| {
                let noise = self.weak_form.noise(error);
                entry.map_or(1.0, |entry| noise.white_variance(entry.row, equation))
            };
            (variance(equation_error) / variance(PerEquation::default())).sqrt()
        })
    }

    /// How much of a term's whitened column stands in each equation, as sums of squares.
    pub(crate) fn squares(&self, term: usize) -> PerEquation<f64> {
        let mut squares = PerEquation::default();
        for (entry, value) in self.weak_form.rows.entries.iter().zip(&self.regression.columns[term]) {
            squares[entry.equation] += value * value;
        }
        squares
    }

    /// Standard deviation of the bulk modulus as a share of it: the prior's where the data would take it beyond its range.
    pub(crate) fn oil_share(&self) -> f64 {
        let oil = self.problem.place(Term::InverseBulk).and_then(|place| {
            let (own, prior) = (self.estimate(place)?, self.problem.priors[place]?);
            let std = if self.held_compressibility.is_some() { prior.std } else { own.std };
            Some(std / own.value)
        });
        oil.unwrap_or(0.0)
    }

    /// How much larger the residual is than the declared noise: 1 for a model that is complete.
    pub(crate) fn dispersion(&self, chi2: f64) -> f64 {
        (chi2 / self.regression.count().max(1) as f64).max(1.0)
    }
}

/// The solution; where an equation has an error, no surer than the pieces of the data agree.
pub(super) fn bounded(
    regression: &Regression,
    terms: &[usize],
    priors: &[Option<Prior>],
    assumed_error: PerEquation<f64>,
) -> Solution {
    let mut solution = regression.solve(terms, priors);
    if assumed_error != PerEquation::default() {
        let pieces = regression.jackknife(terms, priors);
        solution.std.iter_mut().zip(pieces).for_each(|(std, wide)| *std = std.max(wide));
    }
    solution
}

/// The end of the oil's range beyond which the data alone would take 1/β.
fn beyond_range(problem: &Problem<'_>, at: &Linearisation, free: &Solution) -> Option<f64> {
    let own = problem.place(Term::InverseBulk)?;
    let place = free.terms.iter().position(|term| *term == own)?;
    let value = at.value(Term::InverseBulk) + free.value[place];
    let (low, high) = at.compressibility;
    (!(low..=high).contains(&value)).then(|| value.clamp(low, high))
}

/// Holds 1/β at a value.
fn hold(priors: &mut [Option<Prior>], problem: &Problem<'_>, at: &Linearisation, held: Option<f64>) {
    if let (Some(held), Some(own)) = (held, problem.place(Term::InverseBulk)) {
        priors[own] = Some(Prior { mean: held - at.value(Term::InverseBulk), std: ROUNDING.sqrt() * held });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::{LEAKS, TURBULENT, declared, past_the_seal, seen, torn_seal};
    use pitchleak_core::Effect;
    use std::cell::Cell;

    #[test]
    fn with_an_effect_and_without_it_again_is_the_fit_before() {
        let traces = [torn_seal(30)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let plain = Fit::declared(&problem, &|| ());
        let term = problem.place(Term::Effect(TURBULENT.0)).expect("is a term");
        let with = plain.with(term, problem.usual_constants, &|| ());
        let again = with.without(term, &|| ());
        assert!(plain.has_converged() && with.has_converged() && again.has_converged());
        assert!(plain.is_incomplete() && !with.is_incomplete() && again.is_incomplete());
        assert!(with.estimate(term).is_some() && again.estimate(term).is_none());
        for term in plain.active() {
            let (before, after) = (plain.estimate(*term), again.estimate(*term));
            let (before, after) = before.zip(after).expect("is fitted");
            assert!(
                (before.value - after.value).abs() < 3.0 * SMALL_SHARE * before.std,
                "{before:?} {after:?}"
            );
        }
    }

    /// A turbulent leak lets none in; what is not fitted beside the leaks explains nothing.
    #[test]
    fn an_effect_that_would_be_the_way_that_it_can_not_is_not_fitted() {
        let has = |size: f64| {
            let traces = [past_the_seal(size, 30)];
            let problem = Problem::new(&traces, &declared(), &[]);
            let term = problem.place(Term::Effect(TURBULENT.0)).expect("is a term");
            let plain = Fit::declared(&problem, &|| ());
            let with = plain.with(term, problem.usual_constants, &|| ());
            (with.active().contains(&term), with.free.chi2 / plain.free.chi2)
        };
        assert!(has(TURBULENT.1).0);
        let (is_fitted, left) = has(-TURBULENT.1);
        assert!(!is_fitted && (left - 1.0).abs() < 0.01, "{left}");
    }

    /// Each is as large as its own noise: what tells them apart is how much of that is the equations' error.
    #[test]
    fn a_fit_that_leaves_more_than_noise_is_the_less_likely_one() {
        let traces = [torn_seal(30)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let plain = Fit::declared(&problem, &|| ());
        let term = problem.place(Term::Effect(TURBULENT.0)).expect("is a term");
        let with = plain.with(term, problem.usual_constants, &|| ());
        let per_entry = |one: &Fit<'_>| one.free.chi2 / one.regression.count() as f64;
        assert!((per_entry(&plain) - 1.0).abs() < 0.2 && (per_entry(&with) - 1.0).abs() < 0.2);
        let (worse, better) = (plain.beyond(&with).chi2, with.beyond(&plain).chi2);
        assert!(worse > with.regression.count() as f64 && (worse + better).abs() < 1e-6 * worse, "{worse}");
    }

    #[test]
    fn an_absurd_leak_brings_no_noise_that_excuses_it() {
        let traces = [torn_seal(30)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let constants = vec![problem.usual_constants; problem.terms.len()];
        let structure = Structure { active: problem.declared_terms(), constants };
        let places = structure.active.clone();
        let absurd =
            problem.start.clone().with(Term::Internal, 1e3 * LEAKS.internal, &problem.usual_constants);
        let incomplete = PerEquation { chamber_a: 1e-12, chamber_b: 1e-12, force: 0.0 };
        let fit = Fit::around(&places, &problem, structure, (absurd.clone(), absurd), incomplete);
        assert!(fit.equation_error.chamber_a > 0.0 && fit.equation_error.chamber_b > 0.0);
    }

    /// A meter known to a fifth beside readings that follow no equation: all of one times nothing leaves nothing, and is no fit.
    #[test]
    fn no_equation_is_explained_by_all_of_it_times_nothing() {
        let mut declared = declared();
        for flow in [&mut declared.sensors.flow_a, &mut declared.sensors.flow_b] {
            flow.gain_std = 0.2;
        }
        let time = Cell::new(0.0_f64);
        let traces = [seen(60, |sample| {
            let strays = 1e-5 * time.replace(time.get() + 0.01).sin();
            sample.qa_m3s = sample.qa_m3s.map(|q| 1.1 * q + strays);
        })];
        let problem = Problem::new(&traces, &declared, &[]);
        let place = |effect: Effect| problem.place(Term::Effect(effect)).expect("is a term");
        let (area, gain) = (place(Effect::AreaA), place(Effect::FlowMeterGainA));
        let fit = Fit::declared(&problem, &|| ()).with(area, problem.usual_constants, &|| ());
        let [area, gain] = [area, gain].map(|term| fit.estimate(term).expect("is fitted").value);
        let swept = (1.0 + area / declared.cylinder.area_a_m2) * (1.0 + gain);
        assert!(
            fit.is_incomplete() && (0.8..1.25).contains(&(1.0 + gain)) && (1.0..1.2).contains(&swept),
            "{area} {gain}"
        );
    }

    #[test]
    fn the_right_effect_is_found_in_its_size_beside_the_leaks() {
        let traces = [torn_seal(60)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let term = problem.place(Term::Effect(TURBULENT.0)).expect("is a term");
        let fit = Fit::declared(&problem, &|| ()).with(term, problem.usual_constants, &|| ());
        let terms = [
            (Term::Internal, LEAKS.internal),
            (Term::ExternalA, LEAKS.external_a),
            (Term::Effect(TURBULENT.0), TURBULENT.1),
        ];
        for (term, truth) in terms {
            let own = problem.place(term).and_then(|place| fit.estimate(place)).expect("is fitted");
            assert!((own.value - truth).abs() < 4.0 * own.std && own.std < 0.2 * truth, "{term:?}: {own:?}");
        }
    }

    #[test]
    fn a_vacated_place_scores_its_own_effect_as_high_as_the_fit_loses_without_it() {
        let traces = [torn_seal(30)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let term = problem.place(Term::Effect(TURBULENT.0)).expect("is a term");
        let fit = Fit::declared(&problem, &|| ()).with(term, problem.usual_constants, &|| ());
        let lost = fit.solve_without(&[term]).chi2 - fit.free.chi2;
        let vacated = fit.vacated(term);
        let score = vacated.score(&vacated.free, term).expect("shows");
        assert!((score.chi2_drop / lost - 1.0).abs() < 0.05, "{} of {lost}", score.chi2_drop);
        assert!(fit.active().contains(&term) && !vacated.active().contains(&term));
    }
}
