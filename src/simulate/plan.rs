use super::{
    Biases, EffectSize, EffectsError, LeakCourse, LeakCourseError, OilTemperature, OilTemperatureError,
    Recording, Scenario, SensorFault, Span, ValveFlaw, WARM_UP_S, effects,
};
use crate::Rig;
use crate::output::Inputs;
use crate::reference::{Reference, ReferenceError, constant_or_file};
use crate::rig::Instruments;
use crate::units::{self, Dimension, UnitError};
use crate::wind::{Emulation, EmulationError, History, HistoryError, Wind};
use pitchleak_core::PerLeak;
use std::fmt;
use std::path::Path;

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

/// Why a text is no share of a sensor's full scale.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ShareError {
    /// No number, or another unit.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// Less than nothing.
    #[error("must not be negative")]
    Negative,
    /// More than the sensor shows.
    #[error("must not exceed 100 % of full scale")]
    AboveFullScale,
    /// `1` for `1 %`.
    #[error("`{0}` is {0} times full scale: did you mean `{0} %`? If not, write it in %")]
    Percent(String),
}

/// A bare number above this is rather meant in per cent.
const LARGEST_BARE_SHARE: f64 = 0.2;

/// A share of full scale, as `1 %` or `0.01`.
///
/// # Errors
/// [`ShareError`]; also for a bare number that must be a percentage.
pub fn share_of_full_scale(text: &str) -> Result<f64, ShareError> {
    let share = units::parse(text, Dimension::Share)?;
    if share < 0.0 {
        Err(ShareError::Negative)
    } else if share > LARGEST_BARE_SHARE && !text.contains('%') {
        Err(ShareError::Percent(text.trim().to_owned()))
    } else if share > 1.0 {
        Err(ShareError::AboveFullScale)
    } else {
        Ok(share)
    }
}

impl std::str::FromStr for Noise {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self::None),
            "rig" => Ok(Self::Rig),
            _ => {
                let share = share_of_full_scale(text).map(Self::Share);
                share.map_err(|error| format!("{error}; or `none`, or `rig`"))
            }
        }
    }
}

impl Noise {
    fn instruments(self, rig: &Rig) -> Instruments {
        match self {
            Self::Rig => rig.instruments,
            Self::None => rig.instruments.with_accuracy(0.0),
            Self::Share(share) => rig.instruments.with_accuracy(share),
        }
    }
}

/// What is asked of a simulation; what is left out follows from the reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What the rig follows.
    pub followed: Followed,
    /// Laminar leaks.
    pub leaks: PerLeak<LeakCourse>,
    /// Time into the trace at which leaks without times of their own open, s; zero or less: before it begins.
    pub onset_s: f64,
    /// The oil's temperature, as [`OilTemperature::of`] reads it.
    pub oil_temperature: Option<String>,
    /// While both ports are shut, in the trace's time: a hold test.
    pub shut: Option<Span>,
    /// Effects beyond those of the rig file.
    pub effects: Vec<EffectSize>,
    /// What the valve of a rig with `[valve]` does beside its data sheet.
    pub valve_flaws: Vec<ValveFlaw>,
    /// Noise of the sensors.
    pub noise: Noise,
    /// Greatest constant offset of each sensor, share of full scale.
    pub bias_share: f64,
    /// Mistakes of the sensors, in the order in which they happen.
    pub sensor_faults: Vec<SensorFault>,
    /// Seed of noise, offsets and mistakes.
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
    /// A piston beyond its end.
    #[error("position {position} is beyond the cylinder's stroke (0 to {stroke_mm} mm)")]
    BeyondStroke {
        /// As given.
        position: String,
        /// mm.
        stroke_mm: f64,
    },
    /// Effects that cannot be switched on.
    #[error(transparent)]
    Effects(#[from] EffectsError),
    /// Leaks that cannot open when they should.
    #[error(transparent)]
    Leak(#[from] LeakCourseError),
    /// A flaw of a valve of which the rig says nothing.
    #[error("the rig has no [valve] that could have flaws: give at least its rated_flow and rated_drop")]
    NoValve,
    /// Impossible oil.
    #[error(transparent)]
    OilTemperature(#[from] OilTemperatureError),
}

impl Plan {
    /// The recording of `rig` as it follows what it is to follow.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn recording(&self, rig: Rig) -> Result<Recording, PlanError> {
        if !self.valve_flaws.is_empty() && rig.valve.is_none() {
            return Err(PlanError::NoValve);
        }
        let reference = self.followed.reference(&rig)?;
        let (begin, end) = reference.span_s().unwrap_or((0.0, f64::INFINITY));
        let start_s = self.start_s.map_or(begin + WARM_UP_S.min(0.5 * (end - begin)), |start| begin + start);
        let left_s = if start_s < end { end - start_s } else { f64::INFINITY };
        let duration_s = self.duration_s.unwrap_or(DURATION_S.min(left_s));
        let opened = self.leaks.map(|leak| leak.opening_at(self.onset_s));
        let leaks = PerLeak {
            internal: opened.internal?,
            external_a: opened.external_a?,
            external_b: opened.external_b?,
        };
        let oil_temperature =
            self.oil_temperature.as_deref().map(|text| OilTemperature::of(text, duration_s));
        Ok(Recording {
            inputs: self.inputs(&rig),
            followed: self.followed.to_string(),
            instruments: self.noise.instruments(&rig),
            biases: Biases::drawn(&rig.instruments, self.bias_share, self.seed),
            sensor_faults: self.sensor_faults.clone(),
            seed: self.seed,
            scenario: Scenario {
                effects: effects(&rig, &self.effects)?,
                valve_flaws: self.valve_flaws.clone(),
                leaks: leaks.map(|leak| leak.within_trace(duration_s)),
                oil_temperature: oil_temperature.transpose()?,
                shut: self.shut,
                start_s,
                duration_s,
                sample_rate_hz: self.sample_rate_hz,
                ..Scenario::new(rig, reference)
            },
        })
    }

    /// The files that the plan names; what is a quantity is no file.
    fn inputs(&self, rig: &Rig) -> Inputs {
        let named = self.followed.files().into_iter().chain(self.oil_temperature.as_ref().map(Path::new));
        Inputs::of(named.chain(rig.file()))
    }
}

/// What a simulated rig follows, as a person says it.
#[derive(Clone, Debug, PartialEq)]
pub enum Followed {
    /// Wind on a turbine, brought onto the rig.
    Wind(Wind, Emulation),
    /// Piston position and load, each a quantity that never changes or a CSV file.
    Given {
        /// E.g. `100 mm`.
        position: String,
        /// E.g. `2 kN`.
        load: String,
    },
}

impl Followed {
    fn reference(&self, rig: &Rig) -> Result<Reference, PlanError> {
        match self {
            Self::Wind(wind, emulation) => {
                Ok(emulation.reference(&History::of(wind)?, rig.cylinder.stroke_m)?)
            }
            Self::Given { position, load } => {
                let reference = Reference::of(
                    constant_or_file(position, "x", Dimension::Length)?,
                    constant_or_file(load, "force", Dimension::Force)?,
                );
                let (position_m, _) = reference.at(0.0);
                let stroke_m = rig.cylinder.stroke_m;
                // Where a recorded position is beyond its end, the piston stays there.
                if reference.span_s().is_none() && !(0.0..=stroke_m).contains(&position_m) {
                    return Err(PlanError::BeyondStroke {
                        position: position.clone(),
                        stroke_mm: 1e3 * stroke_m,
                    });
                }
                Ok(reference)
            }
        }
    }

    /// What may be the path of a file.
    fn files(&self) -> Vec<&Path> {
        match self {
            Self::Wind(Wind::File(path), _) => vec![path],
            Self::Wind(..) => Vec::new(),
            Self::Given { position, load } => vec![Path::new(position), Path::new(load)],
        }
    }
}

impl fmt::Display for Followed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wind(wind, _) => write!(f, "wind {wind}"),
            Self::Given { position, load } => write!(f, "position {position}, load {load}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_per_cent_is_not_taken_for_all_of_it() {
        assert_eq!("1 %".parse(), Ok(Noise::Share(0.01)));
        assert_eq!("0.01".parse(), Ok(Noise::Share(0.01)));
        assert_eq!("100 %".parse(), Ok(Noise::Share(1.0)));
        assert_eq!(share_of_full_scale("1"), Err(ShareError::Percent("1".into())));
        assert_eq!(share_of_full_scale("1e308"), Err(ShareError::Percent("1e308".into())));
        assert_eq!(share_of_full_scale("1e300 %"), Err(ShareError::AboveFullScale));
        assert_eq!(share_of_full_scale("-1 %"), Err(ShareError::Negative));
        let message = "1".parse::<Noise>().expect_err("100 %");
        assert!(message.contains("`1 %`") && message.ends_with("or `none`, or `rig`"), "{message}");
    }
}
