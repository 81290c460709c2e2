//! Second thoughts: what was named first was named while other effects were still missing, and at the noise of an
//! incomplete model. Each named effect, and each pair, has to hold its place against its rivals again.

use super::Progress;
use super::fit::Fit;
use super::select::{self, CONFUSABLE_GAIN, Named, Trial};
use super::whiteness;

/// Swaps that one addition may set off.
const MOST_SWAPS: usize = 4;

/// Exchanges named effects for rivals that do better in their place, until none does.
pub(super) fn settle(fit: &mut Fit<'_>, named: &mut Vec<Named>, progress: Progress<'_>) {
    for _ in 0..MOST_SWAPS {
        if !swap_one(fit, named, progress) && !merge_two(fit, named, progress) {
            return;
        }
    }
}

/// Gives one effect's place to a rival that does better there; false when all keep theirs.
fn swap_one(fit: &mut Fit<'_>, named: &mut [Named], progress: Progress<'_>) -> bool {
    for one in named.iter_mut() {
        if !is_contested(fit, one.term) {
            continue;
        }
        let old = one.term;
        fit.set_aside(old, progress);
        let Some(best) = select::trials(fit, &fit.scoring).into_iter().next() else {
            fit.active.push(old);
            fit.refit(progress);
            continue;
        };
        select::take(fit, &best, progress);
        if best.score.term != old {
            replace(fit, one, &best);
            return true;
        }
    }
    false
}

/// Whether a rival comes close to an effect, as far as the present linearisation tells.
fn is_contested(fit: &Fit<'_>, term: usize) -> bool {
    let dispersion = fit.dispersion(fit.scoring.chi2);
    let without = fit.solve_without(&[term]);
    let own = (without.chi2 - fit.scoring.chi2) / dispersion;
    let own = own - select::critical_sigma(fit, fit.shapes[term]).powi(2);
    let best = select::rough_trials(fit, &without).first().map(|trial| trial.beyond(dispersion));
    best.is_some_and(|best| best > own - CONFUSABLE_GAIN)
}

/// Gives the places of two effects to a single one beside which neither is significant.
fn merge_two(fit: &mut Fit<'_>, named: &mut Vec<Named>, progress: Progress<'_>) -> bool {
    let dispersion = fit.dispersion(fit.scoring.chi2);
    let pairs = (0..named.len()).flat_map(|a| (a + 1..named.len()).map(move |b| (a, b)));
    for (a, b) in pairs {
        let terms = [named[a].term, named[b].term];
        let without = fit.solve_without(&terms);
        let lost = without.chi2 - fit.scoring.chi2;
        let needed = terms.map(|term| select::critical_sigma(fit, fit.shapes[term]).powi(2));
        let spare = dispersion * needed[0].max(needed[1]);
        let Some(best) = select::rough_trials(fit, &without).into_iter().next() else { continue };
        if lost - best.score.gain > spare {
            continue;
        }
        terms.iter().for_each(|term| fit.remove(*term));
        select::take(fit, &best, progress);
        replace(fit, &mut named[a], &best);
        named.remove(b);
        return true;
    }
    false
}

fn replace(fit: &Fit<'_>, one: &mut Named, best: &Trial) {
    let gain = best.score.gain / fit.dispersion(fit.scoring.chi2);
    *one = Named { term: best.score.term, p_value: whiteness::chi2_p(gain, 1.0), ..one.clone() };
}
