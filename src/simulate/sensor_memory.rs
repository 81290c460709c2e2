//! Sensors whose readings are no linear map of what they measure at that instant: they depend on what was before, or not at all on what
//! is too small.

use pitchleak_core::effects::{LaggedReading, Play};
use pitchleak_core::{Effect, Signals};

/// Such a sensor, and what it remembers.
pub(super) struct RememberingSensor {
    effect: Effect,
    /// Of the effect.
    value: f64,
    memory: Memory,
}

enum Memory {
    /// It answers late.
    Late([Option<LaggedReading<f64>>; 2]),
    /// It has play.
    Hanging(Play<f64>),
    /// It shows nothing of what is smaller than the value, and remembers nothing.
    Deaf,
}

impl RememberingSensor {
    /// Sensors that have shown these signals for long; none where the effect has no memory.
    pub(super) fn new(effect: Effect, value: f64, signals: &mut Signals<f64>) -> Option<Self> {
        let hanging = effect.hanging(signals).map(|signal| Memory::Hanging(Play::new(*signal)));
        let late = effect.late(signals).map(|signal| signal.map(|now| LaggedReading::new(*now)));
        let late = late.iter().any(Option::is_some).then_some(Memory::Late(late));
        let deaf = effect.deaf(signals).map(|_| Memory::Deaf);
        hanging.or(late).or(deaf).map(|memory| Self { effect, value, memory })
    }

    /// Puts the readings in the signals' place.
    pub(super) fn show(&mut self, step_s: f64, signals: &mut Signals<f64>) {
        match &mut self.memory {
            Memory::Late(readings) => {
                for (signal, reading) in self.effect.late(signals).into_iter().zip(readings) {
                    if let (Some(signal), Some(reading)) = (signal, reading) {
                        *signal = reading.update(step_s, self.value, *signal);
                    }
                }
            }
            Memory::Hanging(play) => {
                if let Some(signal) = self.effect.hanging(signals) {
                    *signal = play.update(self.value, *signal);
                }
            }
            Memory::Deaf => {
                if let Some(signal) = self.effect.deaf(signals).filter(|signal| signal.abs() < self.value) {
                    *signal = 0.0;
                }
            }
        }
    }
}
