//! Where the model stands: its constants and the effects found so far.

use super::leak_change::LeakChange;
use super::terms::{Balances, Term};
use crate::diagnose::data::{Declared, Motion, Series};
use crate::diagnose::equation::PerEquation;
use crate::diagnose::thresholds::{NEGLIGIBLE_SHARE, SIGNIFICANT_SIGMA, TURNED};
use pitchleak_core::effects::{ActiveEffect, EffectConstant, EffectConstants, EffectKind};
use pitchleak_core::{Effect, EffectSet, Leak, Model, PerLeak, Sensors, Signals, Terms};

/// The values around which the regression is linear.
#[derive(Clone, Debug)]
pub(crate) struct Linearisation {
    pub(crate) model: Model<f64>,
    /// Sensor effects are undone on the readings; physical ones are subtracted.
    pub(crate) effects: EffectSet<f64>,
    /// The speed beyond which the dry friction that the rig file declares has turned, m/s; zero where it declares none.
    turned_mps: f64,
    /// Values of 1/β that the rig file leaves possible, per Pa.
    pub(crate) compressibility: (f64, f64),
    /// What the leaks' changes came to last. They stay in what is left over, as their columns are exact at any size: only the speed that
    /// forces feel hangs on them.
    changes: Vec<(LeakChange, f64)>,
}

/// The same instant with the motion that forces feel (`data/motion.rs`).
pub(crate) fn as_felt(seen: &Signals<f64>, felt: &Signals<f64>) -> Signals<f64> {
    Signals { v_mps: felt.v_mps, a_mps2: felt.a_mps2, ..*seen }
}

/// Whether two instants agree in all that physical effects depend on.
fn is_same(one: &Signals<f64>, other: &Signals<f64>) -> bool {
    let motion = |m: &Signals<f64>| [m.x_m, m.v_mps, m.a_mps2, m.temp_k].map(f64::to_bits);
    let oil =
        |m: &Signals<f64>| [m.pa_pa, m.pb_pa, m.dpa_pas, m.dpb_pas, m.qa_m3s, m.qb_m3s].map(f64::to_bits);
    motion(one) == motion(other) && oil(one) == oil(other)
}

/// The speed beyond which all dry friction among these effects has turned, m/s. One that turns more slowly than is usual was measured.
fn turned_mps(declared: &EffectSet<f64>) -> f64 {
    let usual_mps = EffectConstants::<f64>::default().slip_speed_mps;
    let dry = declared.iter().filter(|one| Term::Effect(one.effect).is_dry_friction());
    dry.map(|one| TURNED * one.constants.slip_speed_mps.min(usual_mps)).fold(0.0, f64::max)
}

impl Linearisation {
    /// The declared model without leaks.
    pub(crate) fn declared(declared: &Declared) -> Self {
        let fluid = declared.fluid;
        let compressibility = 1.0 / fluid.bulk_modulus_pa;
        let share = SIGNIFICANT_SIGMA * fluid.bulk_modulus_std_pa / fluid.bulk_modulus_pa;
        Self {
            model: Model { cylinder: declared.cylinder, fluid, leaks_m3spa: PerLeak::default() },
            effects: declared.effects,
            turned_mps: turned_mps(&declared.effects),
            // What is softer or stiffer is no oil but an effect.
            compressibility: (compressibility / (1.0 + share), compressibility * (1.0 + share)),
            changes: Vec::new(),
        }
    }

    /// The leaks at a time of a trace, changes included.
    fn leaks_at(&self, trace: usize, t_s: f64) -> PerLeak<f64> {
        let mut leaks = self.model.leaks_m3spa;
        for (change, value) in &self.changes {
            leaks[change.leak] += value * change.at(trace, t_s);
        }
        leaks
    }

    /// What is known of a term's value, which a change has in what is left over.
    pub(crate) fn known(&self, term: Term) -> f64 {
        let Term::LeakChange(change) = term else { return self.value(term) };
        self.changes.iter().find(|(own, _)| *own == change).map_or(0.0, |(_, value)| *value)
    }

    /// The residual of the three equations at corrected readings.
    pub(crate) fn residual(&self, at: &Signals<f64>) -> Terms<f64> {
        self.residual_with(&self.model, at)
    }

    /// The motion of traces in which nothing of this is left of the chambers' equations, with the leaks of each time.
    pub(crate) fn motions(&self, traces: &[Series], sensors: &Sensors<f64>) -> Vec<Motion> {
        let of = |(trace, series): (usize, &Series)| {
            let model_at = |t_s: f64| Model { leaks_m3spa: self.leaks_at(trace, t_s), ..self.model };
            let residual = |t_s: f64, seen: &Signals<f64>| self.residual_with(&model_at(t_s), seen);
            let motion = Motion::of(series, &self.model.cylinder, residual, &self.effects, sensors);
            Motion { turned_mps: self.turned_mps, ..motion }
        };
        traces.iter().enumerate().map(of).collect()
    }

    fn residual_with(&self, model: &Model<f64>, at: &Signals<f64>) -> Terms<f64> {
        let known = self.effects.terms(at, model, |kind| kind != EffectKind::Sensor);
        model.residual(at).plus(-1.0, known)
    }

    /// The residual of the equations at readings as the sensors show them: the chambers by the position's own speed,
    /// the forces by speed and acceleration of `felt`.
    pub(crate) fn both_residuals(&self, reading: &Signals<f64>, felt: &Signals<f64>) -> PerEquation<f64> {
        let seen = self.effects.correct(reading);
        self.residual_of(&seen, &as_felt(&seen, felt))
    }

    /// Residuals of the equations at corrected readings: those `seen`, and those that forces feel.
    pub(crate) fn residual_of(&self, seen: &Signals<f64>, felt: &Signals<f64>) -> PerEquation<f64> {
        let mut residual = PerEquation::from(self.residual(seen));
        residual.force = self.residual(felt).force_n;
        residual
    }

    /// What one unit of a term adds to them.
    pub(super) fn both_unit_terms(
        &self,
        (term, balances): (Term, Balances),
        constants: &EffectConstants<f64>,
        seen: &Signals<f64>,
        felt: &Signals<f64>,
    ) -> PerEquation<f64> {
        let of_chambers =
            if balances.chambers { self.unit_term(term, seen, constants) } else { Terms::default() };
        let force = if balances.force { self.unit_term(term, felt, constants).force_n } else { 0.0 };
        PerEquation { force, ..PerEquation::from(of_chambers) }
    }

    /// What one unit of a term adds to [`Self::residual`] at corrected readings: a sensor's error also spoils what
    /// the physical effects found so far are computed from, and a leak the direction that is told from the flows.
    pub(crate) fn unit_term(
        &self,
        term: Term,
        at: &Signals<f64>,
        constants: &EffectConstants<f64>,
    ) -> Terms<f64> {
        let own = match term {
            Term::Constant(effect, constant) => self.by_constant(effect, constant, at),
            _ => term.unit_term(at, &self.model, constants),
        };
        let is_physical = |kind| kind != EffectKind::Sensor;
        if self.effects.iter().all(|one| !is_physical(one.effect.spec().kind)) {
            return own;
        }
        let step = NEGLIGIBLE_SHARE * term.usual_size();
        if let Some(leak) = Leak::ALL.into_iter().find(|leak| Term::of_leak(*leak) == term) {
            if self.effects.iter().all(|one| !one.effect.spec().kind.is_leak()) {
                return own;
            }
            let known = |by: f64| {
                let mut model = self.model;
                model.leaks_m3spa[leak] += by;
                self.effects.terms(at, &model, EffectKind::is_leak)
            };
            return own.plus(0.5 / step, known(step).plus(-1.0, known(-step)));
        }
        let above = term.read(step, at).filter(|above| !is_same(above, at));
        let Some((above, below)) = above.zip(term.read(-step, at)) else { return own };
        let known = |at: &Signals<f64>| self.effects.terms(at, &self.model, is_physical);
        own.plus(-0.5 / step, known(&above).plus(-1.0, known(&below)))
    }

    /// What a unit of a constant adds, at the size that its effect has.
    fn by_constant(&self, effect: Effect, constant: EffectConstant, at: &Signals<f64>) -> Terms<f64> {
        let Some(active) = self.active(effect) else { return Terms::default() };
        // None can be told at zero: the column is no number then, and stays empty.
        let value = active.constants.get(constant);
        let step = NEGLIGIBLE_SHARE * value;
        let unit = |value| effect.unit_term(at, &self.model, &active.constants.with(constant, value));
        let slope = unit(value + step).plus(-1.0, unit(value - step));
        Terms::default().plus(0.5 * active.value / step, slope)
    }

    fn active(&self, effect: Effect) -> Option<&ActiveEffect<f64>> {
        self.effects.iter().find(|active| active.effect == effect)
    }

    /// Value of a term here; what the model does not know is zero.
    pub(crate) fn value(&self, term: Term) -> f64 {
        let leaks = &self.model.leaks_m3spa;
        match term {
            Term::InverseBulk => 1.0 / self.model.fluid.bulk_modulus_pa,
            Term::Internal => leaks.internal,
            Term::ExternalA => leaks.external_a,
            Term::ExternalB => leaks.external_b,
            Term::Effect(effect) => self.active(effect).map_or(0.0, |active| active.value),
            Term::Constant(effect, constant) => {
                self.active(effect).map_or(0.0, |active| active.constants.get(constant))
            }
            Term::Unlisted(_) | Term::Product(..) | Term::LeakChange(_) => 0.0,
        }
    }

    /// This linearisation with one term at another value, held within what physics allows.
    #[must_use]
    pub(crate) fn with(mut self, term: Term, value: f64, constants: &EffectConstants<f64>) -> Self {
        self.set(term, value, constants);
        self
    }

    fn set(&mut self, term: Term, value: f64, constants: &EffectConstants<f64>) {
        let leaks = &mut self.model.leaks_m3spa;
        match term {
            Term::InverseBulk => {
                self.model.fluid.bulk_modulus_pa =
                    1.0 / value.clamp(self.compressibility.0, self.compressibility.1)
            }
            Term::Internal => leaks.internal = value,
            Term::ExternalA => leaks.external_a = value,
            Term::ExternalB => leaks.external_b = value,
            Term::Effect(effect) => self.set_effect(effect, value, constants),
            Term::LeakChange(change) => {
                self.changes.retain(|(own, _)| *own != change);
                self.changes.push((change, value));
            }
            Term::Constant(effect, constant) => {
                let value = value.clamp(constant.spec().lower, constant.spec().upper);
                if let Some(ActiveEffect { value: size, constants, .. }) = self.active(effect).copied() {
                    self.set_effect(effect, size, &constants.with(constant, value));
                }
            }
            Term::Unlisted(_) | Term::Product(..) => {}
        }
    }

    fn set_effect(&mut self, effect: Effect, value: f64, constants: &EffectConstants<f64>) {
        let spec = effect.spec();
        // Full or unphysical: the effect stays as it was, and the regression goes on around that.
        let _ = self.effects.set(effect, value.clamp(spec.lower, spec.upper), *constants);
    }
}
