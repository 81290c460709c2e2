use super::cylinder::not_negative;
use crate::{LPM_PER_M3S, Real};

/// How far one sensor's reading may be off, 1 σ each, in the sensor's SI unit.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SensorSpread<T> {
    /// White noise of one reading.
    pub noise_std: T,
    /// Constant offset.
    pub bias_std: T,
    /// Scale error, as a share of the reading.
    pub gain_std: T,
    /// How far the offset may drift in an hour.
    pub drift_std_ph: T,
}

/// The declared spread of every sensor of a rig.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sensors<T> {
    /// Flow meter of chamber A, m³/s.
    pub flow_a: SensorSpread<T>,
    /// Flow meter of chamber B, m³/s.
    pub flow_b: SensorSpread<T>,
    /// Both pressure sensors, Pa.
    pub pressure: SensorSpread<T>,
    /// Position sensor, m.
    pub position: SensorSpread<T>,
    /// Force sensor, N.
    pub force: SensorSpread<T>,
}

impl<T: Real> SensorSpread<T> {
    /// A sensor of `full_scale` whose white noise has 3 σ = `accuracy` · full scale, with neither
    /// offset nor scale error.
    pub fn of_full_scale(full_scale: T, accuracy: T) -> Self {
        Self {
            noise_std: full_scale * accuracy / T::lit(3.0),
            bias_std: T::zero(),
            gain_std: T::zero(),
            drift_std_ph: T::zero(),
        }
    }
}

impl<T: Real> SensorSpread<T> {
    /// Whether every spread is a number and none is negative.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each sensor
    pub fn is_physical(&self) -> bool {
        let Self { noise_std, bias_std, gain_std, drift_std_ph } = *self;
        [noise_std, bias_std, gain_std, drift_std_ph].iter().all(|std| not_negative(*std))
    }
}

impl<T: Real> Sensors<T> {
    /// Standard deviations of the noise of x (m), P_A, P_B (Pa), Q_A and Q_B (m³/s), in the order of
    /// [`Sample::readings`](super::Sample::readings).
    pub fn noise_stds(&self) -> [T; 5] {
        let Self { flow_a, flow_b, pressure, position, .. } = self;
        [position, pressure, pressure, flow_a, flow_b].map(|spread| spread.noise_std)
    }

    /// Sensors of the paper's rig (Section III): flow meters 20 L/min full scale, 1 % of full scale.
    pub fn paper() -> Self {
        let one_percent = T::lit(0.01);
        let flow = SensorSpread::of_full_scale(T::lit(20.0 / LPM_PER_M3S), one_percent);
        Self {
            flow_a: flow,
            flow_b: flow,
            pressure: SensorSpread::of_full_scale(T::lit(16e6), one_percent),
            position: SensorSpread::of_full_scale(T::lit(0.2), one_percent),
            force: SensorSpread::of_full_scale(T::lit(10e3), one_percent),
        }
    }
}
