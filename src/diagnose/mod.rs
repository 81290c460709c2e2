//! From what the model leaves over to the physical effect that it lacks.
//!
//! 1. The equations are integrated against hat functions (`rows`), so that nothing is differentiated and
//!    the noise of every row follows from the rig file (`noise`).
//! 2. The declared model is fitted by generalised least squares with its priors (`fit`).
//! 3. Every known effect is a column; a score test says what it would bring (`regression`), and forward
//!    selection confirmed on held-out samples names the missing ones (`select`).
//! 4. What is left is held against the declared noise (`adequacy`), which decides the verdict.
//!
//! The derivation is in `docs/closing-the-loop.md`.

mod adequacy;
mod exchange;
mod figures;
mod fit;
mod held_out;
mod holds;
mod interaction;
mod likeness;
mod motion;
mod noise;
mod outcome;
mod point;
mod regression;
mod residual;
mod residual_text;
mod rows;
mod select;
mod series;
mod shape;
mod term;
mod text;
mod whiteness;

pub use holds::{HoldLeak, Holds};
pub use likeness::{Likeness, Look};
pub use outcome::{
    BinnedResidual, Calibration, Diagnosis, FoundEffect, Interaction, LeakEstimate, LeakEstimates,
    LeaksBeforeAfter, Quality, Residual, ResidualsBeforeAfter, Rmse, Size, Verdict, WhitenessP,
};
pub use residual::{BalanceResidual, Correlation, Residuals};
pub use series::Series;

use crate::Rig;
use crate::rig::EffectValue;
use fit::Fit;
use held_out::HeldOut;
use motion::Motion;
use pitchleak_core::effects::{EffectConstant, EffectConstants};
use pitchleak_core::{Cylinder, Effect, EffectSet, Fluid, Model, PerLeak, SensorSpread, Sensors};
use select::Named;
use std::collections::BTreeMap;
use term::Term;

/// Called now and then while a diagnosis runs.
pub type Progress<'a> = &'a dyn Fn();

/// What the rig file says, as the diagnosis uses it.
#[derive(Clone, Copy, Debug)]
pub struct Declared {
    /// Geometry and mass.
    pub cylinder: Cylinder<f64>,
    /// Oil.
    pub fluid: Fluid<f64>,
    /// Noise, offsets and gains of the sensors.
    pub sensors: Sensors<f64>,
    /// Effects that are known already.
    pub effects: EffectSet<f64>,
}

/// Below this share of full scale nothing is an effect: the resolution of a good converter (16 bit).
const RESOLUTION: f64 = 1.0 / 65_536.0;
/// Faster samples than this are averaged first, s.
const LEAST_STEP_S: f64 = 0.01;
/// Fewer hats than this tell nothing.
const FEWEST_ROWS: usize = 30;
/// An effect of this many standard deviations is called detectable.
const DETECTABLE_SIGMA: f64 = 5.0;
/// Additions, counting those that are taken back.
const MOST_STEPS: usize = 10;
/// Effects that leave more than this share of the excess over the sensors' noise are not to be believed.
const UNMENDED: f64 = 0.1;
const DOUBT: &str = "it mends part of what is missing, but more than the sensors' noise is left: something else may be behind it, not to be believed without a measurement of its own";
/// A leak this many standard deviations below zero is evidence against the model.
const NEGATIVE_SIGMA: f64 = 3.0;
/// A leak known to within this flow at the mean pressure is identified, m³/s (0.1 L/min).
const IDENTIFIED_M3S: f64 = 0.1 / 60e3;

impl Declared {
    /// From a rig file.
    pub fn of(rig: &Rig) -> Self {
        let mut sensors = rig.sensors();
        let sheets = &rig.instruments;
        for (spread, sheet) in [
            (&mut sensors.flow_a, &sheets.flow_a),
            (&mut sensors.flow_b, &sheets.flow_b),
            (&mut sensors.pressure, &sheets.pressure),
            (&mut sensors.position, &sheets.position),
            (&mut sensors.force, &sheets.force),
        ] {
            spread.noise_std = spread.noise_std.max(RESOLUTION * sheet.full_scale);
        }
        Self { cylinder: rig.cylinder, fluid: rig.fluid, sensors, effects: rig.effect_set() }
    }

    /// With the noise of means over `count` samples.
    fn averaged(mut self, count: usize) -> Self {
        let root = (count as f64).sqrt();
        let Sensors { flow_a, flow_b, pressure, position, force } = &mut self.sensors;
        for spread in [flow_a, flow_b, pressure, position, force] {
            *spread = SensorSpread { noise_std: spread.noise_std / root, ..*spread };
        }
        self
    }
}

/// Fits all of `train` as traces of one rig and judges on `test`, or, where that is empty, on blocks
/// of `train` that each fit leaves out.
pub fn diagnose(train: &[Series], test: &[Series], declared: &Declared, progress: Progress<'_>) -> Diagnosis {
    let (test, _) = thinned(test, declared);
    let (train, declared) = thinned(train, declared);
    let checks = adequacy::check_sensors(&train, &declared.sensors);
    let mut fit = declared_fit(&train, &declared, &checks, progress);
    let left_before = HeldOut::of(&fit, &test);
    let before = Quality { rmse: left_before.rmse(), whiteness_p: adequacy::whiteness_p(&fit) };
    let leaks_before = leaks(&fit);
    let residuals_before = Residuals::of(&fit);
    let mut named = Vec::<Named>::new();
    let excited = is_excited(&fit);
    let excess_before = fit.excess_power();
    let mut last = before.rmse;
    for _ in 0..if excited { MOST_STEPS } else { 0 } {
        let Some(one) = select::add_next(&mut fit, progress) else { break };
        named.push(one);
        select::drop_needless(&mut fit, &mut named, progress);
        exchange::settle(&mut fit, &mut named, progress);
        let now = HeldOut::of(&fit, &test).rmse();
        let mended = reduction_percent(&last, &now);
        named.iter_mut().for_each(|one| _ = one.mended_percent.get_or_insert(mended));
        last = now;
    }
    select::drop_doubtful(&mut fit, &mut named, progress);
    select::find_confusable(&fit, &mut named);
    let ripples: Vec<_> = checks.iter().filter(|check| check.is_ripple()).collect();
    let mut notes: Vec<String> = adequacy::complaints(&fit);
    notes.extend(ripples.iter().map(|check| {
        let ratio = check.found.std / check.declared_std;
        format!("{}: fast, regular noise {ratio:.1} times the declared one (a ripple)", check.name)
    }));
    let outdone = named.iter().any(|one| one.outdone);
    if outdone {
        notes.push("a product of signals without a name fits better than any known effect".to_owned());
    }
    let verdict = verdict(excited, named.is_empty(), notes.is_empty());
    let mends_nearly_all = !outdone && fit.excess_power() < UNMENDED * excess_before;
    let confident = verdict == Verdict::Explained || mends_nearly_all;
    notes.extend(negative_leaks(&leaks_before, "the declared model"));
    let interactions = interaction::interactions(&fit, &named);
    notes.extend(interactions.iter().map(|found| {
        let Interaction { effects: [one, other], sigma, mended_percent } = found;
        format!("{one} and {other} act on each other: the product of their terms shows at {sigma:.1} sigma and would mend {mended_percent:.1} %")
    }));
    let leaks_after = leaks(&fit);
    if !named.is_empty() {
        notes.extend(negative_leaks(&leaks_after, "the model with the effects"));
    }
    let left = HeldOut::of(&fit, &test);
    let judged = if test.is_empty() { &train } else { &test };
    let holds = holds::check(&fit, &named, (&train, judged), &declared, &checks, progress);
    Diagnosis {
        schema: "pitchleak.diagnose/1",
        before,
        effects: named.iter().filter_map(|one| found(&fit, one, confident)).collect(),
        interactions,
        after: Quality { rmse: left.rmse(), whiteness_p: adequacy::whiteness_p(&fit) },
        calibration: calibration(&fit),
        leaks: LeaksBeforeAfter { before: leaks_before, after: leaks_after },
        not_detectable_below: if excited { reach(&fit) } else { BTreeMap::new() },
        verdict,
        notes,
        excess: rows::Balance::ALL.map(|balance| fit.excess(balance)),
        remainder_before: left_before.shapes(),
        remainder: left.shapes(),
        holds,
        residuals: ResidualsBeforeAfter { before: residuals_before, after: Residuals::of(&fit) },
        residual_before: left_before.residual(),
        residual: left.residual(),
    }
}

/// Traces at the speed of the machine, and what is declared of their means.
fn thinned(traces: &[Series], declared: &Declared) -> (Vec<Series>, Declared) {
    let thin: Vec<_> = traces.iter().map(|series| series.thinned(LEAST_STEP_S)).collect();
    let count = thin.iter().map(|(_, count)| *count).min().unwrap_or(1);
    (thin.into_iter().map(|(series, _)| series).collect(), declared.averaged(count))
}

/// Best fit of the declared model, with the noise that the sensors really carry.
fn declared_fit<'a>(
    traces: &'a [Series],
    declared: &Declared,
    checks: &[adequacy::SensorCheck],
    progress: Progress<'_>,
) -> Fit<'a> {
    let sensors = adequacy::effective(&declared.sensors, checks);
    Fit::declared(traces, declared, sensors, friction_shape(traces, declared), progress)
}

fn verdict(excited: bool, none_named: bool, complete: bool) -> Verdict {
    match (excited, none_named, complete) {
        (false, ..) => Verdict::InsufficientExcitation,
        (true, true, true) => Verdict::NoMissingEffect,
        (true, true, false) => Verdict::Unexplained,
        (true, false, true) => Verdict::Explained,
        (true, false, false) => Verdict::PartlyExplained,
    }
}

/// Whether position or pressure do more than their noise.
fn is_excited(fit: &Fit<'_>) -> bool {
    let rows = &fit.rows.rows;
    if rows.len() < FEWEST_ROWS || fit.regression.count() < FEWEST_ROWS {
        return false;
    }
    let spread = |value: &dyn Fn(&rows::Row) -> f64| {
        let mean = rows.iter().map(value).sum::<f64>() / rows.len() as f64;
        (rows.iter().map(|row| (value(row) - mean).powi(2)).sum::<f64>() / rows.len() as f64).sqrt()
    };
    let samples = rows.iter().map(|row| row.samples).min().unwrap_or(1) as f64;
    let noise = |std: f64| DETECTABLE_SIGMA * std / samples.sqrt();
    spread(&|row| row.mean.x_m) > noise(fit.sensors.position.noise_std)
        || spread(&|row| row.mean.pa_pa) > noise(fit.sensors.pressure.noise_std)
        || spread(&|row| row.mean.pb_pa) > noise(fit.sensors.pressure.noise_std)
}

/// Friction turns within the speed that these traces can resolve.
fn friction_shape(traces: &[Series], declared: &Declared) -> EffectConstants<f64> {
    let model = Model { cylinder: declared.cylinder, fluid: declared.fluid, leaks_m3spa: PerLeak::default() };
    let least = |motion: &Motion| (motion.least_sure_mps() / 3.0, motion.rms_mps);
    let speeds: Vec<(f64, f64)> =
        traces.iter().map(|series| least(&Motion::of(series, &model, &declared.sensors))).collect();
    let within = |parameter: EffectConstant, speed: f64| {
        let spec = parameter.spec();
        speed.clamp(spec.lower, spec.upper)
    };
    let slip = speeds.iter().map(|s| s.0).fold(0.0, f64::max);
    let usual = speeds.iter().map(|s| s.1).fold(0.0, f64::max);
    EffectConstants {
        slip_speed_mps: within(EffectConstant::SlipSpeed, slip),
        stribeck_speed_mps: within(EffectConstant::StribeckSpeed, usual / 2.0),
        ..EffectConstants::default()
    }
}

fn estimate(fit: &Fit<'_>, term: Term) -> (f64, f64) {
    let at = fit.terms.iter().position(|t| *t == term);
    at.and_then(|at| fit.estimate(at)).unwrap_or((0.0, f64::INFINITY))
}

fn leaks(fit: &Fit<'_>) -> LeakEstimates {
    let widening = fit.dispersion(fit.solution.chi2).sqrt();
    let rows = &fit.rows.rows;
    let mean = |value: &dyn Fn(&rows::Row) -> f64| {
        (rows.iter().map(|row| value(row).abs()).sum::<f64>() / rows.len().max(1) as f64).max(1.0)
    };
    let leak = |term, pressure_pa: f64| {
        let (value, std) = estimate(fit, term);
        let std = std * widening;
        estimated(value, std, "m3/(s*Pa)", std * pressure_pa < IDENTIFIED_M3S)
    };
    let (softness, std) = estimate(fit, Term::InverseBulk);
    let bulk = 1.0 / softness;
    let prior = fit.priors.first().copied().flatten().map_or(f64::INFINITY, |prior| prior.std);
    let std = if fit.held_softness.is_some() { prior } else { std };
    LeakEstimates {
        internal_leak_coefficient: leak(Term::Internal, mean(&|row| row.mean.pa_pa - row.mean.pb_pa)),
        external_leak_a_coefficient: leak(Term::ExternalA, mean(&|row| row.mean.pa_pa)),
        external_leak_b_coefficient: leak(Term::ExternalB, mean(&|row| row.mean.pb_pa)),
        bulk_modulus: estimated(bulk, std * widening * bulk * bulk, "Pa", std * widening < 0.5 * prior),
    }
}

fn estimated(value: f64, std: f64, unit: &'static str, identifiable: bool) -> LeakEstimate {
    let half = 1.96 * std;
    let ci95 = [value - half, value + half];
    LeakEstimate { value, std, ci95, unit, identifiable, physical: value >= -NEGATIVE_SIGMA * std }
}

fn negative_leaks(leaks: &LeakEstimates, model: &str) -> Vec<String> {
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

fn found(fit: &Fit<'_>, one: &Named, confident: bool) -> Option<FoundEffect> {
    let effect = fit.terms[one.term].effect()?;
    let (value, std) = fit.estimate(one.term)?;
    let spec = effect.spec();
    let confusable_with: Vec<_> = one.confusable_with.iter().map(|other| other.spec().id).collect();
    let shape = &fit.shapes[one.term];
    let shape = effect.constants().iter().map(|p| (p.spec().id, shape.get(*p))).collect();
    Some(FoundEffect {
        id: spec.id,
        value,
        std: std * fit.dispersion(fit.solution.chi2).sqrt(),
        unit: spec.unit,
        confident,
        doubt: (!confident).then_some(DOUBT),
        rmse_reduction_percent: one.mended_percent.unwrap_or(0.0),
        p_value: one.p_value,
        separated_by: separation(effect, &one.confusable_with),
        confusable_with,
        shape,
        cause: spec.cause,
        remedy: spec.remedy,
    })
}

/// The measurements that tell an effect from its rivals: what shows each of them alone.
fn separation(effect: Effect, rivals: &[Effect]) -> Option<String> {
    let group = std::iter::once(&effect).chain(rivals);
    let measurements: Vec<_> = group.map(|one| one.spec().measurement).collect();
    (!rivals.is_empty()).then(|| measurements.join(" "))
}

fn calibration(fit: &Fit<'_>) -> Vec<Calibration> {
    let known =
        |term: &usize| Some((fit.terms[*term].effect()?, fit.priors[*term].and(fit.estimate(*term))?));
    let found = fit.active.iter().filter_map(known);
    found
        .map(|(effect, (value, std))| Calibration {
            id: effect.spec().id,
            value,
            std,
            unit: effect.spec().unit,
        })
        .collect()
}

impl Diagnosis {
    /// The rig file with the effects in it, so that replay and simulation use them. The bulk modulus is that of
    /// the fit too: volumes and hoses are measured only as V/β.
    pub fn rig(&self, rig: &Rig) -> Rig {
        let mut with = rig.clone();
        if !self.effects.is_empty() {
            let bulk = &self.leaks.after.bulk_modulus;
            let relative = rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa;
            let std = bulk.std.min(relative * bulk.value);
            with.fluid = Fluid { bulk_modulus_pa: bulk.value, bulk_modulus_std_pa: std };
        }
        let sizes = self.calibration.iter().map(|c| (c.id, c.value, c.std, None));
        let sizes = sizes.chain(self.effects.iter().map(|e| (e.id, e.value, e.std, Some(&e.shape))));
        for (id, value, std, constants) in sizes {
            let Ok(effect) = id.parse::<Effect>() else { continue };
            let mut shape = EffectConstants::default();
            for parameter in effect.constants() {
                let found = constants.and_then(|constants| constants.get(parameter.spec().id));
                shape = found.map_or(shape, |value| shape.with(*parameter, *value));
            }
            with.effects.insert(effect, EffectValue { value, std: Some(std), constants: shape });
        }
        with
    }
}

/// Largest fall of the error over the balances.
fn reduction_percent(before: &Rmse, after: &Rmse) -> f64 {
    let pairs = [
        (before.chamber_a_m3s, after.chamber_a_m3s),
        (before.chamber_b_m3s, after.chamber_b_m3s),
        (before.force_n, after.force_n),
    ];
    let falls = pairs.iter().filter_map(|(b, a)| Some(100.0 * (1.0 - (*a)? / (*b)?)));
    falls.fold(f64::NEG_INFINITY, f64::max)
}

fn reach(fit: &Fit<'_>) -> BTreeMap<&'static str, Size> {
    let widening = fit.dispersion(fit.solution.chi2).sqrt();
    let mut sizes = BTreeMap::new();
    for term in select::candidates(fit) {
        let (Some(effect), Some(score)) =
            (fit.terms[term].effect(), fit.regression.score(&fit.scoring, term))
        else {
            continue;
        };
        let value = DETECTABLE_SIGMA * score.std * widening;
        sizes.insert(effect.spec().id, Size { value, unit: effect.spec().unit });
    }
    sizes
}
