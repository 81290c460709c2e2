//! Second thoughts: what was named first was named while other effects were still missing, and at the noise of an
//! incomplete model. Each named effect, and each pair, has to hold its place against its rivals again.
//!
//! One effect that shows in flows and forces may be two that show in one of them each. While friction is missing, the error of the forces
//! is large and they count for little: what mends part of both balances is then named before what mends one of them whole.

use super::candidates::{Candidates, critical_sigma};
use super::selection::{self, Selection};
use super::trials::Trial;
use crate::diagnose::fit::{Fit, Progress};
use crate::diagnose::thresholds::{CONFUSABLE_CHI2, FEWEST_TO_SIMPLIFY, FORCE_ONLY_SHARE, MOST_SWAPS};
use crate::diagnose::weak_form::Term;

/// Exchanges named effects for rivals that do better in their place, until none does.
pub(super) fn exchange_all(all: &mut Selection<'_>, progress: Progress<'_>) {
    for _ in 0..MOST_SWAPS {
        if !swap_one(all, progress) && !merge_two(all, progress) {
            return;
        }
    }
}

/// Gives one effect's place to a rival that does better there; false when all keep theirs.
fn swap_one(all: &mut Selection<'_>, progress: Progress<'_>) -> bool {
    let mut next = 0;
    while let Some(at) = first_contested(all, next) {
        let one = &mut all.effects[at];
        let vacated = all.fit.vacated(one.term);
        progress();
        let trials = Candidates::of(&vacated).trials(&vacated.free);
        if let Some(best) = trials.into_iter().find(|trial| trial.is_worth_a_name(&vacated)) {
            all.fit = selection::with(&vacated, &[], &best, progress);
            if best.score.term != one.term {
                one.stands_for(&all.fit, &best);
                return true;
            }
        }
        next = at + 1;
    }
    false
}

/// The first effect from `next` on to which a rival comes close, as far as the present linearisation tells.
fn first_contested(all: &Selection<'_>, next: usize) -> Option<usize> {
    let fit = &all.fit;
    let dispersion = fit.dispersion(fit.free.chi2);
    let mut candidates = Candidates::of(fit);
    let mut is_contested = |term: usize| {
        let without = fit.solve_without(&[term]);
        let own = (without.chi2 - fit.free.chi2) / dispersion;
        let own = own - critical_sigma(fit, fit.constants(term)).powi(2);
        let rivals = candidates.rough_trials(&without);
        rivals.first().is_some_and(|best| best.beyond(dispersion) > own - CONFUSABLE_CHI2)
    };
    (next..all.effects.len()).find(|at| is_contested(all.effects[*at].term))
}

/// Gives the places of two effects to a single one beside which neither is significant.
fn merge_two(all: &mut Selection<'_>, progress: Progress<'_>) -> bool {
    let count = all.effects.len();
    let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
    let Some(((a, b), best)) = mergeable(all, pairs) else { return false };
    let terms = [all.effects[a].term, all.effects[b].term];
    all.fit = selection::with(&all.fit, &terms, &best, progress);
    all.effects[a].stands_for(&all.fit, &best);
    all.effects.remove(b);
    true
}

/// The first pair that one candidate can stand for.
fn mergeable(
    all: &Selection<'_>,
    mut pairs: impl Iterator<Item = (usize, usize)>,
) -> Option<((usize, usize), Trial)> {
    let fit = &all.fit;
    let dispersion = fit.dispersion(fit.free.chi2);
    let mut candidates = Candidates::of(fit);
    pairs.find_map(|(a, b)| {
        let terms = [all.effects[a].term, all.effects[b].term];
        let without = fit.solve_without(&terms);
        let lost = without.chi2 - fit.free.chi2;
        let needed = terms.map(|term| critical_sigma(fit, fit.constants(term)).powi(2));
        let spare = dispersion * needed[0].max(needed[1]);
        let best = candidates.rough_trials(&without).into_iter().find(|trial| trial.is_worth_a_name(fit))?;
        (lost - best.score.chi2_drop <= spare).then_some(((a, b), best))
    })
}

/// Takes fewer effects where they do as well: a rival in the place of one may let two others give way to a single one. In each place
/// the right effect can look no better than a wrong one as long as the others are wrong too.
pub(super) fn simplify(all: &mut Selection<'_>, progress: Progress<'_>) {
    for at in 0..all.effects.len() {
        if all.effects.len() < FEWEST_TO_SIMPLIFY {
            return;
        }
        let one = all.effects[at].clone();
        let places = one.rivals.iter().filter_map(|(rival, _)| all.fit.problem.place(Term::Effect(*rival)));
        let simpler = places.filter(|place| !all.fit.active().contains(place)).find_map(|rival| {
            let new = [(rival, all.fit.constants(rival))];
            let mut trial =
                Selection { fit: all.fit.changed(&[one.term], &new, progress), effects: all.effects.clone() };
            trial.effects[at].term = rival;
            if !merge_two(&mut trial, progress) {
                return None;
            }
            trial.drop_needless(progress);
            does_as_well(&trial.fit, &all.fit).then_some(trial)
        });
        if let Some(simpler) = simpler {
            *all = simpler;
            return all.find_confusable(progress);
        }
    }
}

/// Whether a fit with fewer effects leaves no more than one of these would have to mend to be named.
fn does_as_well(simpler: &Fit<'_>, than: &Fit<'_>) -> bool {
    let spare = critical_sigma(than, than.problem.usual_constants).powi(2);
    let is_as_complete = than.is_incomplete() || !simpler.is_incomplete();
    is_as_complete && simpler.free.chi2 <= than.free.chi2 + spare * than.dispersion(than.free.chi2)
}

/// Gives the place of such an effect to two beside which the residual is noise; false where all keep theirs.
pub(super) fn split_one(all: &mut Selection<'_>, progress: Progress<'_>) -> bool {
    if !all.fit.is_incomplete() {
        return false;
    }
    let of_both = |at: &usize| {
        let share = force_share(&all.fit, all.effects[*at].term);
        share > 0.0 && share < FORCE_ONLY_SHARE
    };
    let parts = (0..all.effects.len()).filter(of_both).find_map(|at| parts(all, at, progress));
    parts.map(|parts| *all = parts).is_some()
}

/// The selection with two effects in the place of one, if that is complete.
fn parts<'a>(all: &Selection<'a>, at: usize, progress: Progress<'_>) -> Option<Selection<'a>> {
    let mut effects = all.effects.clone();
    let whole = effects.remove(at);
    let mut parts = Selection { fit: all.fit.without(whole.term, progress), effects };
    let is_part = |fit: &Fit<'_>, term: usize| force_share(fit, term) >= FORCE_ONLY_SHARE;
    let are_named = parts.add_best(is_part, progress) && parts.add_next(progress);
    // While its partner was missing, a product of signals did the work of that.
    parts.effects.iter_mut().skip(all.effects.len() - 1).for_each(|one| one.is_below_unlisted = false);
    (are_named && !parts.fit.is_incomplete()).then_some(parts)
}

/// How much of a term's column stands in the forces.
fn force_share(fit: &Fit<'_>, term: usize) -> f64 {
    let squares = fit.squares(term);
    let all: f64 = squares.iter().map(|(_, square)| square).sum();
    if all > 0.0 { squares.force / all } else { 0.0 }
}
