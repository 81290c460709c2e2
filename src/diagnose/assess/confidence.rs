//! Whether a named effect stands by itself: each is held against its rivals, against the residual, against the effects
//! beside it, and against what physics allows.

use super::adequacy;
use super::verdict::Judgement;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::fit::Fit;
use crate::diagnose::search::{self, Selected, Selection};
use crate::diagnose::thresholds::{
    AGREED_SIGMA, CONFUSABLE_CHI2, DOUBTED_LEAK_SIGMA, LEAST_SHARE_BESIDE, UNMENDED_SHARE,
};
use crate::diagnose::weak_form::Term;
use pitchleak_core::Effect;
use pitchleak_core::effects::EffectKind;

/// Reasons not to believe the name of an effect or its value; none when both can be believed.
pub(crate) fn doubts(selection: &Selection<'_>, one: &Selected, judgement: &Judgement) -> Option<String> {
    own_doubts(selection, one, judgement).or_else(|| doubtful_beside(selection, one, judgement))
}

/// In an equation that stays incomplete a doubtful effect may have taken some of this one's share.
fn doubtful_beside(selection: &Selection<'_>, one: &Selected, judgement: &Judgement) -> Option<String> {
    let fit = &selection.fit;
    let acts = acts_in(fit, one.term);
    let is_doubtful = |other: &&Selected| {
        let also = acts_in(fit, other.term);
        let is_shared =
            |equation: Equation| acts[equation] && also[equation] && judgement.left[equation] > 0.0;
        other.term != one.term
            && Equation::ALL.into_iter().any(is_shared)
            && own_doubts(selection, other, judgement).is_some()
    };
    let other = selection.effects.iter().find(is_doubtful)?;
    let id = fit.problem.terms[other.term].effect()?.spec().id;
    Some(format!(
        "the residual is more than noise where {id}, which is doubtful, may have taken some of its share"
    ))
}

fn own_doubts(selection: &Selection<'_>, one: &Selected, judgement: &Judgement) -> Option<String> {
    let fit = &selection.fit;
    let reasons: Vec<String> = [
        rivals(one),
        remainder(fit, one, judgement),
        unnamed(fit, one, judgement),
        law_error(selection, one, judgement),
        one_sided_friction(selection, one),
        bounds(fit, one),
        negative_mass(fit, one),
        replaceable(fit, one),
        leaks(fit, one),
        held_out(fit, one, judgement),
        sensors(&judgement.failures),
    ]
    .into_iter()
    .flatten()
    .collect();
    (!reasons.is_empty()).then(|| reasons.join("; "))
}

/// Wherever it acts, samples that were not fitted are met no better with all the effects than without any.
fn held_out(fit: &Fit<'_>, one: &Selected, judgement: &Judgement) -> Option<String> {
    let acts = acts_in(fit, one.term);
    let is_met_better = Equation::ALL.into_iter().any(|equation| acts[equation] && judgement.fell[equation]);
    (!is_met_better).then(|| "the error on held-out samples did not fall where it acts".to_owned())
}

/// A sensor fails by itself.
fn sensors(failures: &[String]) -> Option<String> {
    (!failures.is_empty()).then(|| "a sensor fails by itself, which may pass for an effect".to_owned())
}

/// In which equations an effect shows.
fn acts_in(fit: &Fit<'_>, term: usize) -> PerEquation<bool> {
    let squares = fit.squares(term);
    let all: f64 = squares.iter().map(|(_, square)| square).sum();
    PerEquation::from_fn(|equation| squares[equation] > 0.01 * all)
}

/// Others fit as well in its place.
fn rivals(one: &Selected) -> Option<String> {
    let ids: Vec<&str> = one.confusable_with.iter().map(|rival| rival.spec().id).collect();
    (!ids.is_empty()).then(|| format!("these traces do not tell it from {}", ids.join(", ")))
}

/// The residual where it acts is not small beside what it explains.
fn remainder(fit: &Fit<'_>, one: &Selected, judgement: &Judgement) -> Option<String> {
    if one.worse_than_product {
        return Some("a product of signals without a name fits better".to_owned());
    }
    if let Some(product) = one.like_product {
        return Some(format!("what no effect of the table makes fits as well: {}", product.words()));
    }
    let mut acts = acts_in(fit, one.term);
    if acts.force {
        // Forces feel a speed that comes from the flows: where those do not balance, it may be wrong.
        acts = PerEquation::from_fn(|_| true);
    }
    let there = |equation: Equation| if acts[equation] { judgement.left[equation] } else { 0.0 };
    let named = fit.problem.terms[one.term].effect().map(|effect| effect.spec().id);
    let left: f64 = Equation::ALL.into_iter().map(there).sum::<f64>()
        + adequacy::product_excess(fit)
        + judgement.mended_by_products(fit, named);
    let mended = search::loss(fit, &[one.term]);
    (left > UNMENDED_SHARE * (mended + left)).then(|| {
        "it explains part of the residual, but the rest is more than the sensors' noise: something else may be behind it, not to be \
         believed without a measurement of its own"
            .to_owned()
    })
}

/// The residual where it acts is more than noise, and a candidate too weak for a name explains some of it: the rest of
/// that one's share may stand under this one's name.
fn unnamed(fit: &Fit<'_>, one: &Selected, judgement: &Judgement) -> Option<String> {
    let dispersion = fit.dispersion(fit.free.chi2);
    let acts = acts_in(fit, one.term);
    let is_rival = |candidate: &usize| {
        let also = acts_in(fit, *candidate);
        let needed = search::critical_sigma(fit, fit.constants(*candidate)).powi(2) * dispersion;
        let is_near = |equation: Equation| acts[equation] && also[equation] && judgement.left[equation] > 0.0;
        Equation::ALL.into_iter().any(is_near)
            && fit.score(&fit.free, *candidate).is_some_and(|score| score.chi2_drop > needed)
    };
    let rival = search::open(fit).into_iter().find(is_rival)?;
    let id = fit.problem.terms[rival].effect()?.spec().id;
    Some(format!("the residual where it acts is more than noise, and {id} goes with that"))
}

/// It is as small as the error that another named effect, of the same equation, may have in its law. While something else is there that
/// no effect explains, that error is of unknown size: only the strongest effect of an equation is believed.
fn law_error(selection: &Selection<'_>, one: &Selected, judgement: &Judgement) -> Option<String> {
    let fit = &selection.fit;
    let acts = acts_in(fit, one.term);
    let shares_equation = |other: &&Selected| {
        let also = acts_in(fit, other.term);
        Equation::ALL.into_iter().any(|equation| acts[equation] && also[equation])
    };
    let own = search::loss(fit, &[one.term]);
    let others = selection.effects.iter().filter(|other| other.term != one.term);
    let of_others = others.filter(shares_equation).map(|other| (other, search::loss(fit, &[other.term])));
    let (large, mended) = of_others.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let id = fit.problem.terms[large.term].effect()?.spec().id;
    if own < LEAST_SHARE_BESIDE * mended {
        return Some(format!(
            "it is so small beside {id} that a small error in the law of that would pass for it"
        ));
    }
    (own < mended && !judgement.complaints.is_empty())
        .then(|| format!("something else is there, too, and it mends less than {id}: an error in the law of that may pass for it"))
}

/// Dry friction that is larger one way is, as long as the piston moves, dry friction and an offset of the load.
fn one_sided_friction(selection: &Selection<'_>, one: &Selected) -> Option<String> {
    let effect = |one: &Selected| selection.fit.problem.terms[one.term].effect();
    let is_dry = |effect: Effect| {
        matches!(effect, Effect::CoulombFriction | Effect::StribeckFriction | Effect::SealFriction)
    };
    let beside = |wanted: &dyn Fn(Effect) -> bool| selection.effects.iter().filter_map(effect).any(wanted);
    let own = effect(one)?;
    let both = if own == Effect::LoadOffset {
        beside(&is_dry)
    } else {
        is_dry(own) && beside(&|other| other == Effect::LoadOffset)
    };
    both.then(|| "a dry friction that is larger one way passes for dry friction and load_offset".to_owned())
}

/// Its value is at an end of what physics allows.
fn bounds(fit: &Fit<'_>, one: &Selected) -> Option<String> {
    fit.is_at_bound(one.term).then(|| "its value is at the end of what is possible".to_owned())
}

/// With it nothing would have a mass, or less.
fn negative_mass(fit: &Fit<'_>, one: &Selected) -> Option<String> {
    let own =
        fit.estimate(one.term).filter(|_| fit.problem.terms[one.term] == Term::Effect(Effect::AddedMass))?;
    let declared_kg = fit.problem.declared_cylinder().moving_mass_kg;
    (own.value - own.std < -declared_kg)
        .then(|| format!("with it hardly anything would move of the {declared_kg:.1} kg that are declared"))
}

/// A candidate too weak for a name, which these traces do not rule out either, would take most of it away.
fn replaceable(fit: &Fit<'_>, one: &Selected) -> Option<String> {
    let own = fit.estimate(one.term)?;
    let spread = own.std.hypot(unnamed_shift(fit, one.term));
    (own.value.abs() < AGREED_SIGMA * spread).then(|| {
        "beside an effect too weak for a name, which these traces do not rule out, it could be none"
            .to_owned()
    })
}

/// With it a leak comes out below zero.
fn leaks(fit: &Fit<'_>, one: &Selected) -> Option<String> {
    let acts = acts_in(fit, one.term);
    let impossible = |(term, name, equations): (Term, &str, &[Equation])| {
        let own = fit.estimate(fit.problem.place(term)?)?;
        let is_negative = own.value < -DOUBTED_LEAK_SIGMA * own.std;
        let is_near = equations.iter().any(|equation| acts[*equation]);
        (is_negative && is_near)
            .then(|| format!("with it the {name} is {:.1} sigma below zero", -own.value / own.std))
    };
    let (a, b) = (Equation::ChamberA, Equation::ChamberB);
    [
        (Term::Internal, "internal leak", &[a, b][..]),
        (Term::ExternalA, "external leak A", &[a][..]),
        (Term::ExternalB, "external leak B", &[b][..]),
    ]
    .into_iter()
    .find_map(impossible)
}

/// By how much a candidate that these traces neither name nor rule out would move an effect's value: a second effect that is too
/// weak for a name need not be absent.
pub(crate) fn unnamed_shift(fit: &Fit<'_>, term: usize) -> f64 {
    let dispersion = fit.dispersion(fit.free.chi2);
    let is_possible = |candidate: &usize| {
        let score = fit.score(&fit.free, *candidate);
        score.is_some_and(|score| score.chi2_drop > CONFUSABLE_CHI2 * dispersion)
    };
    let possible = search::open(fit).into_iter().filter(is_possible);
    possible.filter_map(|candidate| fit.shift_by(candidate, term)).map(f64::abs).fold(0.0, f64::max)
}

/// Standard deviation of an effect's value where it is only known over the bulk modulus, as a dead volume is; else none.
pub(crate) fn std_with_oil(fit: &Fit<'_>, term: usize) -> Option<f64> {
    let spec = fit.problem.terms[term].effect()?.spec();
    let is_volume = spec.kind == EffectKind::Storage && spec.constants.is_empty() && spec.unit == "m3";
    let own = fit.estimate(term).filter(|_| is_volume)?;
    Some(own.std.hypot(own.value * fit.oil_share()))
}

/// A sentence where only the ratio of a volume to the bulk modulus is known.
pub(crate) fn ratio_note(fit: &Fit<'_>, one: &Selected) -> Option<String> {
    let id = fit.problem.terms[one.term].effect()?.spec().id;
    let (own, std) = (fit.estimate(one.term)?, std_with_oil(fit, one.term)?);
    let percent = |std: f64| 100.0 * std / own.value;
    (own.std < 0.5 * std && own.value > 0.0).then(|| {
        format!(
            "{id}: only its ratio to the bulk modulus is well known (to {:.1} %); the volume itself no better than the oil ({:.0} %)",
            percent(own.std),
            percent(std)
        )
    })
}
