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
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RlsError {
    /// The cylinder or its oil cannot be.
    #[error("{0}")]
    Cylinder(#[from] CylinderError),
    /// A sensor's noise, bias or gain error is negative or not a number.
    #[error("noise, bias and gain error of sensors must not be negative")]
    Sensors,
    /// A time of [`RlsSettings`] is not positive, or the block's is infinite.
    #[error("forgetting time, block time and longest step must be positive")]
    Settings,
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
