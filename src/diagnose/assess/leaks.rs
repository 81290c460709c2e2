//! The declared model's own constants, as a fit has them.

use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::{LeakEstimate, LeakEstimates};
use crate::diagnose::thresholds::{CI95_SIGMA, IDENTIFIED_M3S, LEARNT_SHARE, NEGATIVE_SIGMA};
use crate::diagnose::weak_form::{Row, Term};
use pitchleak_core::Estimate;

fn estimate(fit: &Fit<'_>, term: Term) -> Estimate<f64> {
    let unknown = Estimate { value: 0.0, std: f64::INFINITY };
    fit.problem.place(term).and_then(|place| fit.estimate(place)).unwrap_or(unknown)
}

/// Leaks and bulk modulus, their standard deviations widened where the residual is more than the sensors' noise.
pub(super) fn leaks(fit: &Fit<'_>) -> LeakEstimates {
    let widening = fit.dispersion(fit.bounded.chi2).sqrt();
    let rows = &fit.rows().rows;
    let mean = |value: &dyn Fn(&Row) -> f64| {
        (rows.iter().map(|row| value(row).abs()).sum::<f64>() / rows.len().max(1) as f64).max(1.0)
    };
    let leak = |term, pressure_pa: f64| {
        let Estimate { value, std } = estimate(fit, term);
        let std = std * widening;
        estimated(value, std, "m3/(s*Pa)", std * pressure_pa < IDENTIFIED_M3S)
    };
    let Estimate { value: compressibility, std } = estimate(fit, Term::InverseBulk);
    let bulk = 1.0 / compressibility;
    let prior = fit.problem.place(Term::InverseBulk).and_then(|place| fit.problem.priors[place]);
    let prior = prior.map_or(f64::INFINITY, |prior| prior.std);
    let std = if fit.held_compressibility.is_some() { prior } else { std };
    LeakEstimates {
        internal_leak_coefficient: leak(Term::Internal, mean(&|row| row.mean.pa_pa - row.mean.pb_pa)),
        external_leak_a_coefficient: leak(Term::ExternalA, mean(&|row| row.mean.pa_pa)),
        external_leak_b_coefficient: leak(Term::ExternalB, mean(&|row| row.mean.pb_pa)),
        bulk_modulus: estimated(
            bulk,
            std * widening * bulk * bulk,
            "Pa",
            std * widening < LEARNT_SHARE * prior,
        ),
    }
}

fn estimated(value: f64, std: f64, unit: &'static str, identifiable: bool) -> LeakEstimate {
    let half = CI95_SIGMA * std;
    let ci95 = [value - half, value + half];
    LeakEstimate { value, std, ci95, unit, identifiable, physical: value >= -NEGATIVE_SIGMA * std }
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
        format!("{model} needs a negative {name} ({sigma:.0} sigma below zero): evidence of a missing effect")
    })
    .collect()
}
