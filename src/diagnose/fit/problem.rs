//! What a diagnosis fits, and all that stays the same while it tries one effect after the other.

use super::regression::Prior;
use crate::diagnose::data::{Declared, Motion, SensorCheck, Series, effective};
use crate::diagnose::thresholds::LEAST_LAG_SHARE;
use crate::diagnose::weak_form::{DECLARED, Linearisation, Term, all_terms};
use pitchleak_core::effects::{EffectConstant, EffectConstants};
use pitchleak_core::{Model, PerLeak, Sensors};

/// Traces of one rig, the terms that may explain them, and what is known of these beside the data.
pub(crate) struct Problem<'a> {
    pub(crate) traces: &'a [Series],
    /// With the noise that the sensors really carry.
    pub(crate) sensors: Sensors<f64>,
    /// The same without ripples, which average away within a block: what columns share with the residual.
    pub(super) white: Sensors<f64>,
    pub(crate) terms: Vec<Term>,
    pub(crate) priors: Vec<Option<Prior>>,
    /// No shorter lag is named.
    least_lag_s: f64,
    /// The constants that every effect starts from.
    pub(crate) usual_constants: EffectConstants<f64>,
    /// The declared model, from which the fit sets out.
    pub(super) start: Linearisation,
}

impl<'a> Problem<'a> {
    pub(crate) fn new(traces: &'a [Series], declared: &Declared, checks: &[SensorCheck]) -> Self {
        let terms = all_terms();
        Self {
            traces,
            sensors: effective(&declared.sensors, checks, |_| true),
            white: effective(&declared.sensors, checks, |check| !check.is_ripple()),
            priors: terms.iter().map(|term| prior(*term, declared)).collect(),
            terms,
            least_lag_s: LEAST_LAG_SHARE * traces.iter().map(Series::step_s).fold(0.0, f64::max),
            usual_constants: friction_constants(traces, declared),
            start: Linearisation::declared(declared),
        }
    }

    /// The terms of the declared model: its constants, and what the rig file says may be there.
    pub(super) fn declared_terms(&self) -> Vec<usize> {
        let is_declared = |i: &usize| DECLARED.contains(&self.terms[*i]) || self.priors[*i].is_some();
        (0..self.terms.len()).filter(is_declared).collect()
    }

    /// The place of a term.
    pub(crate) fn place(&self, term: Term) -> Option<usize> {
        self.terms.iter().position(|one| *one == term)
    }

    /// The priors as increments from a linearisation.
    pub(super) fn increments(&self, at: &Linearisation) -> Vec<Option<Prior>> {
        let from_there = |(prior, term): (&Option<Prior>, &Term)| {
            prior.map(|prior| Prior { mean: prior.mean - at.value(*term), ..prior })
        };
        self.priors.iter().zip(&self.terms).map(from_there).collect()
    }

    /// Values of a term that physics allows and samples can show.
    pub(crate) fn allows(&self, term: usize, value: f64) -> bool {
        let (lower, upper) = self.terms[term].bounds();
        let is_lag = self.terms[term].effect().is_some_and(|effect| effect.spec().unit == "s");
        (lower..=upper).contains(&value) && !(is_lag && value < self.least_lag_s)
    }
}

/// Friction turns within the speed that these traces can resolve.
fn friction_constants(traces: &[Series], declared: &Declared) -> EffectConstants<f64> {
    let model = Model { cylinder: declared.cylinder, fluid: declared.fluid, leaks_m3spa: PerLeak::default() };
    let least = |motion: &Motion| (motion.least_sure_mps() / 3.0, motion.rms_mps);
    let speeds: Vec<(f64, f64)> = traces
        .iter()
        .map(|series| least(&Motion::of(series, &model, &declared.effects, &declared.sensors)))
        .collect();
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
