//! Effects that the plain model of eq. (1)–(2) lacks. Each is written once, in its entry of `table.rs`: the plant
//! adds its term when it simulates, the diagnosis takes the same term as a regressor.

mod constants;
mod entry;
mod set;
mod table;
mod terms;

pub use constants::{EffectConstant, EffectConstantSpec, EffectConstants};
pub use entry::{EffectKind, EffectSpec, LeftSide};
pub use set::{ActiveEffect, EffectError, EffectSet};
pub use table::{Effect, UnknownEffect};
pub use terms::{LaggedReading, Play};

use crate::{Model, Real, Signals, Terms};

impl Effect {
    /// The effect's regressor: what one unit of it leaves in [`Model::residual`] at the instant
    /// `at`. The term itself is its value times this; a sensor's term holds to first order.
    #[inline]
    pub fn unit_term<T: Real>(
        self,
        at: &Signals<T>,
        model: &Model<T>,
        constants: &EffectConstants<T>,
    ) -> Terms<T> {
        match self.spec().kind {
            EffectKind::Sensor => {
                let distortion = self.distortion(at);
                model.misread(T::lit(self.spec().default_size), |value| distortion.read(value, at))
            }
            _ => self.physical_term(at, model, constants),
        }
    }

    /// The constants on which this effect's term depends; empty for most.
    pub const fn constants(self) -> &'static [EffectConstant] {
        self.spec().constants
    }

    /// Those of them that a fit may vary.
    pub fn fitted_constants(self) -> impl Iterator<Item = EffectConstant> {
        let EffectSpec { constants, given, .. } = self.spec();
        constants.iter().copied().filter(|own| !given.contains(own))
    }

    /// Whether it is a sensor that answers late.
    pub fn is_lag(self) -> bool {
        self.late(&mut Signals::<()>::default()).iter().any(Option::is_some)
    }

    /// What the sensors show when this effect has size `value`; physical effects change nothing.
    #[inline]
    pub fn read<T: Real>(self, value: T, truth: &Signals<T>) -> Signals<T> {
        self.distortion(truth).read(value, truth)
    }

    /// The truth behind a reading when this effect has size `value`.
    ///
    /// For a lag, the derivative is that of the reading, which makes the inverse exact.
    pub fn correct<T: Real>(self, value: T, reading: &Signals<T>) -> Signals<T> {
        self.distortion(reading).correct(value, reading)
    }
}
