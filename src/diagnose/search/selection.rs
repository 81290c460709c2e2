//! The effects named so far: forward selection by the score test, with backward elimination, each step confirmed on data that it did
//! not fit; and whether two effects that were found act on each other.

use super::candidates::{Candidates, critical_sigma, strongest_unlisted};
use super::leak_changes;
use super::trials::{self, Trial};
use crate::diagnose::fit::{Fit, Progress};
use crate::diagnose::outcome::Interaction;
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{FALSE_RATE, MOST_EFFECTS, SIGNIFICANT_SIGMA, SMALL_SHARE};
use crate::diagnose::weak_form::{Term, Unlisted};
use pitchleak_core::Effect;

/// Effects that fit as well where a named one is gone, alone or with other named ones.
#[derive(Clone, Debug)]
pub(crate) struct Rival {
    pub(crate) effects: Vec<Effect>,
    /// Of these in its place.
    pub(crate) probability: f64,
}

/// One effect of the answer, by its place among the problem's terms.
#[derive(Clone, Debug)]
pub(crate) struct Selected {
    pub(crate) term: usize,
    /// Chance of so large a score without the effect.
    pub(crate) p_value: f64,
    /// Fall of the held-out error when it was added, percent; none before that is known.
    pub(crate) mended_percent: Option<f64>,
    /// What fits as well in its place.
    pub(crate) rivals: Vec<Rival>,
    /// Probability of it among all that could stand in its place.
    pub(crate) probability: f64,
    /// A product of signals that the table does not list and that fits nearly as well in its place.
    pub(crate) unlisted_rival: Option<Unlisted>,
    /// A product of signals that the table does not list would have fitted better.
    pub(crate) is_below_unlisted: bool,
}

impl Selected {
    /// One that has not been held against its rivals yet.
    pub(super) fn new(term: usize, p_value: f64) -> Self {
        Self {
            term,
            p_value,
            mended_percent: None,
            rivals: vec![],
            probability: 0.0,
            unlisted_rival: None,
            is_below_unlisted: false,
        }
    }
}

/// Another set of effects, fitted.
pub(super) struct Other {
    /// Against the set that is named.
    pub(super) odds: f64,
    /// Of each of its terms.
    pub(super) values: Vec<(usize, f64)>,
}

/// The effects named so far and the fit with them.
pub(crate) struct Selection<'a> {
    pub(crate) fit: Fit<'a>,
    pub(crate) effects: Vec<Selected>,
    /// The sets that come near in the place of some of these.
    pub(super) others: Vec<Other>,
}

impl<'a> Selection<'a> {
    /// No effect beside the declared model.
    pub(crate) fn none(declared: Fit<'a>) -> Self {
        Self { fit: declared, effects: vec![], others: vec![] }
    }

    pub(super) fn drop_at(&mut self, at: usize, progress: Progress<'_>) {
        let gone = self.effects.remove(at);
        self.fit = self.fit.without(gone.term, progress);
    }
}

/// By how much the sum of squares rises without some of the effects.
pub(crate) fn loss(fit: &Fit<'_>, terms: &[usize]) -> f64 {
    fit.solve_without(terms).chi2 - fit.free.chi2
}

/// The fit with a candidate, its constants fitted too.
fn with<'a>(fit: &Fit<'a>, trial: &Trial, progress: Progress<'_>) -> Fit<'a> {
    let term = trial.score.term;
    let with = fit.with(term, trial.constants, progress);
    let is_usual = trial.constants == fit.problem.usual(term);
    if is_usual { with } else { with_better_constants(&with, term, progress).unwrap_or(with) }
}

/// The fit with an effect's constants fitted again, now that what it leaves is no longer in the way; none where they stay.
fn with_better_constants<'a>(fit: &Fit<'a>, term: usize, progress: Progress<'_>) -> Option<Fit<'a>> {
    let vacated = fit.vacated(term);
    let mut candidates = Candidates::of(&vacated);
    let present = vacated.score(&vacated.free, term).map_or(0.0, |own| own.chi2_drop);
    let starts = trials::first_scores(&mut candidates, &vacated.free, term);
    let first = starts.into_iter().max_by(|a, b| a.0.chi2_drop.total_cmp(&b.0.chi2_drop))?;
    let (best, found) = trials::best_score(&mut candidates, &vacated.free, first);
    (best.chi2_drop > present).then(|| vacated.with(term, found, progress))
}

impl Selection<'_> {
    /// Whether it is the likelier one by more than chance, with what each of its effects and of the leaks' changes has to bring.
    pub(super) fn is_likelier_than(&self, other: &Self) -> bool {
        let needed = critical_sigma(&self.fit, self.fit.problem.usual_constants).powi(2);
        let more = self.size() as f64 - other.size() as f64;
        self.fit.beyond(&other.fit).chi2 + needed * more < -SIGNIFICANT_SIGMA.powi(2)
    }

    /// Its effects, in the order of their terms.
    pub(super) fn named(&self) -> Vec<usize> {
        let mut named: Vec<usize> = self.effects.iter().map(|one| one.term).collect();
        named.sort_unstable();
        named
    }

    /// By how much a term's value scatters over the sets that have it, each as likely as it is.
    pub(crate) fn spread(&self, term: usize) -> f64 {
        let Some(own) = self.fit.estimate(term) else { return 0.0 };
        let of = |other: &Other| {
            let (_, value) = other.values.iter().find(|(one, _)| *one == term)?;
            Some((other.odds, (value - own.value).powi(2)))
        };
        let (odds, squares) = self
            .others
            .iter()
            .filter_map(of)
            .fold((1.0, 0.0), |(all, sum), (odds, square)| (all + odds, sum + odds * square));
        (squares / odds).sqrt()
    }

    /// Effects, and changes of leaks.
    pub(super) fn size(&self) -> usize {
        self.effects.len() + self.fit.leak_changes().count()
    }

    /// Whether it explains as well what another does with more effects: from one trace to the next leaks are others oftener than an effect
    /// of where the piston was, or of time, is missing.
    pub(super) fn is_commoner_than(&self, other: &Self) -> bool {
        let lead = other.fit.free.chi2 - self.fit.free.chi2;
        self.effects.len() < other.effects.len() && lead > -SIGNIFICANT_SIGMA.powi(2)
    }

    /// Adds the next effect; false when nothing further is significant.
    pub(super) fn add_next(&mut self, progress: Progress<'_>) -> bool {
        let fit = &self.fit;
        let is_added =
            |i: &&usize| fit.problem.priors[**i].is_none() && fit.problem.terms[**i].effect().is_some();
        if fit.active().iter().filter(is_added).count() >= MOST_EFFECTS {
            return false;
        }
        let trials = Candidates::of(fit).trials(&fit.free, &[]);
        let mut worthy = trials.into_iter().filter(|trial| deserves_a_name(fit, trial));
        // One that only the end of its range stops is not what is missing, nor is one that takes another's place and does no better there.
        let stays = |trial: Trial| {
            let next = with(fit, &trial, progress);
            let term = trial.score.term;
            let is_within = next.active().contains(&term) && !next.is_at_bound(term);
            let keeps_all = self.effects.iter().all(|one| next.active().contains(&one.term));
            (is_within && (keeps_all || next.beyond(fit).chi2 < 0.0)).then_some((trial, next))
        };
        let Some((trial, next)) = worthy.find_map(stays) else { return false };
        let chi2_drop = trial.score.chi2_drop;
        let dispersion = fit.dispersion(fit.free.chi2 - chi2_drop);
        let p_value = statistics::chi2_p(chi2_drop / dispersion, 1.0);
        // A column may turn where the model stands, which is elsewhere once the effect is there.
        let gained = chi2_drop.max(-next.beyond(fit).chi2);
        let more = gained + SIGNIFICANT_SIGMA.powi(2) * dispersion;
        let named = [fit.active(), &[trial.score.term]].concat();
        let is_below_unlisted =
            strongest_unlisted(fit, &fit.free, &named).is_some_and(|(_, unlisted)| unlisted > more);
        self.effects.push(Selected { is_below_unlisted, ..Selected::new(trial.score.term, p_value) });
        self.fit = next;
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

    /// Drops changes of leaks that the effects have made needless.
    pub(super) fn drop_needless_changes(&mut self, progress: Progress<'_>) {
        let gone = leak_changes::needless(&self.fit);
        if !gone.is_empty() {
            self.fit = self.fit.changed(&gone, &[], progress);
        }
    }

    /// Drops effects that the pieces of the data do not agree upon: where the model stays incomplete, a good score
    /// alone may be the work of something else.
    pub(super) fn drop_doubtful(&mut self, progress: Progress<'_>) {
        while self.fit.is_incomplete() {
            let sigma = |one: &Selected| {
                let own = self.fit.estimate(one.term).zip(self.fit.std_with_law_held(one.term));
                own.map_or(0.0, |(own, std)| own.value.abs() / std)
            };
            let weakest = self.effects.iter().map(sigma).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((at, _)) = weakest.filter(|(_, sigma)| *sigma < SIGNIFICANT_SIGMA) else { return };
            self.drop_at(at, progress);
        }
    }
}

/// Whether a candidate is significant, mends enough, and helps where it was not fitted.
fn deserves_a_name(fit: &Fit<'_>, trial: &Trial) -> bool {
    let chi2_drop = trial.score.chi2_drop;
    let is_significant = trial.beyond(fit.dispersion(fit.free.chi2 - chi2_drop)) >= 0.0;
    let mends_enough = !fit.is_incomplete() || chi2_drop / fit.free.chi2 >= SMALL_SHARE;
    let term = trial.score.term;
    is_significant
        && mends_enough
        && fit.problem.may_name(term, trial.score.value)
        && fit.helps_held_out(term, trial.constants)
}

/// The pairs whose product explains more than chance would.
pub(crate) fn interactions(fit: &Fit<'_>, selected: &[Selected]) -> Vec<Interaction> {
    let pairs: Vec<(usize, usize)> = (0..selected.len())
        .flat_map(|a| (a + 1..selected.len()).map(move |b| (a, b)))
        .map(|(a, b)| (selected[a].term, selected[b].term))
        .collect();
    let needed = statistics::bonferroni_sigma(FALSE_RATE, pairs.len());
    let dispersion = fit.dispersion(fit.free.chi2);
    let test = |(a, b): &(usize, usize)| {
        let (one, other) = (fit.problem.terms[*a].effect()?, fit.problem.terms[*b].effect()?);
        // Constants that both have are alike in friction, the only ones that are shared.
        let of_one = fit.constants(*a);
        let constants =
            one.constants().iter().fold(fit.constants(*b), |all, own| all.with(*own, of_one.get(*own)));
        let chi2_drop = fit.chi2_drop(Term::Product(one, other), constants)?;
        let sigma = (chi2_drop / dispersion).sqrt();
        let mended = 100.0 * chi2_drop / fit.free.chi2;
        let effects = [one.spec().id, other.spec().id];
        (sigma > needed).then_some(Interaction { effects, sigma, mended_percent: mended })
    };
    pairs.iter().filter_map(test).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fit::Problem;
    use crate::diagnose::testing::{TURBULENT, declared, gas_beside, torn_seal};
    use pitchleak_core::effects::EffectConstants;

    /// Of two sets that are as likely, each value lies half their distance from the mean of both; of the named one's side it is the root
    /// of half its square. A set without the term says nothing.
    #[test]
    fn a_value_scatters_over_the_sets_that_have_it() {
        let traces = [torn_seal(30)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let term = problem.place(Term::Effect(TURBULENT.0)).expect("is a term");
        let fit = Fit::declared(&problem, &|| ()).with(term, problem.usual_constants, &|| ());
        let own = fit.estimate(term).expect("is fitted").value;
        let mut all = Selection::none(fit);
        assert!(all.spread(term) <= 0.0);
        all.others = vec![
            Other { odds: 1.0, values: vec![(term, 3.0 * own)] },
            Other { odds: 1.0, values: vec![(term + 1, 7.0)] },
        ];
        assert!((all.spread(term) / own - 2.0_f64.sqrt()).abs() < 1e-12);
    }

    /// What else is missing leaves gas in doubt of its law, not of its being there.
    #[test]
    fn an_effect_of_unknown_constants_is_not_dropped_for_them() {
        let traces = [gas_beside(1e-6, 60)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let term = problem.place(Term::Effect(Effect::AccumulatorA)).expect("is a term");
        let unknown = EffectConstants { precharge_pa: 3e5, ..problem.usual(term) };
        let fit = Fit::declared(&problem, &|| ()).with(term, unknown, &|| ());
        let mut all = Selection { effects: vec![Selected::new(term, 1.0)], ..Selection::none(fit) };
        assert!(all.fit.is_incomplete());
        all.drop_doubtful(&|| ());
        assert_eq!(all.named(), [term]);
    }
}
