//! Whether two effects that were found act on each other: the product of their terms, tested by its score.

use super::selection::Selected;
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::Interaction;
use crate::diagnose::statistics;
use crate::diagnose::thresholds::FALSE_PRODUCT_RATE;
use crate::diagnose::weak_form::Term;

/// The pairs whose product explains more than chance would.
pub(crate) fn interactions(fit: &Fit<'_>, selected: &[Selected]) -> Vec<Interaction> {
    let pairs: Vec<(usize, usize)> = (0..selected.len())
        .flat_map(|a| (a + 1..selected.len()).map(move |b| (a, b)))
        .map(|(a, b)| (selected[a].term, selected[b].term))
        .collect();
    let needed = statistics::bonferroni_sigma(FALSE_PRODUCT_RATE, pairs.len());
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
