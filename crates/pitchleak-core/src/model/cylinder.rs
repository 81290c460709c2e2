use crate::Real;

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
