//! One effect that shows in flows and forces may be two that show in one of them each. While friction is missing, the error of the forces
//! is large and they count for little: what mends part of both balances is then named before what mends one of them whole.

use super::selection::Selection;
use crate::diagnose::fit::{Fit, Progress};
use crate::diagnose::thresholds::FORCE_ONLY_SHARE;

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
    parts.effects.iter_mut().skip(all.effects.len() - 1).for_each(|one| one.worse_than_product = false);
    (are_named && !parts.fit.is_incomplete()).then_some(parts)
}

/// How much of a term's column stands in the forces.
fn force_share(fit: &Fit<'_>, term: usize) -> f64 {
    let squares = fit.squares(term);
    let all: f64 = squares.iter().map(|(_, square)| square).sum();
    if all > 0.0 { squares.force / all } else { 0.0 }
}
