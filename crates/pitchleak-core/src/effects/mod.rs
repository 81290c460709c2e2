//! Effects that the plain model of eq. (1)–(2) lacks. Each is written once, in its entry of `table.rs`: the plant
//! adds its term when it simulates, the diagnosis takes the same term as a regressor.

mod entry;
mod table;
mod terms;

pub use entry::{EffectConstant, EffectConstantSpec, EffectConstants, EffectKind, EffectSpec, LeftSide};
pub use table::{Effect, UnknownEffect};
pub use terms::{LaggedReading, Play};

use crate::{Cylinder, Model, Real, Signals, Terms};

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

/// Effects that may act at the same time.
const CAPACITY: usize = 8;

/// One effect that is switched on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ActiveEffect<T> {
    /// Which.
    pub effect: Effect,
    /// How large, in the unit of its [`EffectSpec`].
    pub value: T,
    /// The constants it is not linear in.
    pub constants: EffectConstants<T>,
}

/// The effects that are switched on, at most eight.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EffectSet<T> {
    active: [Option<ActiveEffect<T>>; CAPACITY],
}

/// Error returned by [`EffectSet::set`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EffectError {
    /// The value is not a number or lies outside the bounds of this effect.
    Value(Effect),
    /// A constant of the effect's constants is not usable.
    Constants(Effect),
    /// No room for another effect.
    Full,
}

impl core::fmt::Display for EffectError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Value(effect) => {
                let spec = effect.spec();
                write!(f, "{effect} must lie between {} and {} {}", spec.lower, spec.upper, spec.unit)
            }
            Self::Constants(effect) => {
                write!(f, "constants of {effect} out of bounds;")?;
                effect.constants().iter().try_for_each(|parameter| {
                    let spec = parameter.spec();
                    write!(f, " {} lies between {} and {} {}", spec.id, spec.lower, spec.upper, spec.unit)
                })
            }
            Self::Full => write!(f, "at most {CAPACITY} effects may act at the same time"),
        }
    }
}

impl core::error::Error for EffectError {}

impl<T> Default for EffectSet<T> {
    fn default() -> Self {
        Self { active: [const { None }; CAPACITY] }
    }
}

impl<T: Real> EffectSet<T> {
    /// Switches an effect on, or changes it; zero switches it off.
    pub fn set(
        &mut self,
        effect: Effect,
        value: T,
        constants: EffectConstants<T>,
    ) -> Result<(), EffectError> {
        let spec = effect.spec();
        if !(value >= T::lit(spec.lower) && value <= T::lit(spec.upper)) {
            return Err(EffectError::Value(effect));
        }
        if !constants.is_physical() {
            return Err(EffectError::Constants(effect));
        }
        if value == T::zero() {
            self.switch_off(effect);
            return Ok(());
        }
        let own = |slot: &Option<ActiveEffect<T>>| slot.is_some_and(|active| active.effect == effect);
        let place = self.active.iter().position(own).or(self.active.iter().position(Option::is_none));
        let slot = place.and_then(|i| self.active.get_mut(i)).ok_or(EffectError::Full)?;
        *slot = Some(ActiveEffect { effect, value, constants });
        Ok(())
    }

    /// Those that stay on stand first: who looks for them stops at the first free place.
    fn switch_off(&mut self, effect: Effect) {
        let before = core::mem::take(self);
        let on = before.active.iter().flatten().filter(|active| active.effect != effect);
        for (slot, active) in self.active.iter_mut().zip(on) {
            *slot = Some(*active);
        }
    }

    /// Whether none is on.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.active.first().is_none_or(Option::is_none)
    }

    /// The effects that are on.
    pub fn iter(&self) -> impl Iterator<Item = &ActiveEffect<T>> {
        self.active.iter().map_while(Option::as_ref)
    }

    /// The cylinder as it is where the effects that are on say that it is not as declared.
    #[inline]
    pub fn built(&self, declared: &Cylinder<T>) -> Cylinder<T> {
        let mut cylinder = *declared;
        for active in self.iter().filter(|active| active.effect.spec().kind == EffectKind::Cylinder) {
            if let Some(number) = active.effect.adds_to(&mut cylinder) {
                *number += active.value;
            }
        }
        cylinder
    }

    /// The terms of all physical effects whose kind passes `counts`.
    #[inline]
    pub fn terms(&self, at: &Signals<T>, model: &Model<T>, counts: impl Fn(EffectKind) -> bool) -> Terms<T> {
        self.iter()
            .map(|active| (active, active.effect.spec().kind))
            .filter(|(_, kind)| *kind != EffectKind::Sensor && counts(*kind))
            .fold(Terms::default(), |sum, (active, _)| {
                sum.plus(active.value, active.effect.unit_term(at, model, &active.constants))
            })
    }

    /// What the sensors show of the truth, all sensor effects one after the other.
    pub fn read(&self, truth: &Signals<T>) -> Signals<T> {
        self.iter().fold(*truth, |seen, active| active.effect.read(active.value, &seen))
    }

    /// The truth behind a reading: [`EffectSet::read`] undone, last effect first.
    pub fn correct(&self, reading: &Signals<T>) -> Signals<T> {
        let mut seen = *reading;
        for active in self.active.iter().rev().flatten() {
            seen = active.effect.correct(active.value, &seen);
        }
        seen
    }
}
