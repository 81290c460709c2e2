//! Where the model stands: its constants and the effects found so far.

use super::term::Term;
use pitchleak_core::effects::{EffectKind, Shape};
use pitchleak_core::{Effect, EffectSet, Model, Moment, Terms};

/// The values around which the regression is linear.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) model: Model<f64>,
    /// Sensor effects are undone on the readings; physical ones are subtracted.
    pub(super) effects: EffectSet<f64>,
}

impl Point {
    /// What is left of the three equations at corrected readings.
    pub(super) fn residual(&self, at: &Moment<f64>) -> Terms<f64> {
        let known = self.effects.terms(at, &self.model, |kind| kind != EffectKind::Sensor);
        self.model.residual(at).plus(-1.0, known)
    }

    /// Value of a term here; what the point does not know is zero.
    pub(super) fn value(&self, term: Term) -> f64 {
        let leaks = &self.model.leaks;
        match term {
            Term::InverseBulk => 1.0 / self.model.fluid.bulk_modulus_pa,
            Term::Internal => leaks.internal_m3spa,
            Term::ExternalA => leaks.external_a_m3spa,
            Term::ExternalB => leaks.external_b_m3spa,
            Term::Effect(effect) => {
                self.effects.iter().find(|active| active.effect == effect).map_or(0.0, |active| active.value)
            }
            Term::Nameless(_) => 0.0,
        }
    }

    /// The same point with one term at another value, held within what physics allows.
    pub(super) fn set(&mut self, term: Term, value: f64, shape: &Shape<f64>) {
        let leaks = &mut self.model.leaks;
        match term {
            Term::InverseBulk => self.model.fluid.bulk_modulus_pa = 1.0 / value.clamp(1e-12, 1e-6),
            Term::Internal => leaks.internal_m3spa = value,
            Term::ExternalA => leaks.external_a_m3spa = value,
            Term::ExternalB => leaks.external_b_m3spa = value,
            Term::Effect(effect) => self.set_effect(effect, value, shape),
            Term::Nameless(_) => {}
        }
    }

    fn set_effect(&mut self, effect: Effect, value: f64, shape: &Shape<f64>) {
        let spec = effect.spec();
        // Full or unphysical: the effect stays as it was, and the regression goes on around that.
        let _ = self.effects.set(effect, value.clamp(spec.lower, spec.upper), *shape);
    }
}
