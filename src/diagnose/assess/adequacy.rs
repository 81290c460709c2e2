//! Whether what is left can be the sensors' noise, and if not, where it shows.

use super::residual::whitened_residual;
use crate::diagnose::data::SensorCheck;
use crate::diagnose::equation::Equation;
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::EquationResidual;
use crate::diagnose::thresholds::{FEWEST_ROWS, LEAST_P, RESIDUAL_TESTS, SHAPE_BINS};
use crate::diagnose::weak_form::Nameless;
use crate::diagnose::{search, statistics};

fn name(equation: Equation) -> &'static str {
    match equation {
        Equation::ChamberA => "chamber A",
        Equation::ChamberB => "chamber B",
        Equation::Force => "the force balance",
    }
}

/// Reasons to believe that more than noise is left; none when the model is complete.
pub(crate) fn complaints(fit: &Fit<'_>) -> Vec<String> {
    let mut found = Vec::new();
    for (equation, ratio) in fit.noise_ratio().iter() {
        let name = name(equation);
        if *ratio > 1.0 {
            found.push(format!("what is left in {name} is {ratio:.2} times the sensors' noise"));
        } else if statistics::portmanteau_p(&fit.innovations(equation), 1.0).is_some_and(|p| p < LEAST_P) {
            found.push(format!("what is left in {name} is as small as noise but not white"));
        }
    }
    for equation in Equation::ALL {
        let names: Vec<_> = dependences(fit, equation).collect();
        if !names.is_empty() {
            found.push(format!("what is left in {} goes with {}", name(equation), names.join(", ")));
        }
    }
    let strongest = search::nameless_chi2_drop(fit).sqrt();
    if strongest > statistics::bonferroni_sigma(LEAST_P, Nameless::ALL.len()) {
        found.push(format!(
            "what is left follows a product of signals that no known effect makes ({strongest:.1} sigma)"
        ));
    }
    found
}

/// What a product of signals that no known effect makes would mend, where that is beyond chance.
pub(crate) fn nameless_excess(fit: &Fit<'_>) -> f64 {
    let strongest = search::nameless_chi2_drop(fit);
    let by_chance = statistics::bonferroni_sigma(LEAST_P, Nameless::ALL.len()).powi(2);
    if strongest > by_chance { strongest } else { 0.0 }
}

/// Variables on which what is left depends, in whatever shape: its means in bins of equal count against each, by χ².
fn dependences(fit: &Fit<'_>, equation: Equation) -> impl Iterator<Item = &'static str> {
    let residual = whitened_residual(fit, equation);
    residual.into_iter().flat_map(|residual| {
        let EquationResidual { white, variables, .. } = residual;
        let depends = move |(name, values): (&'static str, Vec<f64>)| {
            let p = binned_p(&white, &values)?;
            (p < LEAST_P / RESIDUAL_TESTS as f64).then_some(name)
        };
        variables.into_iter().filter_map(depends)
    })
}

/// Chance of means this large in bins of equal count; none where there are too few.
fn binned_p(white: &[f64], values: &[f64]) -> Option<f64> {
    let mut pairs: Vec<(f64, f64)> =
        values.iter().zip(white).filter(|(value, _)| value.is_finite()).map(|(v, w)| (*v, *w)).collect();
    let varies = pairs.iter().any(|pair| pair.0.to_bits() != pairs[0].0.to_bits());
    if !varies || pairs.len() < SHAPE_BINS * FEWEST_ROWS {
        return None;
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let bins = pairs.chunks(pairs.len().div_ceil(SHAPE_BINS));
    let of_bin = |bin: &[(f64, f64)]| bin.iter().map(|pair| pair.1).sum::<f64>().powi(2) / bin.len() as f64;
    let freedom = bins.len() as f64;
    Some(statistics::chi2_p(bins.map(of_bin).sum(), freedom))
}

/// A signal whose noise is no noise. Where several have the same, the machine does it: it is motion, and the balances hold.
pub(crate) fn ripples(checks: &[SensorCheck]) -> Vec<String> {
    let sentence = |check: &SensorCheck| {
        let ratio = check.found.std / check.declared_std;
        format!("{}: fast, regular noise {ratio:.1} times the declared one (a ripple)", check.name)
    };
    let found: Vec<&SensorCheck> = checks.iter().filter(|check| check.is_ripple()).collect();
    if let [only] = found[..]
        && only.is_its_own()
    {
        vec![sentence(only)]
    } else {
        vec![]
    }
}
