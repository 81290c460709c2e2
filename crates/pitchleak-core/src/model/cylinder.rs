//! What is declared of a machine: its cylinder, its oil, and its sensors: what they read, and how far that may be off.

use crate::{LPM_PER_M3S, Real};

/// Geometry and moving mass of a single-rod cylinder, eq. (1)–(2).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Cylinder<T> {
    /// Piston-side area A_A, m².
    pub area_a_m2: T,
    /// Rod-side annulus area A_B, m².
    pub area_b_m2: T,
    /// Stroke L, m: the position x lies in 0..=L.
    pub stroke_m: T,
    /// Moving mass m, kg.
    pub moving_mass_kg: T,
    /// Dead volume V_0A of port and hose at x = 0, m³.
    pub dead_volume_a_m3: T,
    /// Dead volume V_0B of port and hose at x = L, m³.
    pub dead_volume_b_m3: T,
}

/// Oil as the continuity equations see it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Fluid<T> {
    /// Effective bulk modulus β, Pa: the mean of the prior.
    pub bulk_modulus_pa: T,
    /// Standard deviation of that prior, Pa.
    pub bulk_modulus_std_pa: T,
}

/// Error returned by [`Cylinder::check`] and [`Fluid::check`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CylinderError {
    /// An area is not positive and finite.
    #[error("piston areas must be positive")]
    Area,
    /// The stroke is not positive and finite.
    #[error("the stroke must be positive")]
    Stroke,
    /// The moving mass is not positive and finite.
    #[error("the moving mass must be positive")]
    MovingMass,
    /// A dead volume is negative or not finite.
    #[error("dead volumes must not be negative")]
    DeadVolume,
    /// The bulk modulus is not positive and finite.
    #[error("the bulk modulus must be positive")]
    BulkModulus,
    /// The spread of the bulk modulus is negative or not finite.
    #[error("the spread of the bulk modulus must not be negative")]
    BulkModulusSpread,
}

impl<T: Real> Cylinder<T> {
    /// The rig of the paper (Section III); its mass is not printed, 20 kg is assumed.
    pub fn paper() -> Self {
        Self {
            area_a_m2: T::lit(1.26e-3),
            area_b_m2: T::lit(0.94e-3),
            stroke_m: T::lit(0.2),
            moving_mass_kg: T::lit(20.0),
            dead_volume_a_m3: T::zero(),
            dead_volume_b_m3: T::zero(),
        }
    }

    /// Says whether a cylinder like this can exist.
    pub fn check(&self) -> Result<(), CylinderError> {
        if !self.area_a_m2.is_positive() || !self.area_b_m2.is_positive() {
            Err(CylinderError::Area)
        } else if !self.stroke_m.is_positive() {
            Err(CylinderError::Stroke)
        } else if !self.moving_mass_kg.is_positive() {
            Err(CylinderError::MovingMass)
        } else if !self.dead_volume_a_m3.is_not_negative() || !self.dead_volume_b_m3.is_not_negative() {
            Err(CylinderError::DeadVolume)
        } else {
            Ok(())
        }
    }

    /// Oil volume on the piston side, V_A = A_A x + V_0A, m³.
    #[inline]
    pub fn volume_a_m3(&self, x_m: T) -> T {
        self.area_a_m2 * x_m + self.dead_volume_a_m3
    }

    /// Oil volume on the rod side, V_B = A_B (L − x) + V_0B, m³.
    #[inline]
    pub fn volume_b_m3(&self, x_m: T) -> T {
        self.area_b_m2 * (self.stroke_m - x_m) + self.dead_volume_b_m3
    }
}

impl<T: Real> Fluid<T> {
    /// Mineral oil with some entrained air; the paper does not print β.
    pub fn paper() -> Self {
        Self { bulk_modulus_pa: T::lit(0.8e9), bulk_modulus_std_pa: T::lit(0.2e9) }
    }

    /// Says whether oil like this can exist.
    pub fn check(&self) -> Result<(), CylinderError> {
        if !self.bulk_modulus_pa.is_positive() {
            Err(CylinderError::BulkModulus)
        } else if !self.bulk_modulus_std_pa.is_not_negative() {
            Err(CylinderError::BulkModulusSpread)
        } else {
            Ok(())
        }
    }
}

/// Standard atmosphere, Pa: gauge pressures count from here.
pub const ATMOSPHERE_PA: f64 = 101_325.0;

/// One reading of the sensors. A flow is `None` while its chamber has no meter (or is not fed
/// through it): then only that chamber's equation rests.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sample<T> {
    /// Piston position x from the A end, m.
    pub x_m: T,
    /// Pressure P_A of the piston-side chamber, Pa gauge.
    pub pa_pa: T,
    /// Pressure P_B of the rod-side chamber, Pa gauge.
    pub pb_pa: T,
    /// Flow Q_A into the piston-side chamber, m³/s.
    pub qa_m3s: Option<T>,
    /// Flow Q_B into the rod-side chamber, m³/s.
    pub qb_m3s: Option<T>,
    /// Load force F against extension, N.
    pub force_n: Option<T>,
}

impl<T: Real> Sample<T> {
    /// P_L = P_A − P_B, Pa.
    #[inline]
    pub fn load_pressure_pa(&self) -> T {
        self.pa_pa - self.pb_pa
    }

    /// x, P_A, P_B, Q_A and Q_B: what the continuity equations need.
    #[inline]
    pub fn readings(&self) -> [Option<T>; 5] {
        [Some(self.x_m), Some(self.pa_pa), Some(self.pb_pa), self.qa_m3s, self.qb_m3s]
    }

    /// Whether every reading that is there is a finite number.
    #[inline]
    pub fn is_finite(&self) -> bool {
        let ok = |q: Option<T>| q.is_none_or(|v| v.is_finite());
        self.x_m.is_finite()
            && self.pa_pa.is_finite()
            && self.pb_pa.is_finite()
            && ok(self.qa_m3s)
            && ok(self.qb_m3s)
            && ok(self.force_n)
    }
}

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

    /// Whether every spread is a number and none is negative.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each sensor
    pub fn is_physical(&self) -> bool {
        let Self { noise_std, bias_std, gain_std, drift_std_ph } = *self;
        [noise_std, bias_std, gain_std, drift_std_ph].into_iter().all(T::is_not_negative)
    }
}

impl<T: Real> Sensors<T> {
    /// Standard deviations of the noise of x (m), P_A, P_B (Pa), Q_A and Q_B (m³/s), in the order of
    /// [`Sample::readings`].
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
