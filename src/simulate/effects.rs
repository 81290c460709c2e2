use crate::Rig;
use pitchleak_core::effects::{EffectConstants, EffectError, LaggedReading, Play, UnknownEffect};
use pitchleak_core::{Effect, EffectSet, Leak, Signals};

/// One effect and its size, SI: `viscous_friction=1500`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectSize {
    /// Which.
    pub effect: Effect,
    /// Its value in the unit of its [`pitchleak_core::effects::EffectSpec`].
    pub value: f64,
}

/// Why effects cannot be switched on.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EffectsError {
    /// No `=`, or no number after it.
    #[error("`{0}` is not of the form id=value with a number in SI units")]
    Form(String),
    /// No effect has this id.
    #[error("`{id}`: {source}")]
    Unknown {
        /// The id.
        id: String,
        /// The ids that are known.
        source: UnknownEffect,
    },
    /// A leak of the model itself.
    #[error("`{id}` is a leak of the model, not an effect: use --leak-{} (in Python `leak_{}`)", .leak.id().replace('_', "-"), .leak.id())]
    ModelLeak {
        /// As named.
        id: String,
        /// The leak.
        leak: Leak,
    },
    /// Which of two sizes is meant?
    #[error("`{0}` is given twice")]
    Repeated(&'static str),
    /// The value does not suit the effect, or there are too many.
    #[error(transparent)]
    Value(#[from] EffectError),
}

impl EffectSize {
    /// The effect of this id.
    ///
    /// # Errors
    /// [`EffectsError::Unknown`], [`EffectsError::ModelLeak`].
    pub fn new(id: &str, value: f64) -> Result<Self, EffectsError> {
        let own = ["internal_leak", "external_leak_a", "external_leak_b"];
        if let Some((_, leak)) = own.into_iter().zip(Leak::ALL).find(|(name, _)| *name == id) {
            return Err(EffectsError::ModelLeak { id: id.to_owned(), leak });
        }
        let effect = id.parse().map_err(|source| EffectsError::Unknown { id: id.to_owned(), source })?;
        Ok(Self { effect, value })
    }
}

impl std::str::FromStr for EffectSize {
    type Err = EffectsError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let form = || EffectsError::Form(text.to_owned());
        let (id, value) = text.split_once('=').ok_or_else(form)?;
        Self::new(id.trim(), value.trim().parse().map_err(|_| form())?)
    }
}

/// The effects of a rig file, as a diagnosis left them there, and `more` that are put on top.
///
/// # Errors
/// [`EffectsError`].
pub fn effects(rig: &Rig, more: &[EffectSize]) -> Result<EffectSet<f64>, EffectsError> {
    let mut set = rig.effect_set();
    for (index, EffectSize { effect, value }) in more.iter().enumerate() {
        if more.iter().take(index).any(|earlier| earlier.effect == *effect) {
            return Err(EffectsError::Repeated(effect.spec().id));
        }
        set.set(*effect, *value, EffectConstants::default())?;
    }
    Ok(set)
}

/// A sensor whose readings are no linear map of what it measures at that instant, but depend on what was before, or not at all on
/// what is too small; and what it remembers.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_is_an_id_and_a_number() {
        let size: EffectSize = "viscous_friction = 1500".parse().expect("an effect");
        assert_eq!(size, EffectSize { effect: Effect::ViscousFriction, value: 1500.0 });
        assert!(matches!("viscous_friction".parse::<EffectSize>(), Err(EffectsError::Form(_))));
        assert!(matches!("viscous_friction=much".parse::<EffectSize>(), Err(EffectsError::Form(_))));
        let unknown = "sand=1".parse::<EffectSize>().expect_err("no such effect").to_string();
        assert!(unknown.starts_with("`sand`: ") && unknown.contains("position_gain"), "{unknown}");
        let leak = "external_leak_b=1e-12".parse::<EffectSize>().expect_err("the model's own").to_string();
        assert!(leak.contains("--leak-external-b") && leak.contains("`leak_external_b`"), "{leak}");
        let out_of_range = [EffectSize { effect: Effect::ViscousFriction, value: f64::NAN }];
        assert!(matches!(effects(&Rig::paper(), &out_of_range), Err(EffectsError::Value(_))));
        assert_eq!(effects(&Rig::paper(), &[size, size]), Err(EffectsError::Repeated("viscous_friction")));
    }
}
