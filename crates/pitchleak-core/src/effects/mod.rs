//! Effects that the plain model of eq. (1)–(2) lacks. Each is written once: the plant adds its
//! term when it simulates, the diagnosis takes the same term as a regressor.

mod physical;
mod sensor;
mod set;
mod table;

pub use sensor::LaggedFlow;
pub use set::{ActiveEffect, EffectError, EffectSet};
pub use table::{Effect, EffectKind, EffectSpec, UnknownEffect};

use crate::{Model, Moment, Real, Terms};

/// The constants in which some effects are not linear. Every effect is linear in its value.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Shape<T> {
    /// Gas: gauge pressure at which the accumulator's volume is counted, and below which it takes
    /// no oil, Pa. Zero for a trapped bubble.
    pub precharge_pa: T,
    /// Gas: polytropic exponent, 1 (slow) to 1.4 (fast).
    pub polytropic_exponent: T,
    /// Friction: speed within which its direction turns, m/s.
    pub slip_speed_mps: T,
    /// Stribeck friction: speed at which it has fallen to 1/e, m/s.
    pub stribeck_speed_mps: T,
    /// Worn spot: where, m from the A end.
    pub spot_position_m: T,
    /// Worn spot: distance at which the leak has fallen to 1/e, m.
    pub spot_width_m: T,
    /// Temperature at which the declared leak holds, K.
    pub reference_temp_k: T,
}

impl<T: Real> Default for Shape<T> {
    fn default() -> Self {
        Self {
            precharge_pa: T::zero(),
            polytropic_exponent: T::lit(1.2),
            slip_speed_mps: T::lit(1e-3),
            stribeck_speed_mps: T::lit(0.02),
            spot_position_m: T::lit(0.1),
            spot_width_m: T::lit(0.02),
            reference_temp_k: T::lit(313.15),
        }
    }
}

impl<T: Real> Shape<T> {
    /// Whether every constant can be used.
    pub fn is_physical(&self) -> bool {
        let positive =
            [self.polytropic_exponent, self.slip_speed_mps, self.stribeck_speed_mps, self.spot_width_m];
        let plain = [self.precharge_pa, self.spot_position_m, self.reference_temp_k];
        positive.iter().all(|v| v.is_finite() && *v > T::zero())
            && plain.iter().all(|v| v.is_finite())
            && self.precharge_pa >= T::zero()
    }
}

impl Effect {
    /// The effect's regressor: what one unit of it leaves in [`Model::residual`] at the instant
    /// `at`. The term itself is its value times this; a sensor's term holds to first order.
    #[inline]
    pub fn unit_term<T: Real>(self, at: &Moment<T>, model: &Model<T>, shape: &Shape<T>) -> Terms<T> {
        match self.spec().kind {
            EffectKind::Sensor => sensor::unit_term(self, at, model),
            _ => physical::unit_term(self, at, model, shape),
        }
    }

    /// What the sensors show when this effect has size `value`; physical effects change nothing.
    pub fn read<T: Real>(self, value: T, truth: &Moment<T>) -> Moment<T> {
        sensor::read(self, value, truth)
    }

    /// The truth behind a reading when this effect has size `value`.
    ///
    /// For a lag, the derivative is that of the reading, which makes the inverse exact.
    pub fn correct<T: Real>(self, value: T, reading: &Moment<T>) -> Moment<T> {
        sensor::correct(self, value, reading)
    }
}
