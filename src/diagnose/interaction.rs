//! Whether two effects that were found act on each other: the product of their terms, tested by its score.

use super::fit::Fit;
use super::outcome::Interaction;
use super::select::Named;
use super::term::Term;
use super::whiteness;

/// Share of diagnoses in which a product may be reported by chance.
const FALSE_PRODUCT_RATE: f64 = 1e-3;

/// The pairs whose product explains more than chance would.
pub(super) fn interactions(fit: &Fit<'_>, named: &[Named]) -> Vec<Interaction> {
    let pairs: Vec<(usize, usize)> = (0..named.len())
        .flat_map(|a| (a + 1..named.len()).map(move |b| (a, b)))
        .map(|(a, b)| (named[a].term, named[b].term))
        .collect();
    let needed = whiteness::bonferroni_sigma(FALSE_PRODUCT_RATE, pairs.len());
    let dispersion = fit.dispersion(fit.scoring.chi2);
    let test = |(a, b): &(usize, usize)| {
        let (one, other) = (fit.terms[*a].effect()?, fit.terms[*b].effect()?);
        // Constants that both have are alike in friction, the only ones that are shared.
        let shape =
            one.constants().iter().fold(fit.shapes[*b], |shape, p| shape.with(*p, fit.shapes[*a].get(*p)));
        let gain = fit.gain_of(Term::Product(one, other), shape)?;
        let sigma = (gain / dispersion).sqrt();
        let mended = 100.0 * gain / fit.scoring.chi2;
        let effects = [one.spec().id, other.spec().id];
        (sigma > needed).then_some(Interaction { effects, sigma, mended_percent: mended })
    };
    pairs.iter().filter_map(test).collect()
}
