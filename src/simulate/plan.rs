use super::{Biases, EffectSize, EffectsError, Followed, LeakSize, Recording, Scenario, effects};
use crate::Rig;
use crate::reference::ReferenceError;
use crate::units::{self, Dimension};
use crate::wind::{EmulationError, HistoryError};
use pitchleak_core::{PerLeak, Sensors};

/// Time for which the loops run before a trace begins, s.
const WARM_UP_S: f64 = 10.0;
/// Length of a trace where nothing says another, s.
const DURATION_S: f64 = 60.0;

/// White noise of every sensor, 3σ as a share of full scale.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Noise {
    /// None at all.
    #[default]
    None,
    /// As the rig file declares.
    Rig,
    /// This share, whatever the rig file says.
    Share(f64),
}

impl std::str::FromStr for Noise {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let allowed = |error: &dyn std::fmt::Display| format!("{error}; or `none`, or `rig`");
        match text {
            "none" => Ok(Self::None),
            "rig" => Ok(Self::Rig),
            _ => match units::parse(text, Dimension::Share) {
                Ok(share) if share >= 0.0 => Ok(Self::Share(share)),
                Ok(_) => Err(allowed(&"must not be negative")),
                Err(error) => Err(allowed(&error)),
            },
        }
    }
}

impl Noise {
    fn sensors(self, rig: &Rig) -> Sensors<f64> {
        let accuracy = match self {
            Self::Rig => return rig.sensors(),
            Self::None => 0.0,
            Self::Share(share) => share,
        };
        rig.instruments.with_accuracy(accuracy).spread()
    }
}

/// What is asked of a simulation; what is left out follows from the reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What the rig follows.
    pub followed: Followed,
    /// Laminar leaks.
    pub leaks: PerLeak<LeakSize>,
    /// Time into the trace at which the leaks open, s; zero or less: before it begins.
    pub onset_s: f64,
    /// Effects beyond those of the rig file.
    pub effects: Vec<EffectSize>,
    /// Noise of the sensors.
    pub noise: Noise,
    /// Greatest constant offset of each sensor, share of full scale.
    pub bias_share: f64,
    /// Seed of noise and offsets.
    pub seed: u64,
    /// Where in the reference the trace begins, s; else once the loops have run in.
    pub start_s: Option<f64>,
    /// Length of the trace, s; else a minute, or what the reference has.
    pub duration_s: Option<f64>,
    /// Samples per second.
    pub sample_rate_hz: f64,
}

/// Why a plan cannot be carried out.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// Wind to follow.
    #[error(transparent)]
    Wind(#[from] HistoryError),
    /// Wind that the rig cannot follow.
    #[error(transparent)]
    Emulation(#[from] EmulationError),
    /// Position or load to follow.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// Effects that cannot be switched on.
    #[error(transparent)]
    Effects(#[from] EffectsError),
}

impl Plan {
    /// The recording of `rig` as it follows what it is to follow.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn recording(&self, rig: Rig) -> Result<Recording, PlanError> {
        let reference = self.followed.reference(&rig)?;
        let (begin, end) = reference.span_s().unwrap_or((0.0, f64::INFINITY));
        let start_s = self.start_s.map_or(begin + WARM_UP_S.min(0.5 * (end - begin)), |start| begin + start);
        Ok(Recording {
            followed: self.followed.to_string(),
            noise: self.noise.sensors(&rig),
            biases: Biases::drawn(&rig.instruments, self.bias_share, self.seed),
            seed: self.seed,
            scenario: Scenario {
                effects: effects(&rig, &self.effects)?,
                rig,
                leaks: self.leaks,
                onset_s: self.onset_s,
                start_s,
                warm_up_s: WARM_UP_S,
                duration_s: self.duration_s.unwrap_or(DURATION_S.min(end - start_s)),
                sample_rate_hz: self.sample_rate_hz,
                reference,
            },
        })
    }
}
