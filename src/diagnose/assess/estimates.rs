//! What is said of leaks, of the bulk modulus and of each effect, as a fit has them, and what these traces can tell at all.

use super::adequacy::Judgement;
use super::confidence;
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::{
    Calibration, Doubt, FoundEffect, FoundLeakChange, LeakEstimate, LeakEstimates, Size,
};
use crate::diagnose::search::{self, Selected, Selection};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{
    EVIDENT_SIGMA, FEWEST_NUMBERS, IDENTIFIED_M3S, MOST_OF, SIGNIFICANT_SIGMA,
};
use crate::diagnose::weak_form::{Row, Term};
use pitchleak_core::effects::EffectKind;
use pitchleak_core::{Effect, Estimate, Leak};
use std::collections::BTreeMap;

fn estimate(fit: &Fit<'_>, term: Term) -> Estimate<f64> {
    let unknown = Estimate { value: 0.0, std: f64::INFINITY };
    fit.problem.place(term).and_then(|place| fit.estimate(place)).unwrap_or(unknown)
}

/// Leaks and bulk modulus, their standard deviations widened where the residual is more than the sensors' noise, and where other sets of
/// effects are as likely that would have them others.
pub(super) fn leaks(selection: &Selection<'_>) -> LeakEstimates {
    let fit = &selection.fit;
    let spread = |term: Term| fit.problem.place(term).map_or(0.0, |place| selection.spread(place));
    let widening = fit.dispersion(fit.bounded.chi2).sqrt();
    let rows = &fit.rows().rows;
    let mean = |value: &dyn Fn(&Row) -> f64| {
        (rows.iter().map(|row| value(row).abs()).sum::<f64>() / rows.len().max(1) as f64).max(1.0)
    };
    let leak = |leak, pressure_pa: f64| {
        let Estimate { value, std } = fit.mean_leak(leak);
        let std = (std * widening).hypot(spread(Term::of_leak(leak)));
        let mean = estimated(value, std, "m3/(s*Pa)", std * pressure_pa < IDENTIFIED_M3S);
        let is_possible =
            course(fit, leak).iter().all(|at| at.value >= -SIGNIFICANT_SIGMA * at.std * widening);
        LeakEstimate { physical: mean.physical && is_possible, ..mean }
    };
    let Estimate { value: compressibility, std } = estimate(fit, Term::InverseBulk);
    let bulk = 1.0 / compressibility;
    let prior = fit.problem.place(Term::InverseBulk).and_then(|place| fit.problem.priors[place]);
    let prior = prior.map_or(f64::INFINITY, |prior| prior.std);
    let std = if fit.held_compressibility.is_some() { prior } else { std };
    let std = (std * widening).hypot(spread(Term::InverseBulk));
    LeakEstimates {
        internal_leak_coefficient: leak(Leak::Internal, mean(&|row| row.mean.pa_pa - row.mean.pb_pa)),
        external_leak_a_coefficient: leak(Leak::ExternalA, mean(&|row| row.mean.pa_pa)),
        external_leak_b_coefficient: leak(Leak::ExternalB, mean(&|row| row.mean.pb_pa)),
        bulk_modulus: estimated(bulk, std * bulk * bulk, "Pa", std < MOST_OF * prior),
    }
}

/// A leak before and after each of its changes, and at both ends: between them it is steady or grows evenly.
pub(super) fn course(fit: &Fit<'_>, leak: Leak) -> Vec<Estimate<f64>> {
    let changes = fit.rows_of_change(leak).into_iter().flat_map(|row| [row.saturating_sub(1), row]);
    let rows = std::iter::once(0).chain(changes).chain([fit.rows().rows.len().saturating_sub(1)]);
    rows.map(|row| fit.leak_at(leak, row)).collect()
}

/// Every change of a leak, in order of time.
pub(crate) fn leak_changes(fit: &Fit<'_>) -> Vec<FoundLeakChange> {
    let rows = &fit.rows().rows;
    let of = |leak: Leak| {
        let change = move |row: usize| {
            let at = rows.get(row)?;
            let [before, after] = [row.saturating_sub(1), row].map(|row| fit.leak_at(leak, row));
            Some((
                row,
                FoundLeakChange { fault: leak.id(), trace: at.trace(), time_s: at.t_s, before, after },
            ))
        };
        fit.rows_of_change(leak).into_iter().filter_map(change)
    };
    let mut all: Vec<_> = Leak::ALL.into_iter().flat_map(of).collect();
    all.sort_by_key(|(row, _)| *row);
    all.into_iter().map(|(_, change)| change).collect()
}

/// A sentence for each leak that changes.
pub(super) fn change_notes(fit: &Fit<'_>) -> Vec<String> {
    let of = |leak: Leak| {
        let changes = fit.rows_of_change(leak).len();
        let times = if changes == 1 { "once".to_owned() } else { format!("{changes} times") };
        let label = leak.label();
        (changes > 0).then(|| {
            format!("the {label} leak changes {times} along the traces: its coefficient here is the mean")
        })
    };
    Leak::ALL.into_iter().filter_map(of).collect()
}

fn estimated(value: f64, std: f64, unit: &'static str, identifiable: bool) -> LeakEstimate {
    let half = statistics::ci95_sigma() * std;
    let ci95 = [value - half, value + half];
    LeakEstimate { value, std, ci95, unit, identifiable, physical: value >= -SIGNIFICANT_SIGMA * std }
}

/// Sentences about leaks that physics forbids.
pub(crate) fn negative_leaks(leaks: &LeakEstimates, model: &str) -> Vec<String> {
    [
        ("internal leak", leaks.internal_leak_coefficient),
        ("external leak A", leaks.external_leak_a_coefficient),
        ("external leak B", leaks.external_leak_b_coefficient),
    ]
    .iter()
    .filter(|(_, leak)| !leak.physical)
    .map(|(name, leak)| {
        let sigma = -leak.value / leak.std;
        if sigma > SIGNIFICANT_SIGMA {
            format!(
                "{model} needs a negative {name} ({sigma:.0} sigma below zero): evidence of a missing effect"
            )
        } else {
            format!("{model} needs an {name} that is below zero for some time: evidence of a missing effect")
        }
    })
    .collect()
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
    (own.std < MOST_OF * std && own.value > 0.0).then(|| {
        format!(
            "{id}: only its ratio to the bulk modulus is well known (to {:.1} %); the volume itself no better than the oil ({:.0} %)",
            percent(own.std),
            percent(std)
        )
    })
}

/// The effects of the answer.
pub(crate) fn found(selection: &Selection<'_>, judgement: &Judgement) -> Vec<FoundEffect> {
    let told = |one: &Selected| {
        let doubts = confidence::doubts(selection, one, judgement);
        found_one(selection, one, doubts)
    };
    selection.effects.iter().filter_map(told).collect()
}

fn found_one(selection: &Selection<'_>, one: &Selected, doubts: Vec<Doubt>) -> Option<FoundEffect> {
    let fit = &selection.fit;
    let effect = fit.problem.terms[one.term].effect()?;
    let Estimate { value, std } = fit.estimate(one.term)?;
    let std = std_with_oil(fit, one.term).unwrap_or(std).hypot(search::std_of_constants(fit, one.term));
    let spec = effect.spec();
    let rivals = rivals(one);
    let constants = fit.constants(one.term);
    let constants = effect.constants().iter().map(|own| (own.spec().id, constants.get(*own))).collect();
    Some(FoundEffect {
        id: spec.id,
        value,
        std: (std * fit.dispersion(fit.bounded.chi2).sqrt()).hypot(spread_over_sets(selection, one.term)),
        unit: spec.unit,
        probability: confidence::probability(one, &doubts),
        confident: doubts.is_empty(),
        doubt: doubts.first().map(|doubt| doubt.text.clone()),
        doubts,
        rmse_reduction_percent: one.mended_percent.unwrap_or(0.0),
        p_value: one.p_value,
        separated_by: separation(effect, &rivals),
        confusable_with: rivals.iter().map(|rival| rival.spec().id).collect(),
        constants,
        cause: spec.cause,
        remedy: spec.remedy,
    })
}

/// By how much an effect's value may be another with other effects: in the place of those that are named, or beside them one that these
/// traces neither name nor rule out. A second effect that is too weak for a name need not be absent.
pub(super) fn spread_over_sets(selection: &Selection<'_>, term: usize) -> f64 {
    let fit = &selection.fit;
    let least = SIGNIFICANT_SIGMA.powi(2) * fit.dispersion(fit.free.chi2);
    let is_possible =
        |further: &usize| fit.score(&fit.free, *further).is_some_and(|score| score.chi2_drop > least);
    let unnamed = search::open(fit).into_iter().filter(is_possible);
    let shifts = unnamed.filter_map(|further| fit.shift_by(further, term)).map(f64::abs);
    selection.spread(term).hypot(shifts.fold(0.0, f64::max))
}

/// Each effect that may stand in its place, once.
fn rivals(one: &Selected) -> Vec<Effect> {
    let mut rivals = vec![];
    for effect in one.rivals.iter().flat_map(|rival| &rival.effects) {
        if !rivals.contains(effect) {
            rivals.push(*effect);
        }
    }
    rivals
}

/// The measurements that tell an effect from its rivals: what shows each of them alone.
fn separation(effect: Effect, rivals: &[Effect]) -> Option<String> {
    let group = std::iter::once(&effect).chain(rivals);
    let measurements: Vec<_> = group.map(|one| one.spec().measurement).collect();
    (!rivals.is_empty()).then(|| measurements.join(" "))
}

/// The sensors' errors that the rig file declares possible, as the fit has them.
pub(crate) fn calibration(fit: &Fit<'_>) -> Vec<Calibration> {
    let known = |term: &usize| {
        fit.problem.priors[*term]?;
        let (spec, own) = (fit.problem.terms[*term].effect()?.spec(), fit.estimate(*term)?);
        Some(Calibration { id: spec.id, value: own.value, std: own.std, unit: spec.unit })
    };
    fit.active().iter().filter_map(known).collect()
}

/// Whether position or pressure do more than their noise.
pub(crate) fn is_excited(fit: &Fit<'_>) -> bool {
    let rows = &fit.rows().rows;
    if rows.len() < FEWEST_NUMBERS || fit.regression.count() < FEWEST_NUMBERS {
        return false;
    }
    let spread = |value: &dyn Fn(&Row) -> f64| {
        let mean = rows.iter().map(value).sum::<f64>() / rows.len() as f64;
        (rows.iter().map(|row| (value(row) - mean).powi(2)).sum::<f64>() / rows.len() as f64).sqrt()
    };
    let samples = rows.iter().map(|row| row.samples).min().unwrap_or(1) as f64;
    let noise = |std: f64| EVIDENT_SIGMA * std / samples.sqrt();
    spread(&|row| row.mean.x_m) > noise(fit.problem.sensors.position.noise_std)
        || spread(&|row| row.mean.pa_pa) > noise(fit.problem.sensors.pressure.noise_std)
        || spread(&|row| row.mean.pb_pa) > noise(fit.problem.sensors.pressure.noise_std)
}

/// Smallest size of each further effect that these traces would have shown.
pub(crate) fn detection_limits(fit: &Fit<'_>) -> BTreeMap<&'static str, Size> {
    let widening = fit.dispersion(fit.bounded.chi2).sqrt();
    let mut sizes = BTreeMap::new();
    for term in search::open(fit) {
        let (Some(effect), Some(score)) =
            (fit.problem.terms[term].effect(), fit.regression.score(&fit.free, term))
        else {
            continue;
        };
        let value = EVIDENT_SIGMA * score.std * widening;
        sizes.insert(effect.spec().id, Size { value, unit: effect.spec().unit });
    }
    sizes
}
