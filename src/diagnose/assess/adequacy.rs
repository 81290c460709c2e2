//! Whether what is left can be the sensors' noise, and if not, where it shows.

use crate::diagnose::data::SensorCheck;
use crate::diagnose::equation::Equation;
use crate::diagnose::fit::Fit;
use crate::diagnose::thresholds::LEAST_P;
use crate::diagnose::weak_form::Nameless;
use crate::diagnose::{search, statistics};

/// Reasons to believe that more than noise is left; none when the model is complete.
pub(crate) fn complaints(fit: &Fit<'_>) -> Vec<String> {
    let mut found = Vec::new();
    for (equation, ratio) in fit.noise_ratio().iter() {
        let name = match equation {
            Equation::ChamberA => "chamber A",
            Equation::ChamberB => "chamber B",
            Equation::Force => "the force balance",
        };
        if *ratio > 1.0 {
            found.push(format!("what is left in {name} is {ratio:.2} times the sensors' noise"));
        } else if statistics::portmanteau_p(&fit.innovations(equation), 1.0).is_some_and(|p| p < LEAST_P) {
            found.push(format!("what is left in {name} is as small as noise but not white"));
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

/// Signals whose noise is no noise.
pub(crate) fn ripples(checks: &[SensorCheck]) -> Vec<String> {
    let sentence = |check: &SensorCheck| {
        let ratio = check.found.std / check.declared_std;
        format!("{}: fast, regular noise {ratio:.1} times the declared one (a ripple)", check.name)
    };
    checks.iter().filter(|check| check.is_ripple()).map(sentence).collect()
}
