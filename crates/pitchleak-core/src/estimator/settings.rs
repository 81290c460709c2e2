use crate::{Cylinder, CylinderError, Fluid, Real, SensorSpread, Sensors};

/// How [`Rls`](super::Rls) remembers and averages.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RlsSettings<T> {
    /// Longest memory, s; infinite to remember everything. How much of it counts is learnt from the data.
    pub forgetting_time_s: T,
    /// Length of the balance's blocks, s: the estimates are renewed after every second block, by the sixth sample that
    /// follows it, the seventh where a jump that was suspected was none. A block has eight samples at least.
    pub block_time_s: T,
    /// A step longer than this, s, is a gap: nothing is integrated over it.
    pub max_step_s: T,
}

impl<T: Real> Default for RlsSettings<T> {
    fn default() -> Self {
        Self { forgetting_time_s: T::infinity(), block_time_s: T::lit(0.25), max_step_s: T::lit(0.5) }
    }
}

/// Error returned by [`Rls::new`](super::Rls::new): of this an estimator would make nothing but nonsense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RlsError {
    /// The cylinder or its oil cannot be.
    Cylinder(CylinderError),
    /// A sensor's noise, bias or gain error is negative or not a number.
    Sensors,
    /// A time of [`RlsSettings`] is not positive, or the block's is infinite.
    Settings,
}

impl core::fmt::Display for RlsError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Cylinder(error) => error.fmt(f),
            Self::Sensors => f.write_str("noise, bias and gain error of sensors must not be negative"),
            Self::Settings => f.write_str("forgetting time, block time and longest step must be positive"),
        }
    }
}

impl core::error::Error for RlsError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Cylinder(error) => Some(error),
            Self::Sensors | Self::Settings => None,
        }
    }
}

impl From<CylinderError> for RlsError {
    fn from(error: CylinderError) -> Self {
        Self::Cylinder(error)
    }
}

/// Whether an estimator can be made of all this.
pub(super) fn check<T: Real>(
    cylinder: &Cylinder<T>,
    fluid: &Fluid<T>,
    sensors: &Sensors<T>,
    settings: &RlsSettings<T>,
) -> Result<(), RlsError> {
    cylinder.check()?;
    fluid.check()?;
    let Sensors { flow_a, flow_b, pressure, position, force } = sensors;
    if ![flow_a, flow_b, pressure, position, force].into_iter().all(SensorSpread::is_physical) {
        return Err(RlsError::Sensors);
    }
    let RlsSettings { forgetting_time_s, block_time_s, max_step_s } = *settings;
    let positive = |time: T| time > T::zero();
    let all = positive(forgetting_time_s) && positive(block_time_s) && positive(max_step_s);
    if all && block_time_s.is_finite() { Ok(()) } else { Err(RlsError::Settings) }
}
