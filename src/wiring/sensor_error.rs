//! One sensor whose gain or zero is off by more than anybody declared.

use super::continuity::Continuity;
use super::explanation::{Evidence, Explanation};
use super::fit::Fit;
use super::mistake::Mistake;
use super::priors::Priors;
use super::readings::Readings;
use super::{APART, LEAST_DROP};
use crate::units::LPM_PER_M3S;
use pitchleak_core::Parameter;

/// What may be off, one at a time.
pub(super) const ERRORS: [Parameter; 5] =
    [Parameter::GainA, Parameter::GainB, Parameter::GainPosition, Parameter::OffsetA, Parameter::OffsetB];
/// An error of fewer standard deviations is none.
const SURE_SIGMAS: f64 = 5.0;
/// Larger gains are mistakes of the unit.
const MOST_GAIN: f64 = 0.4;
/// Mean square residual up to which an error explains a trace, and the declared sensors' over it: a leak of another law
/// than C P leaves more than noise, …
const NEAR: [(f64, f64); 2] = [(2.0, 2.0), (4.0, 10.0)];
/// … unless they make a leak negative by so many standard deviations.
const NEGATIVE_SIGMAS: f64 = 5.0;

/// The sensor whose gain or zero, off by more than the rig file says, explains the stretch where the declared sensors do
/// not; `None` where those do, or no single error explains it.
pub(crate) fn sensor_error(stretch: &impl Continuity) -> Option<Explanation> {
    let priors = Priors::declared(stretch.rig());
    let declared = stretch.fit(&priors)?;
    let score = |error: Parameter| {
        let fit = stretch.fit(&priors.with_error(error, stretch.rig()))?;
        explains(&fit, &declared, error).then_some((error, fit))
    };
    let mut found: Vec<_> = ERRORS.into_iter().filter_map(score).collect();
    found.sort_by(|(_, a), (_, b)| a.chi_square().total_cmp(&b.chi_square()));
    let (_, best) = *found.first()?;
    let most = best.chi_square() + APART * best.worst().max(1.0);
    found.retain(|(_, fit)| fit.chi_square() <= most);
    Some(Explanation {
        mistakes: found.iter().map(|(error, fit)| mistake(*error, fit.parameter(*error).value)).collect(),
        evidence: Evidence::Residual { before: declared.worst().sqrt(), after: best.worst().sqrt() },
    })
}

fn explains(fit: &Fit, declared: &Fit, error: Parameter) -> bool {
    let found = fit.parameter(error);
    let drop = declared.chi_square() - fit.chi_square();
    let left = fit.worst().max(1.0);
    let near = NEAR.iter().any(|(most, contrast)| left <= *most && declared.worst() >= contrast * left);
    let mended = left <= NEAR[0].0 && declared.negative_leak_sigmas() >= NEGATIVE_SIGMAS;
    let is_zero = matches!(error, Parameter::OffsetA | Parameter::OffsetB);
    found.value.abs() >= SURE_SIGMAS * found.std
        && (is_zero || found.value.abs() <= MOST_GAIN)
        && drop >= LEAST_DROP * left
        && (near || mended)
        && fit.is_possible()
}

/// As a mistake of the readings; a gain g stands for readings 1/(1 − g) times too large.
fn mistake(error: Parameter, value: f64) -> Mistake {
    let thousandths = |value: f64| (value * 1e3).round() / 1e3;
    let factor = thousandths(1.0 / (1.0 - value));
    let zero_m3s = thousandths(value * LPM_PER_M3S) / LPM_PER_M3S;
    match error {
        Parameter::GainA => Mistake::Scaled(Readings::FlowA, factor),
        Parameter::GainB => Mistake::Scaled(Readings::FlowB, factor),
        Parameter::OffsetA => Mistake::Zero(Readings::FlowA, zero_m3s),
        Parameter::OffsetB => Mistake::Zero(Readings::FlowB, zero_m3s),
        _ => Mistake::Scaled(Readings::Position, factor),
    }
}
