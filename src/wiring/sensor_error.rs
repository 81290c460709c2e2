//! A sensor whose gain or zero is off by more than anybody declared, or both meters' zeros.

use super::continuity::Continuity;
use super::explanation::{Evidence, Explanation};
use super::fit::Fit;
use super::mistake::Mistake;
use super::priors::Priors;
use super::readings::Readings;
use super::zeros::ZEROS;
use super::{APART, LEAST_DROP};
use crate::units::LPM_PER_M3S;
use pitchleak_core::{Leak, Parameter};

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
/// not; `None` where those do, or neither one error nor both meters' zeros explain it.
pub(crate) fn sensor_error(stretch: &impl Continuity) -> Option<Explanation> {
    let priors = Priors::declared(stretch.rig());
    let declared = stretch.fit(&priors)?;
    let score = |errors: &[Parameter]| {
        let off = errors.iter().fold(priors, |priors, error| priors.with_error(*error, stretch.rig()));
        let mut fits = fewer_leaks(off, errors).into_iter().filter_map(|priors| stretch.fit(&priors));
        let fit = fits.find(|fit| explains(fit, &declared, errors))?;
        Some((mistake(errors, &fit), fit))
    };
    let singles = ERRORS.iter().filter_map(|error| score(&[*error]));
    let mut found: Vec<_> = singles.chain(score(&ZEROS)).collect();
    found.sort_by(|(_, a), (_, b)| a.chi_square().total_cmp(&b.chi_square()));
    let (_, best) = *found.first()?;
    let most = best.chi_square() + APART * best.worst().max(1.0);
    found.retain(|(_, fit)| fit.chi_square() <= most);
    Some(Explanation {
        mistakes: found.iter().map(|(mistake, _)| *mistake).collect(),
        evidence: Evidence::Residual { before: declared.worst().sqrt(), after: best.worst().sqrt() },
    })
}

/// All leaks; beside zeros also none, and each alone: where P_A + P_B hardly changes, as with a symmetric valve, two leaks
/// at once, one of them negative, look like a zero, so that it stays unsure beside all three.
fn fewer_leaks(all: Priors, errors: &[Parameter]) -> Vec<Priors> {
    let mut suppositions = vec![all];
    if errors.iter().all(|error| ZEROS.contains(error)) {
        let only = |kept: Option<Leak>| {
            Leak::ALL.into_iter().filter(|leak| Some(*leak) != kept).fold(all, Priors::without)
        };
        suppositions.push(only(None));
        suppositions.extend(Leak::ALL.map(|leak| only(Some(leak))));
    }
    suppositions
}

fn explains(fit: &Fit, declared: &Fit, errors: &[Parameter]) -> bool {
    let drop = declared.chi_square() - fit.chi_square();
    let left = fit.worst().max(1.0);
    let near = NEAR.iter().any(|(most, contrast)| left <= *most && declared.worst() >= contrast * left);
    let mended = left <= NEAR[0].0 && declared.negative_leak_sigmas() >= NEGATIVE_SIGMAS;
    errors.iter().all(|error| is_sure(fit, *error))
        && drop >= LEAST_DROP * left
        && (near || mended)
        && fit.is_possible()
}

fn is_sure(fit: &Fit, error: Parameter) -> bool {
    let found = fit.parameter(error);
    found.value.abs() >= SURE_SIGMAS * found.std && (ZEROS.contains(&error) || found.value.abs() <= MOST_GAIN)
}

/// As a mistake of the readings; a gain g stands for readings 1/(1 − g) times too large.
fn mistake(errors: &[Parameter], fit: &Fit) -> Mistake {
    let thousandths = |value: f64| (value * 1e3).round() / 1e3;
    let factor = |gain: Parameter| thousandths(1.0 / (1.0 - fit.parameter(gain).value));
    let zero_m3s = |zero: Parameter| thousandths(fit.parameter(zero).value * LPM_PER_M3S) / LPM_PER_M3S;
    match errors {
        [Parameter::GainA] => Mistake::Scaled(Readings::FlowA, factor(Parameter::GainA)),
        [Parameter::GainB] => Mistake::Scaled(Readings::FlowB, factor(Parameter::GainB)),
        [Parameter::OffsetA] => Mistake::Zero(Readings::FlowA, zero_m3s(Parameter::OffsetA)),
        [Parameter::OffsetB] => Mistake::Zero(Readings::FlowB, zero_m3s(Parameter::OffsetB)),
        [Parameter::GainPosition] => Mistake::Scaled(Readings::Position, factor(Parameter::GainPosition)),
        _ => Mistake::Zeros(ZEROS.map(zero_m3s)),
    }
}
