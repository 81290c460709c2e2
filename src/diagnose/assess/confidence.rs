//! Whether a named effect stands by itself: each is held against its rivals, against the residual, against the effects
//! beside it, and against what physics allows.

use super::adequacy::{self, Judgement};
use super::estimates;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::{Doubt, DoubtId};
use crate::diagnose::search::{self, Rival, Selected, Selection};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{
    DOUBTED_ODDS, NEGLIGIBLE_SHARE, SIGNIFICANT_SIGMA, SMALL_SHARE, UNMENDED_SHARE,
};
use crate::diagnose::weak_form::{Term, Unlisted};
use pitchleak_core::Leak;

/// Reasons not to believe the name of an effect or its value; none when both can be believed.
pub(crate) fn doubts(selection: &Selection<'_>, one: &Selected, judgement: &Judgement) -> Vec<Doubt> {
    let own = own_doubts(selection, one, judgement);
    if own.is_empty() { doubtful_neighbour(selection, one, judgement).into_iter().collect() } else { own }
}

/// The probability of an effect's name, with what speaks against it.
pub(crate) fn probability(one: &Selected, doubts: &[Doubt]) -> f64 {
    let is_weighed = |doubt: &Doubt| matches!(doubt.id, DoubtId::Rivals | DoubtId::UnlistedLaw);
    let share = if doubts.iter().all(is_weighed) { 1.0 } else { DOUBTED_ODDS };
    share * one.probability
}

fn doubt(id: DoubtId, text: impl Into<String>) -> Doubt {
    Doubt { id, text: text.into() }
}

/// In an equation that stays incomplete a doubtful effect may have taken some of this one's share.
fn doubtful_neighbour(selection: &Selection<'_>, one: &Selected, judgement: &Judgement) -> Option<Doubt> {
    let fit = &selection.fit;
    let acts = acts_in(fit, one.term);
    let is_doubtful = |other: &&Selected| {
        let also = acts_in(fit, other.term);
        let is_shared =
            |equation: Equation| acts[equation] && also[equation] && judgement.left[equation] > 0.0;
        other.term != one.term
            && Equation::ALL.into_iter().any(is_shared)
            && !own_doubts(selection, other, judgement).is_empty()
    };
    let other = selection.effects.iter().find(is_doubtful)?;
    let id = fit.problem.terms[other.term].effect()?.spec().id;
    Some(doubt(
        DoubtId::DoubtfulNeighbour,
        format!(
            "the residual is more than noise where {id}, which is doubtful, may have taken some of its share"
        ),
    ))
}

fn own_doubts(selection: &Selection<'_>, one: &Selected, judgement: &Judgement) -> Vec<Doubt> {
    let fit = &selection.fit;
    [
        rivals(one),
        unlisted(one).or_else(|| residual(fit, one, judgement)),
        weak_rival(fit, one, judgement),
        small_beside_other(selection, one, judgement),
        one_way_friction(selection, one),
        at_bound(fit, one),
        takes_all_declared(fit, one),
        may_be_none(selection, one),
        negative_leak(fit, one),
        held_out(fit, one, judgement),
        sensor_fault(&judgement.failures),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Wherever it acts, samples that were not fitted are met no better with all the effects than without any.
fn held_out(fit: &Fit<'_>, one: &Selected, judgement: &Judgement) -> Option<Doubt> {
    let acts = acts_in(fit, one.term);
    let is_met_better = Equation::ALL.into_iter().any(|equation| acts[equation] && judgement.fell[equation]);
    let text = "the error on held-out samples did not fall where it acts";
    (!is_met_better).then(|| doubt(DoubtId::HeldOut, text))
}

/// A sensor fails by itself.
fn sensor_fault(failures: &[String]) -> Option<Doubt> {
    let text = "a sensor fails by itself, which may pass for an effect";
    (!failures.is_empty()).then(|| doubt(DoubtId::SensorFault, text))
}

/// In which equations an effect shows.
fn acts_in(fit: &Fit<'_>, term: usize) -> PerEquation<bool> {
    let squares = fit.squares(term);
    let all: f64 = squares.iter().map(|(_, square)| square).sum();
    PerEquation::from_fn(|equation| squares[equation] > SMALL_SHARE * all)
}

/// Others fit as well in its place.
fn rivals(one: &Selected) -> Option<Doubt> {
    let together = |rival: &Rival| -> String {
        let ids: Vec<&str> = rival.effects.iter().map(|effect| effect.spec().id).collect();
        ids.join(" with ")
    };
    let rivals: Vec<String> = one.rivals.iter().map(together).collect();
    let text = || format!("these traces do not tell it from {}", rivals.join(", "));
    (!rivals.is_empty()).then(|| doubt(DoubtId::Rivals, text()))
}

/// A law that the table does not list fits as well, or better.
fn unlisted(one: &Selected) -> Option<Doubt> {
    let as_well =
        |product: Unlisted| format!("what no effect of the table makes fits as well: {}", product.words());
    let better = "a product of signals that the table does not list fits better".to_owned();
    let text = if one.is_below_unlisted { Some(better) } else { one.unlisted_rival.map(as_well) };
    text.map(|text| doubt(DoubtId::UnlistedLaw, text))
}

/// The residual where it acts is not small beside what it explains.
fn residual(fit: &Fit<'_>, one: &Selected, judgement: &Judgement) -> Option<Doubt> {
    let mut acts = acts_in(fit, one.term);
    if acts.force {
        // Forces feel a speed that comes from the flows: where those do not balance, it may be wrong.
        acts = PerEquation::from_fn(|_| true);
    }
    let there = |equation: Equation| if acts[equation] { judgement.left[equation] } else { 0.0 };
    let named = fit.problem.terms[one.term].effect().map(|effect| effect.spec().id);
    let left: f64 = Equation::ALL.into_iter().map(there).sum::<f64>()
        + adequacy::unlisted_excess(fit)
        + judgement.mended_by_products(fit, named);
    let mended = search::loss(fit, &[one.term]);
    let text = "it explains part of the residual, but the rest is more than the sensors' noise: something else may be behind it, not to be \
                believed without a measurement of its own";
    (left > UNMENDED_SHARE * (mended + left)).then(|| doubt(DoubtId::Residual, text))
}

/// The residual where it acts is more than noise, and a candidate too weak for a name explains some of it: the rest of
/// that one's share may stand under this one's name.
fn weak_rival(fit: &Fit<'_>, one: &Selected, judgement: &Judgement) -> Option<Doubt> {
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
    Some(doubt(
        DoubtId::WeakRival,
        format!("the residual where it acts is more than noise, and {id} goes with that"),
    ))
}

/// It is as small as the error that another named effect, of the same equation, may have in its law. While something else is there that
/// no effect explains, that error is of unknown size: only the strongest effect of an equation is believed.
fn small_beside_other(selection: &Selection<'_>, one: &Selected, judgement: &Judgement) -> Option<Doubt> {
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
    if own < NEGLIGIBLE_SHARE * mended {
        let text =
            format!("it is so small beside {id} that a small error in the law of that would pass for it");
        return Some(doubt(DoubtId::SmallBesideOther, text));
    }
    let text = || {
        format!(
            "something else is there, too, and it mends less than {id}: an error in the law of that may pass for it"
        )
    };
    (own < mended && !judgement.complaints.is_empty()).then(|| doubt(DoubtId::SmallBesideOther, text()))
}

/// Dry friction that is larger one way is, as long as the piston moves, dry friction and an offset of the load.
fn one_way_friction(selection: &Selection<'_>, one: &Selected) -> Option<Doubt> {
    let terms = &selection.fit.problem.terms;
    let named = |is: fn(Term) -> bool| {
        let mut all = selection.effects.iter().map(|other| terms[other.term]);
        all.find(|term| is(*term)).and_then(Term::effect)
    };
    let (offset, _) = named(Term::is_constant_force).zip(named(Term::is_dry_friction))?;
    let own = terms[one.term];
    let text =
        || format!("a dry friction that is larger one way passes for dry friction and {}", offset.spec().id);
    (own.is_constant_force() || own.is_dry_friction()).then(|| doubt(DoubtId::OneWayFriction, text()))
}

/// Its value is at an end of what physics allows, or a constant of its law at that of what these traces cover.
fn at_bound(fit: &Fit<'_>, one: &Selected) -> Option<Doubt> {
    let of_value =
        fit.is_at_bound(one.term).then(|| "its value is at the end of what is possible".to_owned());
    let of_constant = || {
        let constant = search::constant_at_end(fit, one.term)?.spec().id.replace('_', " ");
        Some(format!("its {constant} is at the end of what the traces cover, and may lie beyond"))
    };
    of_value.or_else(of_constant).map(|text| doubt(DoubtId::AtBound, text))
}

/// It would take away all that the rig file declares, such as the mass that moves.
fn takes_all_declared(fit: &Fit<'_>, one: &Selected) -> Option<Doubt> {
    let effect = fit.problem.terms[one.term].effect()?;
    let mut cylinder = *fit.problem.declared_cylinder();
    let declared = *effect.adds_to(&mut cylinder)?;
    let own = fit.estimate(one.term)?;
    let is_small = own.value - own.std < -declared;
    let text = || {
        format!(
            "with it hardly anything is left of the {declared:.1} {} that are declared",
            effect.spec().unit
        )
    };
    is_small.then(|| doubt(DoubtId::TakesAllDeclared, text()))
}

/// Sets of effects that these traces do not rule out either, one too weak for a name among them, would have it so much smaller that it could
/// be none.
fn may_be_none(selection: &Selection<'_>, one: &Selected) -> Option<Doubt> {
    let own = selection.fit.estimate(one.term)?;
    let std =
        selection.fit.std_with_law_held(one.term)?.hypot(estimates::spread_over_sets(selection, one.term));
    let text = "beside an effect too weak for a name, which these traces do not rule out, it could be none";
    (own.value.abs() < SIGNIFICANT_SIGMA * std).then(|| doubt(DoubtId::MayBeNone, text))
}

/// With it a leak comes out below zero, all of its 95 % interval.
fn negative_leak(fit: &Fit<'_>, one: &Selected) -> Option<Doubt> {
    let acts = acts_in(fit, one.term);
    let impossible = |(leak, equations): (Leak, &[Equation])| {
        let course = estimates::course(fit, leak).into_iter().filter(|at| at.std > 0.0);
        let sigma = course.map(|at| -at.value / at.std).fold(f64::NEG_INFINITY, f64::max);
        let is_near = equations.iter().any(|equation| acts[*equation]);
        let text = || format!("with it the {} leak is {sigma:.1} sigma below zero", leak.label());
        (sigma > statistics::ci95_sigma() && is_near).then(|| doubt(DoubtId::NegativeLeak, text()))
    };
    let (a, b) = (Equation::ChamberA, Equation::ChamberB);
    [(Leak::Internal, &[a, b][..]), (Leak::ExternalA, &[a][..]), (Leak::ExternalB, &[b][..])]
        .into_iter()
        .find_map(impossible)
}
