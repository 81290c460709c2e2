//! Whether the residual can be the sensors' noise, and if not, where it shows.

use super::residual::whitened_residual;
use crate::channels::ChannelFault;
use crate::diagnose::data::SensorCheck;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::{EquationResidual, Interaction, ModelFit};
use crate::diagnose::search::Selection;
use crate::diagnose::statistics::LEAST_P;
use crate::diagnose::thresholds::{BINS, FEWEST_NUMBERS, MOST_EFFECTS, PORTMANTEAU_LAGS};
use crate::diagnose::weak_form::{RESIDUAL_TESTS, Unlisted};
use crate::diagnose::{search, statistics};

fn name(equation: Equation) -> &'static str {
    match equation {
        Equation::ChamberA => "chamber A",
        Equation::ChamberB => "chamber B",
        Equation::Force => "the force balance",
    }
}

/// The residual of an equation beyond noise, by what of the sum of squares a model that knew of it would mend: zero where noise may be
/// all that is left.
struct Leftover {
    /// Size in that of the sensors' noise.
    noise_ratio: f64,
    by_size: f64,
    by_colour: f64,
    /// By each variable that it goes with.
    by_variable: Vec<(&'static str, f64)>,
}

impl Leftover {
    fn of(fit: &Fit<'_>, equation: Equation) -> Self {
        let noise_ratio = fit.noise_ratio()[equation];
        let count = fit.innovations(equation).len() as f64;
        let is_coloured = |chi2: &f64| statistics::colour_p(*chi2) < LEAST_P;
        let colour = fit.colour(equation).filter(is_coloured);
        Self {
            noise_ratio,
            by_size: count * (1.0 - noise_ratio.max(1.0).powi(-2)),
            by_colour: colour.map_or(0.0, |chi2| chi2 - PORTMANTEAU_LAGS as f64),
            by_variable: dependences(fit, equation).collect(),
        }
    }

    /// Three views of one thing: the largest counts.
    fn most(&self) -> f64 {
        self.by_variable.iter().map(|(_, chi2)| *chi2).fold(self.by_size.max(self.by_colour), f64::max)
    }
}

/// What speaks against a model.
pub(crate) struct Inadequacy {
    /// In sentences; none when the model is complete.
    pub(crate) complaints: Vec<String>,
    /// The residual of each equation beyond noise, as a part of the sum of squares.
    pub(crate) left: PerEquation<f64>,
}

/// Reasons to believe that the residual is more than noise.
pub(crate) fn inadequacy(fit: &Fit<'_>) -> Inadequacy {
    let left = PerEquation::from_fn(|equation| Leftover::of(fit, equation));
    let mut complaints = Vec::new();
    for (equation, left) in left.iter() {
        let (name, ratio) = (name(equation), left.noise_ratio);
        if ratio > 1.0 {
            complaints.push(format!("the residual of {name} is {ratio:.2} times the sensors' noise"));
        } else if left.by_colour > 0.0 {
            complaints.push(format!("the residual of {name} is as small as noise but not white"));
        }
    }
    for (equation, left) in left.iter().filter(|(_, left)| !left.by_variable.is_empty()) {
        let names: Vec<_> = left.by_variable.iter().map(|(name, _)| *name).collect();
        complaints.push(format!("the residual of {} goes with {}", name(equation), names.join(", ")));
    }
    if let Some((product, chi2_drop)) = beyond_chance(fit) {
        let (sigma, words) = (chi2_drop.sqrt(), product.words());
        complaints.push(format!(
            "the residual follows a product of signals that no known effect makes ({sigma:.1} sigma): {words}"
        ));
    }
    Inadequacy { complaints, left: PerEquation::from_fn(|equation| left[equation].most()) }
}

/// The product of signals that no known effect makes which the residual follows beyond chance.
fn beyond_chance(fit: &Fit<'_>) -> Option<(Unlisted, f64)> {
    let by_chance = statistics::bonferroni_sigma(LEAST_P, Unlisted::ALL.len()).powi(2);
    search::strongest_unlisted(fit, &fit.free, fit.active()).filter(|(_, chi2_drop)| *chi2_drop > by_chance)
}

/// What such a product would mend.
pub(crate) fn unlisted_excess(fit: &Fit<'_>) -> f64 {
    beyond_chance(fit).map_or(0.0, |(_, chi2_drop)| chi2_drop)
}

/// Variables on which the residual depends, in whatever shape, and what their shape would mend: by its means in bins of equal count
/// against each.
fn dependences(fit: &Fit<'_>, equation: Equation) -> impl Iterator<Item = (&'static str, f64)> {
    let residual = whitened_residual(fit, equation);
    residual.into_iter().flat_map(|residual| {
        let EquationResidual { white, variables, .. } = residual;
        let depends = move |(name, values): (&'static str, Vec<f64>)| {
            let (chi2, freedom) = binned_chi2(&white, &values)?;
            let is_by_chance = statistics::chi2_p(chi2, freedom) >= LEAST_P / RESIDUAL_TESTS as f64;
            (!is_by_chance).then_some((name, chi2 - freedom))
        };
        variables.into_iter().filter_map(depends)
    })
}

/// Sum of squared means in bins of equal count, in their variance, and the number of bins; none where there are too few.
fn binned_chi2(white: &[f64], values: &[f64]) -> Option<(f64, f64)> {
    let mut pairs: Vec<(f64, f64)> =
        values.iter().zip(white).filter(|(value, _)| value.is_finite()).map(|(v, w)| (*v, *w)).collect();
    let varies = pairs.iter().any(|pair| pair.0.to_bits() != pairs[0].0.to_bits());
    if !varies || pairs.len() < BINS * FEWEST_NUMBERS {
        return None;
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let bins = pairs.chunks(pairs.len().div_ceil(BINS));
    let of_bin = |bin: &[(f64, f64)]| bin.iter().map(|pair| pair.1).sum::<f64>().powi(2) / bin.len() as f64;
    let freedom = bins.len() as f64;
    Some((bins.map(of_bin).sum(), freedom))
}

/// What is wrong with the sensors themselves, in sentences: no model of the machine can mend it.
pub(crate) fn failures(checks: &[SensorCheck], faults: &[ChannelFault]) -> Vec<String> {
    let told = |fault: &ChannelFault| format!("{}: {}", fault.text, fault.suggestion);
    ripples(checks).chain(faults.iter().map(told)).collect()
}

/// Signals whose noise is no noise.
fn ripples(checks: &[SensorCheck]) -> impl Iterator<Item = String> {
    let sentence = |check: &SensorCheck| {
        let ratio = check.found.std / check.declared_std;
        format!("{}: fast, regular noise {ratio:.1} times the declared one (a ripple)", check.name)
    };
    checks.iter().filter(|check| check.is_ripple_of_its_own()).map(sentence)
}

/// What speaks for and against the model with the effects.
pub(crate) struct Judgement {
    /// What speaks against the model with the effects.
    pub(crate) complaints: Vec<String>,
    /// The complaints among them of sensors that fail by themselves.
    pub(crate) failures: Vec<String>,
    /// The residual of each equation beyond noise, as a part of the sum of squares.
    pub(crate) left: PerEquation<f64>,
    /// Where the effects together made the error on held-out samples smaller.
    pub(crate) fell: PerEquation<bool>,
    /// Pairs of effects that act on each other.
    pub(crate) interactions: Vec<Interaction>,
}

impl Judgement {
    /// What the strongest product of two effects would mend of the sum of squares, `beside` being none of them: their laws are wrong by that.
    pub(crate) fn mended_by_products(&self, fit: &Fit<'_>, beside: Option<&str>) -> f64 {
        let is_beside = |found: &&Interaction| !found.effects.iter().any(|id| Some(*id) == beside);
        let percents = self.interactions.iter().filter(is_beside).map(|found| found.mended_percent);
        percents.fold(0.0, f64::max) / 100.0 * fit.free.chi2
    }
}

/// Judges the model with the effects by its errors on held-out samples, `before` without them and `after`, and by what is
/// left, beside what is wrong with the sensors.
pub(crate) fn judge(
    selection: &Selection<'_>,
    failures: Vec<String>,
    [before, after]: [&ModelFit; 2],
) -> Judgement {
    let Selection { fit, effects, .. } = selection;
    let Inadequacy { mut complaints, left } = inadequacy(fit);
    complaints.extend_from_slice(&failures);
    if effects.iter().any(|one| one.is_below_unlisted) {
        complaints.push(
            "a product of signals that the table does not list fits better than any known effect".to_owned(),
        );
    }
    if effects.len() >= MOST_EFFECTS {
        let count = effects.len();
        complaints
            .push(format!("{count} effects at once are rare: one that no table has may be behind them"));
    }
    let [before, after] = [before, after].map(|model| &model.quality.rmse);
    let fell = PerEquation::from_fn(|equation| after[equation] < before[equation]);
    if !effects.is_empty() && Equation::ALL.into_iter().all(|equation| !fell[equation]) {
        complaints.push("samples that were not fitted are met no better than without the effects".to_owned());
    }
    let interactions = search::interactions(fit, effects);
    Judgement { complaints, failures, left, fell, interactions }
}
