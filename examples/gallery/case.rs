//! One effect on the paper's rig in some wind: its residual, and what looks like it.

use crate::Failure;
use pitchleak::Rig;
use pitchleak::core::effects::{EffectConstant, EffectConstants};
use pitchleak::core::{Effect, EffectSet, PerLeak};
use pitchleak::diagnose::{Candidate, Collinearity, Declared, Diagnosis, Series, diagnose};
use pitchleak::simulate::{Biases, LeakSize, OilTemperature, Scenario, Sensing};
use pitchleak::wind::{Emulation, History, WindCase};
use std::collections::BTreeMap;

/// Accuracy of every sensor (3 σ of white noise), as a share of its full scale.
pub const ACCURACY: f64 = 3e-3;
/// Length of a trace, s.
pub const DURATION_S: f64 = 40.0;
/// How many times what the trace can just show an effect is large: a picture shows less than the fit sees.
const MULTIPLE: f64 = 20.0;
/// … but no larger than this share of what is worth believing.
const LARGEST_SHARE: f64 = 0.5;
/// Less alike (correlation of both residuals), an effect is told apart as soon as it shows.
pub const ALIKE: f64 = 0.4;
/// Rivals that a page names at most.
const MOST_RIVALS: usize = 5;

/// What some wind on a sound rig tells of every effect.
pub struct Wind {
    scenario: Scenario,
    collinearity: Collinearity,
    limits: BTreeMap<&'static str, f64>,
}

/// An effect, simulated and diagnosed.
pub struct Case {
    pub effect: Effect,
    /// In the effect's unit.
    pub size: f64,
    /// The least size that this trace shows (five standard deviations), in the effect's unit.
    pub limit: Option<f64>,
    pub diagnosis: Diagnosis,
    pub rivals: Vec<Rival>,
}

/// An effect with much the same residual.
pub struct Rival {
    pub effect: Effect,
    /// Of what both leave over, under the sensors' noise.
    pub correlation: f64,
    /// From which size on this trace tells the two apart (five standard deviations), in the unit of the page's effect.
    pub told_apart_from: f64,
}

/// Whether the effect is nothing while the oil's temperature stays.
pub fn follows_temperature(effect: Effect) -> bool {
    effect.spec().constants.contains(&EffectConstant::ReferenceTemp)
}

/// A worn spot where the piston often is, and a valve that opens at a load pressure it sometimes has.
fn constants() -> EffectConstants<f64> {
    EffectConstants {
        spot_position_m: 0.09,
        spot_width_m: 0.015,
        cracking_pa: 1e6,
        ..EffectConstants::default()
    }
}

impl Wind {
    /// Small leaks, as a rig in service has them.
    pub fn at_constant_temperature() -> Result<Self, Failure> {
        Self::new(PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 1e-12 }, None)
    }

    /// From 40 to 60 °C, and no leak but the effect's: all others would follow the oil, too.
    pub fn with_warming_oil() -> Result<Self, Failure> {
        let temperature = OilTemperature::of("40 °C -> 60 °C", DURATION_S)?;
        Self::new(PerLeak { internal: 0.0, external_a: 0.0, external_b: 0.0 }, Some(temperature))
    }

    fn new(leaks: PerLeak<f64>, oil_temperature: Option<OilTemperature>) -> Result<Self, Failure> {
        let mut rig = Rig::paper();
        rig.instruments = rig.instruments.with_accuracy(ACCURACY);
        let history = History::of(&pitchleak::wind::Wind::BuiltIn(WindCase::Mps21))?;
        let reference = Emulation::paper().reference(&history, rig.cylinder.stroke_m)?;
        let scenario = Scenario {
            leaks: leaks.map(|leak| LeakSize::Coefficient(leak).into()),
            oil_temperature,
            start_s: 5.0,
            warm_up_s: 3.0,
            duration_s: DURATION_S,
            ..Scenario::new(rig, reference)
        };
        let (sound, declared) = (recorded(&scenario)?, Declared::of(&scenario.rig));
        let collinearity = Collinearity::of(std::slice::from_ref(&sound), &declared, &[constants()]);
        let limits = diagnose(&[sound], &[], &declared, &|| ()).not_detectable_below;
        let limits = limits.into_iter().map(|(id, size)| (id, size.value)).collect();
        Ok(Self { scenario, collinearity, limits })
    }

    /// The most alike first; of each effect the constants with which it is most so.
    fn rivals(&self, effect: Effect) -> Vec<Rival> {
        let Collinearity { candidates, correlation } = &self.collinearity;
        let Some((own, column)) = candidates.iter().zip(correlation).find(|(one, _)| is(one, effect)) else {
            return Vec::new();
        };
        let mut closest = BTreeMap::<Effect, f64>::new();
        for (candidate, correlation) in candidates.iter().zip(column) {
            let alike = closest.entry(candidate.effect).or_default();
            if correlation.abs() > alike.abs() {
                *alike = *correlation;
            }
        }
        closest.remove(&effect);
        let mut rivals: Vec<_> = closest
            .into_iter()
            .filter(|(_, correlation)| correlation.abs() > ALIKE)
            .map(|(rival, correlation)| Rival {
                effect: rival,
                correlation,
                told_apart_from: 5.0 * own.std / (1.0 - correlation * correlation).max(0.0).sqrt(),
            })
            .collect();
        rivals.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
        rivals.truncate(MOST_RIVALS);
        rivals
    }
}

/// The candidate that a case is made of: the effect, with a worn spot where the case has it and a valve that opens as the case's.
fn is(candidate: &Candidate, effect: Effect) -> bool {
    let is_placed =
        |own: &EffectConstant| matches!(own, EffectConstant::SpotPosition | EffectConstant::CrackingPressure);
    candidate.effect == effect
        && (!effect.spec().constants.iter().any(is_placed) || candidate.constants == constants())
}

impl Case {
    pub fn of(effect: Effect, wind: &Wind) -> Result<Self, Failure> {
        let spec = effect.spec();
        let limit = wind.limits.get(spec.id).copied();
        let size = limit.map_or(spec.default_size, |limit| MULTIPLE * limit).min(LARGEST_SHARE * spec.upper);
        let mut effects = EffectSet::default();
        effects.set(effect, size, constants())?;
        let scenario = Scenario { effects, ..wind.scenario.clone() };
        let diagnosis = diagnose(&[recorded(&scenario)?], &[], &Declared::of(&scenario.rig), &|| ());
        Ok(Self { effect, size, limit, diagnosis, rivals: wind.rivals(effect) })
    }
}

/// What the sensors show of it.
fn recorded(scenario: &Scenario) -> Result<Series, Failure> {
    let mut sensing = Sensing::new(scenario.rig.sensors(), Biases::default(), 1);
    let mut series = Series::default();
    let leaks = scenario.leak_coefficients()?;
    scenario.run(leaks, |truth| series.push(truth.t_s, &sensing.read(&truth.sample), truth.temp_k))?;
    Ok(series)
}
