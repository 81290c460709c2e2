use crate::Real;

/// PID controller with its output limited to ±1 and the integral held while it is (Åström and
/// Hägglund, "Advanced PID Control", §3.5). The caller passes the error's rate, as speeds are
/// states here and need no differencing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gains<T> {
    /// Valve command per unit of error.
    pub proportional: T,
    /// Valve command per unit of error and second.
    pub integral_ps: T,
    /// Valve command per unit of the error's rate.
    pub derivative_s: T,
}

impl<T: Real> Gains<T> {
    pub(super) fn is_physical(&self) -> bool {
        [self.proportional, self.integral_ps, self.derivative_s]
            .iter()
            .all(|gain| gain.is_finite() && *gain >= T::zero())
    }

    /// The valve command ±1 for an error and its rate; `integral` is the controller's memory.
    pub(super) fn command(&self, integral: &mut T, step_s: T, error: T, rate: T, feedforward: T) -> T {
        let grown = *integral + self.integral_ps * error * step_s;
        let wanted =
            |integral: T| feedforward + self.proportional * error + self.derivative_s * rate + integral;
        let free = wanted(grown);
        let saturated = free.abs() > T::one() && free * error > T::zero();
        if grown.is_finite() && !saturated {
            *integral = grown.max(-T::one()).min(T::one());
        }
        wanted(*integral).max(-T::one()).min(T::one())
    }
}
