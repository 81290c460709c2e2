//! The sets of effects beside the one that is named: some of it gone, others in their place. In each place alone the right effect can look no
//! better than a wrong one as long as the others are wrong too; one effect can stand for two, and two for one.
//!
//! One Gram matrix says what every such set would leave, as far as it is linear about what is named. The nearest are fitted.

use super::candidates::{self, Candidates, critical_sigma, open};
use super::selection::{self, Other, Rival, Selected, Selection};
use crate::diagnose::fit::{Beyond, Fit, Progress, Solution};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{CURVED_SHARE, MOST_EXCHANGES, MOST_ROUNDS, SIGNIFICANT_SIGMA};
use crate::presence::ln_tail;
use pitchleak_core::Leak;
use pitchleak_core::effects::EffectConstants;

/// Some named effects gone, and others in their place.
#[derive(Clone, Debug)]
struct Exchange {
    gone: Vec<usize>,
    new: Vec<(usize, EffectConstants<f64>)>,
    /// How much more it leaves; the width of the noise is known of one that is fitted.
    left: Beyond,
    /// What the new effects have to bring beyond what those that go had to, as a sum of squares in that of the noise; of one that is
    /// fitted, with what leaks below zero cost.
    dearer: f64,
    /// The value of each term that it has; none before it is fitted.
    values: Vec<(usize, f64)>,
}

impl Exchange {
    /// The set that it makes of another one.
    fn instead_of(&self, named: &[usize]) -> Vec<usize> {
        let kept = named.iter().copied().filter(|term| !self.gone.contains(term));
        let mut all: Vec<usize> = kept.chain(self.new.iter().map(|(term, _)| *term)).collect();
        all.sort_unstable();
        all
    }

    /// Whether it is the same set, with other constants of a law.
    fn is_same_set(&self) -> bool {
        self.new.len() == self.gone.len() && self.new.iter().all(|(term, _)| self.gone.contains(term))
    }

    /// The same, each new law with the constants of the one that goes where it has them as well: how slowly friction turns is no news of
    /// another friction.
    fn inheriting(mut self, fit: &Fit<'_>) -> Self {
        let fitted = |term: &usize| {
            let effect = fit.problem.terms[*term].effect();
            effect.into_iter().flat_map(|effect| effect.fitted_constants())
        };
        let is_known = |term: &&usize| fit.constants(**term) != fit.problem.usual(**term);
        for (term, constants) in &mut self.new {
            for gone in self.gone.iter().filter(is_known).filter(|gone| *gone != term) {
                for own in fitted(term).filter(|own| fitted(gone).any(|other| other == *own)) {
                    *constants = constants.with(own, fit.constants(*gone).get(own));
                }
            }
        }
        self
    }

    /// By how much the set is the worse one: twice the ln of the odds against it, where the true readings are as likely anywhere on what the
    /// model allows.
    fn worse(&self, dispersion: f64) -> f64 {
        self.left.chi2 / dispersion + self.dearer
    }

    /// That, and the same where the true position and pressures are as likely anywhere and what the meters read follows from them. What is true
    /// lies between both, as the machine's motion is slow and the noise is not: what only one of them tells is not known.
    fn worse_by_either(&self, dispersion: f64) -> [f64; 2] {
        let worse = self.worse(dispersion);
        [worse, worse + self.left.width]
    }
}

/// Sets of effects that were named, each in the order of its terms.
pub(super) type Weighed = Vec<Vec<usize>>;

/// Gives the named effects to a set that does better, until none does; holds each against the sets without it, and orders them by what the
/// fit loses without them. Whether others were named. None that was named before is named again: about sets that are alike, each fit's own
/// noise finds another one better.
pub(super) fn weigh(all: &mut Selection<'_>, weighed: &mut Weighed, progress: Progress<'_>) -> bool {
    let mut has_changed = false;
    let mut exchanges = nearest(all, progress);
    for _ in 0..MOST_ROUNDS {
        let dispersion = all.fit.dispersion(all.fit.free.chi2);
        let named = all.named();
        let is_new = |one: &Exchange| !weighed.contains(&one.instead_of(&named));
        let may_name =
            |one: &Exchange| one.values.iter().all(|(term, value)| all.fit.problem.may_name(*term, *value));
        let is_better = |one: &&Exchange| one.worse(dispersion) < 0.0 && is_new(one) && may_name(one);
        let better = exchanges.iter().filter(is_better);
        let best = better.min_by(|a, b| a.worse(dispersion).total_cmp(&b.worse(dispersion))).cloned();
        let Some(best) = best else { break };
        weighed.push(named);
        take(all, &best, progress);
        has_changed = true;
        exchanges = nearest(all, progress);
    }
    hold_against(all, &exchanges, progress);
    let dispersion = all.fit.dispersion(all.fit.free.chi2);
    let other = |one: Exchange| Other { odds: (-0.5 * one.worse(dispersion)).exp(), values: one.values };
    all.others = exchanges.into_iter().map(other).collect();
    weighed.push(all.named());
    let fit = &all.fit;
    all.effects.sort_by(|a, b| selection::loss(fit, &[b.term]).total_cmp(&selection::loss(fit, &[a.term])));
    has_changed
}

/// Names the other set.
fn take(all: &mut Selection<'_>, other: &Exchange, progress: Progress<'_>) {
    all.fit = all.fit.changed(&other.gone, &other.new, progress);
    let mended = all.effects.iter().filter(|one| other.gone.contains(&one.term));
    let mended = mended.filter_map(|one| one.mended_percent).reduce(f64::max);
    all.effects.retain(|one| !other.gone.contains(&one.term));
    let dispersion = all.fit.dispersion(all.fit.free.chi2);
    for (term, _) in &other.new {
        let p_value = statistics::chi2_p(selection::loss(&all.fit, &[*term]) / dispersion, 1.0);
        all.effects.push(Selected { mended_percent: mended, ..Selected::new(*term, p_value) });
    }
}

/// The exchanges that come near what is named, each fitted.
fn nearest(all: &Selection<'_>, progress: Progress<'_>) -> Vec<Exchange> {
    let fit = &all.fit;
    let dispersion = fit.dispersion(fit.free.chi2);
    let named: Vec<usize> = all.effects.iter().map(|one| one.term).collect();
    let mut candidates = Candidates::of(fit);
    let mut in_place_of = |gone: Vec<usize>| {
        let without = fit.solve_without(&gone);
        let lost = without.chi2 - fit.free.chi2;
        let by_chance = SIGNIFICANT_SIGMA.powi(2);
        let margin = by_chance + CURVED_SHARE * lost / dispersion;
        let is_near =
            |one: &Exchange| one.worse(dispersion) < if one.is_same_set() { -by_chance } else { margin };
        let singles = of_one(&mut candidates, &without, &gone);
        let pairs = of_two(fit, &without, &gone);
        singles.into_iter().chain(pairs).filter(is_near).collect()
    };
    let near = some_of_each(subsets(&named).into_iter().map(&mut in_place_of).collect(), dispersion);
    let own_leaks = below_zero(fit);
    near.into_iter().filter_map(|one| fitted(fit, own_leaks, one.inheriting(fit), progress)).collect()
}

/// The most exchanges that are fitted: the nearest in each place, the second in each, and so on. One effect with many rivals leaves room for
/// those of the others.
fn some_of_each(places: Vec<Vec<Exchange>>, dispersion: f64) -> Vec<Exchange> {
    let nearer = |a: &Exchange, b: &Exchange| a.worse(dispersion).total_cmp(&b.worse(dispersion));
    let ranked = |mut own: Vec<Exchange>| {
        own.sort_by(nearer);
        own.into_iter().enumerate()
    };
    let mut all: Vec<(usize, Exchange)> = places.into_iter().flat_map(ranked).collect();
    all.sort_by(|(rank, one), (other_rank, other)| rank.cmp(other_rank).then_with(|| nearer(one, other)));
    all.into_iter().map(|(_, one)| one).take(MOST_EXCHANGES).collect()
}

/// All sets of these but the empty one.
fn subsets(of: &[usize]) -> Vec<Vec<usize>> {
    let chosen = |bits: usize| of.iter().enumerate().filter(move |(at, _)| bits >> at & 1 == 1);
    (1..1_usize << of.len()).map(|bits| chosen(bits).map(|(_, term)| *term).collect()).collect()
}

fn needed(fit: &Fit<'_>, constants: EffectConstants<f64>) -> f64 {
    critical_sigma(fit, constants).powi(2)
}

/// What those that go have to bring.
fn spared(fit: &Fit<'_>, gone: &[usize]) -> f64 {
    gone.iter().map(|term| needed(fit, fit.constants(*term))).sum()
}

/// Each candidate at its best in the place of those that are gone.
fn of_one(candidates: &mut Candidates<'_, '_>, without: &Solution, gone: &[usize]) -> Vec<Exchange> {
    let fit = candidates.fit;
    let lost = without.chi2 - fit.free.chi2;
    let spared = spared(fit, gone);
    let trials = candidates.trials(without, gone).into_iter();
    let exchange = |(term, constants, chi2_drop)| Exchange {
        gone: gone.to_vec(),
        new: vec![(term, constants)],
        left: Beyond { chi2: lost - chi2_drop, ..Beyond::default() },
        dearer: needed(fit, constants) - spared,
        values: vec![],
    };
    trials.map(|trial| exchange((trial.score.term, trial.constants, trial.score.chi2_drop))).collect()
}

/// Each pair of candidates in their place, neither of which would do alone.
fn of_two(fit: &Fit<'_>, without: &Solution, gone: &[usize]) -> Vec<Exchange> {
    let lost = without.chi2 - fit.free.chi2;
    let dispersion = fit.dispersion(fit.free.chi2);
    let terms = open(fit);
    let beside = fit.regression.beside(without, &terms);
    let needed: Vec<f64> = terms.iter().map(|term| needed(fit, fit.constants(*term))).collect();
    let spared = spared(fit, gone);
    let pair = |(a, b): (usize, usize)| {
        let both = beside.pair(a, b)?;
        let alone = [(a, beside.alone(a)), (b, beside.alone(b))];
        let is_for_both = alone.iter().all(|(at, drop)| {
            let of_other = needed[a] + needed[b] - needed[*at];
            both.chi2_drop - drop > of_other * dispersion
        });
        let allowed =
            fit.problem.allows(terms[a], both.values[0]) && fit.problem.allows(terms[b], both.values[1]);
        (is_for_both && allowed).then(|| Exchange {
            gone: gone.to_vec(),
            new: [a, b].map(|at| (terms[at], fit.constants(terms[at]))).to_vec(),
            left: Beyond { chi2: lost - both.chi2_drop, ..Beyond::default() },
            dearer: needed[a] + needed[b] - spared,
            values: vec![],
        })
    };
    let pairs = (0..terms.len()).flat_map(|a| (a + 1..terms.len()).map(move |b| (a, b)));
    pairs.filter_map(pair).collect()
}

/// The exchange once it is fitted, its laws' constants too, beside what the named set's own leaks cost. None where the other set is no
/// model: its fit does not settle, has an effect at the end of its range, or one that has nothing to do.
fn fitted(fit: &Fit<'_>, own_leaks: f64, one: Exchange, progress: Progress<'_>) -> Option<Exchange> {
    let other = fit.in_place_of(&one.gone, &one.new, progress);
    let is_lost = |term: &usize| {
        let is_effect = fit.problem.terms[*term].effect().is_some();
        is_effect && !one.gone.contains(term) && !other.active().contains(term)
    };
    let lost = fit.active().iter().copied().filter(is_lost);
    let gone: Vec<usize> = one.gone.iter().copied().chain(lost).collect();
    let new: Vec<_> = one.new.iter().map(|(term, _)| (*term, other.constants(*term))).collect();
    let dispersion = other.dispersion(other.free.chi2);
    let acts = |(term, constants): &(usize, EffectConstants<f64>)| {
        selection::loss(&other, &[*term]) > needed(fit, *constants) * dispersion
    };
    let is_settled = other.stands_still() || !fit.stands_still();
    let is_within = !is_at_bound(&other) || is_at_bound(fit);
    let is_model = is_settled && is_within && new.iter().all(acts);
    let brought: f64 = new.iter().map(|(_, constants)| needed(fit, *constants)).sum();
    let dearer = brought - spared(fit, &gone) + below_zero(&other) - own_leaks;
    let value = |term: &usize| Some((*term, other.estimate(*term)?.value));
    let values = other.active().iter().filter_map(value).collect();
    is_model.then(|| Exchange { gone, new, left: other.beyond(fit), dearer, values })
}

/// The leaks in their standard deviations, widened where the residual is more than noise.
fn leaks_in_sigma(fit: &Fit<'_>) -> impl Iterator<Item = f64> {
    let widening = fit.dispersion(fit.bounded.chi2).sqrt();
    let leaks = Leak::ALL.into_iter().map(|leak| fit.mean_leak(leak)).filter(|own| own.std > 0.0);
    leaks.map(move |own| own.value / (own.std * widening))
}

/// No leak lets oil in: twice the ln of the odds against a fit's leaks for it.
fn below_zero(fit: &Fit<'_>) -> f64 {
    leaks_in_sigma(fit).map(|sigma| -2.0 * ln_tail(-sigma)).sum()
}

/// Whether no leak is below zero by more than chance.
fn lets_no_oil_in(fit: &Fit<'_>) -> bool {
    leaks_in_sigma(fit).all(|sigma| sigma >= -SIGNIFICANT_SIGMA)
}

fn is_at_bound(fit: &Fit<'_>) -> bool {
    fit.active().iter().any(|term| fit.is_at_bound(*term))
}

/// Probability of one of several explanations, all that there are, each the worse one by so much.
fn share(worse: f64, all: &[f64]) -> f64 {
    1.0 / all.iter().map(|other| ((worse - other) / 2.0).exp()).sum::<f64>()
}

/// Gives each named effect its rivals and its probability among all that could stand in its place.
fn hold_against(all: &mut Selection<'_>, exchanges: &[Exchange], progress: Progress<'_>) {
    let fit = &all.fit;
    let dispersion = fit.dispersion(fit.free.chi2);
    let is_near = |worse: f64| worse < SIGNIFICANT_SIGMA.powi(2);
    for one in &mut all.effects {
        let is_against = |other: &&Exchange| {
            other.gone.contains(&one.term) && other.new.iter().all(|(term, _)| *term != one.term)
        };
        let against = exchanges.iter().filter(is_against);
        let unlisted = unlisted(fit, one.term, progress);
        let everything = [0, 1].map(|belief| {
            let others = against.clone().chain(&unlisted);
            let worse = others.map(|other| other.worse_by_either(dispersion)[belief]);
            worse.chain([0.0]).collect::<Vec<f64>>()
        });
        let of =
            |worse: [f64; 2]| f64::midpoint(share(worse[0], &everything[0]), share(worse[1], &everything[1]));
        let rival = |other: &Exchange| {
            let effects = other.new.iter().filter_map(|(term, _)| fit.problem.terms[*term].effect());
            Rival { effects: effects.collect(), probability: of(other.worse_by_either(dispersion)) }
        };
        one.probability = of([0.0; 2]);
        let is_rival = |other: &&Exchange| other.worse_by_either(dispersion).into_iter().any(is_near);
        let law = unlisted.as_ref().filter(is_rival).and_then(|law| law.new.first());
        one.unlisted_rival = law.and_then(|(place, _)| fit.problem.terms[*place].unlisted());
        one.rivals = against.clone().filter(is_rival).map(rival).collect();
    }
}

/// The likeliest law that the table does not list in an effect's place.
fn unlisted(fit: &Fit<'_>, term: usize, progress: Progress<'_>) -> Option<Exchange> {
    let dispersion = fit.dispersion(fit.free.chi2);
    let without = fit.solve_without(&[term]);
    let lost = without.chi2 - fit.free.chi2;
    let usual = fit.problem.usual_constants;
    let dearer = needed(fit, usual) - needed(fit, fit.constants(term));
    let law = |(place, chi2_drop): (usize, f64)| {
        let left = Beyond { chi2: lost - chi2_drop, ..Beyond::default() };
        Exchange { gone: vec![term], new: vec![(place, usual)], left, dearer, values: vec![] }
    };
    let mut laws: Vec<Exchange> = candidates::unlisted(fit, &without, &[term]).map(law).collect();
    laws.sort_by(|a, b| a.worse(dispersion).total_cmp(&b.worse(dispersion)));
    let is_possible = |law: &Exchange| {
        let is_near = law.worse(dispersion) < SIGNIFICANT_SIGMA.powi(2);
        !is_near || lets_no_oil_in(&fit.in_place_of(&law.gone, &law.new, progress))
    };
    laws.into_iter().find(is_possible)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fit::Problem;
    use crate::diagnose::testing::{TURBULENT, declared, past_the_seal, torn_seal};
    use crate::diagnose::weak_form::Term;
    use pitchleak_core::Effect;

    /// The right set may stand behind a dozen rivals of another effect, which a sort alone would have fitted in its stead.
    #[test]
    fn rivals_of_one_effect_leave_room_for_those_of_another() {
        let exchange = |gone: usize, chi2: f64| Exchange {
            gone: vec![gone],
            new: vec![],
            left: Beyond { chi2, width: 0.0 },
            dearer: 0.0,
            values: vec![],
        };
        let of_one = (0..2 * MOST_EXCHANGES).map(|rank| exchange(0, rank as f64)).collect();
        let kept = some_of_each(vec![of_one, vec![exchange(1, 2e3), exchange(1, 1e3)]], 1.0);
        let order: Vec<(usize, f64)> = kept.iter().take(5).map(|one| (one.gone[0], one.left.chi2)).collect();
        assert_eq!(order, [(0, 0.0), (1, 1e3), (0, 1.0), (1, 2e3), (0, 2.0)]);
        assert_eq!(kept.len(), MOST_EXCHANGES);
    }

    /// Flow against the pressure fits a turbulent leak the other way, which there is none of.
    #[test]
    fn a_set_with_an_effect_the_way_it_can_not_be_is_no_model() {
        let is_model = |size: f64| {
            let traces = [past_the_seal(size, 30)];
            let problem = Problem::new(&traces, &declared(), &[]);
            let [wrong, turbulent] = [Effect::FlowMeterGainA, TURBULENT.0]
                .map(|effect| problem.place(Term::Effect(effect)).expect("is a term"));
            let fit = Fit::declared(&problem, &|| ()).with(wrong, problem.usual_constants, &|| ());
            let exchange = Exchange {
                gone: vec![wrong],
                new: vec![(turbulent, problem.usual_constants)],
                left: Beyond::default(),
                dearer: 0.0,
                values: vec![],
            };
            fitted(&fit, below_zero(&fit), exchange, &|| ()).is_some()
        };
        assert!(is_model(TURBULENT.1) && !is_model(-TURBULENT.1));
    }

    #[test]
    fn what_only_one_belief_tells_is_not_sure() {
        let traces = [torn_seal(30)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let [named, other] = [TURBULENT.0, Effect::FlowMeterGainA]
            .map(|effect| problem.place(Term::Effect(effect)).expect("is a term"));
        let fit = Fit::declared(&problem, &|| ()).with(named, problem.usual_constants, &|| ());
        let mut all = Selection { effects: vec![Selected::new(named, 1.0)], ..Selection::none(fit) };
        let mut held = |chi2: f64, width: f64| {
            let (new, left) = (vec![(other, problem.usual_constants)], Beyond { chi2, width });
            hold_against(
                &mut all,
                &[Exchange { gone: vec![named], new, left, dearer: 0.0, values: vec![] }],
                &|| (),
            );
            (all.effects[0].probability, all.effects[0].rivals.len())
        };
        let (sure, rivals) = held(60.0, 10.0);
        assert!(sure > 0.99 && rivals == 0, "{sure}, {rivals} rivals");
        for (chi2, width) in [(60.0, -120.0), (-60.0, 120.0), (1e4, -1e6)] {
            let (half, rivals) = held(chi2, width);
            assert!((half - 0.5).abs() < 0.01 && rivals == 1, "{half}, {rivals} rivals");
        }
    }
}
