//! Whether what is left can be the sensors' noise, and if not, where it shows.

use super::residual::whitened_residual;
use crate::channels::ChannelFault;
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
        } else if fit.whiteness_p(equation).is_some_and(|p| p < LEAST_P) {
            found.push(format!("what is left in {name} is as small as noise but not white"));
        }
    }
    for equation in Equation::ALL {
        let names: Vec<_> = dependences(fit, equation).collect();
        if !names.is_empty() {
            found.push(format!("what is left in {} goes with {}", name(equation), names.join(", ")));
        }
    }
    if let Some((product, chi2_drop)) = beyond_chance(fit) {
        let (sigma, words) = (chi2_drop.sqrt(), product.words());
        found.push(format!(
            "what is left follows a product of signals that no known effect makes ({sigma:.1} sigma): {words}"
        ));
    }
    found
}

/// The product of signals that no known effect makes which what is left follows beyond chance.
fn beyond_chance(fit: &Fit<'_>) -> Option<(Nameless, f64)> {
    let by_chance = statistics::bonferroni_sigma(LEAST_P, Nameless::ALL.len()).powi(2);
    search::strongest_nameless(fit, &fit.free).filter(|(_, chi2_drop)| *chi2_drop > by_chance)
}

/// What such a product would mend.
pub(crate) fn nameless_excess(fit: &Fit<'_>) -> f64 {
    beyond_chance(fit).map_or(0.0, |(_, chi2_drop)| chi2_drop)
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

/// What is wrong with the sensors themselves, in sentences: no model of the machine can mend it.
pub(crate) fn failures(checks: &[SensorCheck], faults: &[ChannelFault]) -> Vec<String> {
    let told = |fault: &ChannelFault| format!("{}: {}", fault.text, fault.suggestion);
    ripples(checks).into_iter().chain(faults.iter().map(told)).collect()
}

/// A signal whose noise is no noise. Where several have the same, the machine does it: it is motion, and the balances hold.
fn ripples(checks: &[SensorCheck]) -> Vec<String> {
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
