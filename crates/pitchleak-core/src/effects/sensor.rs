use super::Effect;
use crate::{Model, Real, Signals, Terms};

/// What one unit of a sensor effect does to the readings:
/// `reading = truth · (1 + value · scale) + value · shift`, signal by signal.
pub(super) struct Distortion<T> {
    scale: Signals<T>,
    shift: Signals<T>,
}

impl<T: Real> Distortion<T> {
    /// Readings as the truth.
    pub fn none() -> Self {
        Self { scale: Signals::default(), shift: Signals::default() }
    }

    /// What the sensors show of the truth.
    #[inline(always)]
    fn read(&self, value: T, truth: &Signals<T>) -> Signals<T> {
        let scaled = truth.zip(self.scale, |signal, gain| signal * (T::one() + value * gain));
        scaled.zip(self.shift, |signal, more| signal + value * more)
    }
}

/// Readings in proportion to the truth.
pub(super) fn scale<T: Real>(scale: Signals<T>) -> Distortion<T> {
    Distortion { scale, shift: Signals::default() }
}

/// Readings beside the truth.
pub(super) fn shift<T: Real>(shift: Signals<T>) -> Distortion<T> {
    Distortion { scale: Signals::default(), shift }
}

/// A flow that is not measured is none: what is read in its place stays as it was.
pub(super) fn known<T: Real>(flow: T) -> T {
    if flow.is_finite() { flow } else { T::zero() }
}

/// What the sensors show of the truth.
#[inline]
pub(super) fn read<T: Real>(effect: Effect, value: T, truth: &Signals<T>) -> Signals<T> {
    effect.distortion(truth).read(value, truth)
}

/// The truth behind a reading: [`read`] undone.
pub(super) fn correct<T: Real>(effect: Effect, value: T, reading: &Signals<T>) -> Signals<T> {
    let Distortion { scale, shift } = effect.distortion(reading);
    reading
        .zip(shift, |s, more| s - value * more)
        .zip(scale, |signal, gain| signal / (T::one() + value * gain))
}

/// What one unit of a sensor effect adds, to first order, to the declared model's residual when
/// that is computed from the readings.
pub(super) fn unit_term<T: Real>(effect: Effect, at: &Signals<T>, model: &Model<T>) -> Terms<T> {
    let distortion = effect.distortion(at);
    model.misread(T::lit(effect.spec().default_size), |value| distortion.read(value, at))
}

/// The dynamic form of [`Effect::FlowMeterLag`] and [`Effect::PressureLagA`]: τ y' + y = u by backward Euler,
/// stable for every step; [`Effect::read`]'s `−τ du/dt` is its first-order part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LaggedReading<T> {
    reading: T,
}

impl<T: Real> LaggedReading<T> {
    /// A sensor that has shown `signal` for long.
    pub fn new(signal: T) -> Self {
        Self { reading: signal }
    }

    /// The reading `step_s` later; `lag_s` is τ. What is not a number is passed over.
    pub fn update(&mut self, step_s: T, lag_s: T, signal: T) -> T {
        let reading = self.reading + (signal - self.reading) * step_s / (step_s + lag_s);
        if reading.is_finite() {
            self.reading = reading;
        }
        self.reading
    }
}

/// The dynamic form of [`Effect::PressureHysteresisA`]: what is moved with play hangs behind what moves it (the play operator of
/// Krasnosel'skii and Pokrovskii 1989, "Systems with Hysteresis"). [`Effect::read`] knows it by the side of the play alone.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Play<T> {
    middle: T,
}

impl<T: Real> Play<T> {
    /// In the middle of its play at `signal`.
    pub fn new(signal: T) -> Self {
        Self { middle: signal }
    }

    /// What hangs behind `signal` by no more than `play` either way. What is not a number is passed over.
    pub fn update(&mut self, play: T, signal: T) -> T {
        let (low, high) = (signal - play, signal + play);
        if low.is_finite() && high.is_finite() {
            self.middle = self.middle.max(low).min(high);
        }
        self.middle
    }

    /// Moves on to `signal`, and says where in a play of this width it lies: 1 as far ahead as it can be, −1 as far behind.
    pub fn side(&mut self, play: T, signal: T) -> T {
        let ahead = (signal - self.update(play, signal)) / play;
        if ahead.is_finite() { ahead } else { T::zero() }
    }
}
