//! What a diagnosis fits, and all that stays the same while it tries one effect after the other.

use super::regression::Prior;
use crate::diagnose::data::{Declared, Motion, SensorCheck, Series, Unresolved, effective, white};
use crate::diagnose::thresholds::{SIGNIFICANT_SIGMA, SMALL_SHARE};
use crate::diagnose::weak_form::{DECLARED, LeakChange, Linearisation, Term, all_terms};
use pitchleak_core::effects::{EffectConstant, EffectConstants};
use pitchleak_core::{Cylinder, Effect, Sensors, Signals};
use std::f64::consts::FRAC_PI_2;

/// Traces of one rig, the terms that may explain them, and what is known of these beside the data.
pub(crate) struct Problem<'a> {
    pub(crate) traces: &'a [Series],
    /// Their fast parts, in the noise of `sensors`.
    pub(super) unresolved: Vec<Unresolved>,
    /// As the data sheets have them.
    pub(super) declared: Sensors<f64>,
    /// With the noise that the sensors really carry.
    pub(crate) sensors: Sensors<f64>,
    /// The noise that columns share with the residual: as found, without ripples, which average away within a block.
    pub(super) white: Sensors<f64>,
    pub(crate) terms: Vec<Term>,
    pub(crate) priors: Vec<Option<Prior>>,
    /// No shorter lag is named.
    least_lag_s: f64,
    /// The constants from which a fit of them starts.
    pub(crate) usual_constants: EffectConstants<f64>,
    /// How far a constant may lie from where it is, for each term that is one.
    constant_stds: Vec<Option<f64>>,
    /// Those of effects whose constants are given.
    given_constants: EffectConstants<f64>,
    /// The declared model, from which the fit sets out.
    pub(super) start: Linearisation,
}

impl<'a> Problem<'a> {
    pub(crate) fn new(traces: &'a [Series], declared: &Declared, checks: &[SensorCheck]) -> Self {
        let terms = all_terms();
        let start = Linearisation::declared(declared);
        let motions = start.motions(traces, &declared.sensors);
        let usual_constants = usual_constants(traces, &motions);
        let sensors = effective(&declared.sensors, checks);
        Self {
            traces,
            unresolved: traces.iter().map(|series| Unresolved::of(series, &sensors)).collect(),
            declared: declared.sensors,
            sensors,
            white: white(&declared.sensors, checks),
            priors: terms.iter().map(|term| prior(*term, declared)).collect(),
            constant_stds: terms.iter().map(|term| constant_std(*term, traces, &motions)).collect(),
            terms,
            least_lag_s: SMALL_SHARE * traces.iter().map(Series::step_s).fold(0.0, f64::max),
            given_constants: EffectConstants { slip_speed_mps: turning_speed(declared), ..usual_constants },
            usual_constants,
            start,
        }
    }

    /// The same with leaks that change.
    #[must_use]
    pub(crate) fn with_leak_changes(mut self, changes: &[LeakChange]) -> Self {
        self.terms.extend(changes.iter().map(|change| Term::LeakChange(*change)));
        self.priors.resize(self.terms.len(), None);
        self.constant_stds.resize(self.terms.len(), None);
        self
    }

    /// The leaks' changes with their places.
    pub(crate) fn leak_changes(&self) -> impl Iterator<Item = (usize, LeakChange)> {
        self.terms.iter().enumerate().filter_map(|(place, term)| match term {
            Term::LeakChange(change) => Some((place, *change)),
            _ => None,
        })
    }

    /// The terms of the declared model: its constants, and what the rig file says may be there.
    pub(super) fn declared_terms(&self) -> Vec<usize> {
        let is_declared = |i: &usize| {
            let term = &self.terms[*i];
            DECLARED.contains(term) || matches!(term, Term::LeakChange(_)) || self.priors[*i].is_some()
        };
        (0..self.terms.len()).filter(is_declared).collect()
    }

    /// The cylinder that the rig file declares.
    pub(crate) fn declared_cylinder(&self) -> &Cylinder<f64> {
        &self.start.model.cylinder
    }

    /// The places of all terms that could be fitted beside the `active` ones: the constants of these alone.
    pub(super) fn every_place(&self, active: &[usize]) -> Vec<usize> {
        let is_open = |i: &usize| self.constant_stds[*i].is_none() || active.contains(i);
        (0..self.terms.len()).filter(is_open).collect()
    }

    /// The places of the constants of a term that are fitted.
    pub(super) fn constants_of(&self, term: usize) -> impl Iterator<Item = usize> {
        let is_own = move |i: &usize| {
            let Term::Constant(effect, _) = self.terms[*i] else { return false };
            self.constant_stds[*i].is_some() && self.terms[term].effect() == Some(effect)
        };
        (0..self.terms.len()).filter(is_own)
    }

    /// The place of a term.
    pub(crate) fn place(&self, term: Term) -> Option<usize> {
        self.terms.iter().position(|one| *one == term)
    }

    /// The constants that a term starts from.
    pub(crate) fn usual(&self, term: usize) -> EffectConstants<f64> {
        let given = self.terms[term].effect().map_or(&[][..], |effect| effect.spec().given);
        let take =
            |all: EffectConstants<f64>, own: &EffectConstant| all.with(*own, self.given_constants.get(*own));
        given.iter().fold(self.usual_constants, take)
    }

    /// How many of these are not as some term starts from.
    pub(crate) fn fitted_constants(&self, constants: EffectConstants<f64>) -> usize {
        let differ = |usual: EffectConstants<f64>| {
            let all = EffectConstant::ALL.iter();
            all.filter(|one| usual.get(**one).to_bits() != constants.get(**one).to_bits()).count()
        };
        (0..self.terms.len()).map(|term| differ(self.usual(term))).min().unwrap_or(0)
    }

    /// The priors as increments from a linearisation. A constant lies anywhere within its range: what is known of it holds back a step, and
    /// draws nowhere (Levenberg 1944).
    pub(super) fn increments(&self, at: &Linearisation) -> Vec<Option<Prior>> {
        let from_there = |((prior, term), constant): ((&Option<Prior>, &Term), &Option<f64>)| {
            let known = prior.map(|prior| Prior { mean: prior.mean - at.value(*term), ..prior });
            known.or_else(|| constant.map(|std| Prior { mean: 0.0, std }))
        };
        self.priors.iter().zip(&self.terms).zip(&self.constant_stds).map(from_there).collect()
    }

    /// Values of a term that physics allows and samples can show.
    pub(crate) fn allows(&self, term: usize, value: f64) -> bool {
        let (lower, upper) = self.terms[term].bounds();
        let least = self.terms[term].effect().map_or(lower, |effect| self.least_shown(effect).max(lower));
        (least..=upper).contains(&value)
    }

    /// A meter's dead band shows where it silences more than what its noise does: within that the meter showed what flowed.
    fn least_shown(&self, effect: Effect) -> f64 {
        let Sensors { flow_a, flow_b, .. } = self.sensors;
        let mut noise = Signals { qa_m3s: flow_a.noise_std, qb_m3s: flow_b.noise_std, ..Signals::default() };
        effect.deaf(&mut noise).map_or(f64::NEG_INFINITY, |std| SIGNIFICANT_SIGMA * *std)
    }

    /// Whether a term of this value may be named. Of a lag that is a small share of a sample's length the samples are taken too far
    /// apart to tell what it is: it may stand behind another name, and has none.
    pub(crate) fn may_name(&self, term: usize, value: f64) -> bool {
        value >= self.least_lag_s || !self.terms[term].effect().is_some_and(Effect::is_lag)
    }
}

/// Friction turns within the speed that these traces can resolve, and a valve opens at the mean load pressure.
fn usual_constants(traces: &[Series], motions: &[Motion]) -> EffectConstants<f64> {
    let slip = motions.iter().map(|motion| motion.std_mps).fold(0.0, f64::max);
    let usual = motions.iter().map(|motion| motion.rms_mps).fold(0.0, f64::max);
    EffectConstants {
        slip_speed_mps: within(EffectConstant::SlipSpeed, slip),
        stribeck_speed_mps: within(EffectConstant::StribeckSpeed, usual / 2.0),
        cracking_pa: mean_load_pressure(traces).map_or(EffectConstant::CrackingPressure.spec().upper, |pa| {
            within(EffectConstant::CrackingPressure, pa)
        }),
        ..EffectConstants::default()
    }
}

/// Of a value anywhere within what these traces cover; none where the term is no constant, or they tell nothing of it.
fn constant_std(term: Term, traces: &[Series], motions: &[Motion]) -> Option<f64> {
    let Term::Constant(_, constant) = term else { return None };
    let fastest = SIGNIFICANT_SIGMA * motions.iter().map(|motion| motion.rms_mps).fold(0.0, f64::max);
    let span = |value: fn(&Signals<f64>) -> f64| {
        let at = |((x_m, pa_pa), pb_pa): ((&f64, &f64), &f64)| {
            value(&Signals { x_m: *x_m, pa_pa: *pa_pa, pb_pa: *pb_pa, v_mps: fastest, ..Signals::default() })
        };
        let all =
            traces.iter().flat_map(|trace| trace.x_m.iter().zip(&trace.pa_pa).zip(&trace.pb_pa).map(at));
        all.filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let (low, high) = constant.range(0.0, span)?;
    Some((high - low) / 12.0_f64.sqrt())
}

fn within(parameter: EffectConstant, value: f64) -> f64 {
    let spec = parameter.spec();
    value.clamp(spec.lower, spec.upper)
}

/// Mean size of the load pressure, Pa.
fn mean_load_pressure(traces: &[Series]) -> Option<f64> {
    let loads = traces.iter().flat_map(|series| series.pa_pa.iter().zip(&series.pb_pa));
    let known = loads.map(|(pa, pb)| (pa - pb).abs()).filter(|load| load.is_finite());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), load| (sum + load, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// The speed within which what turns with the direction of motion is seen to turn through the meters' noise, m/s: where a speed v is read
/// through noise σ the direction is on average erf(v / (√2 σ)), nearly tanh(v / (√(π/2) σ)).
fn turning_speed(declared: &Declared) -> f64 {
    let (sensors, cylinder) = (&declared.sensors, &declared.cylinder);
    let swept_m3s = sensors.flow_a.noise_std.hypot(sensors.flow_b.noise_std);
    let speed_mps = FRAC_PI_2.sqrt() * swept_m3s / (cylinder.area_a_m2 + cylinder.area_b_m2);
    within(EffectConstant::SlipSpeed, speed_mps)
}

fn prior(term: Term, declared: &Declared) -> Option<Prior> {
    match term {
        Term::InverseBulk => {
            let bulk = declared.fluid.bulk_modulus_pa;
            let share = (declared.fluid.bulk_modulus_std_pa / bulk).max(1e-6);
            Some(Prior { mean: 1.0 / bulk, std: share / bulk })
        }
        Term::Effect(effect) => effect.prior_std(&declared.sensors).map(|std| Prior { mean: 0.0, std }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::{declared, sound};

    #[test]
    fn a_dead_band_silences_more_than_its_meters_noise_does() {
        let (traces, declared) = ([sound(20)], declared());
        let problem = Problem::new(&traces, &declared, &[]);
        let Sensors { flow_a, flow_b, .. } = declared.sensors;
        for (effect, noise) in [(Effect::FlowMeterDeadBandA, flow_a), (Effect::FlowMeterDeadBandB, flow_b)] {
            let term = problem.place(Term::Effect(effect)).expect("is a term");
            let allows = |sigma: f64| problem.allows(term, sigma * noise.noise_std);
            assert_eq!([0.5, 2.9, 3.1, 30.0].map(allows), [false, false, true, true], "{effect:?}");
        }
    }
}
