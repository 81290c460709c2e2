//! Eq. (1)–(2) and what they speak of: cylinder, oil, sensors, samples, leaks, the blade's linkage.

mod cylinder;
mod leak;
mod linkage;

pub use cylinder::{ATMOSPHERE_PA, Cylinder, CylinderError, Fluid, Sample, SensorSpread, Sensors};
pub use leak::{Estimate, Leak, LeakPressures, PerLeak};
pub use linkage::{Linkage, LinkageError};

use crate::Real;

/// Everything the equations of one cylinder need to know about one instant, true or as read by
/// sensors. Pressures are gauge, flows go into their chamber.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Signals<T> {
    /// Piston position x from the A end, m.
    pub x_m: T,
    /// Piston speed ẋ, m/s.
    pub v_mps: T,
    /// Piston acceleration ẍ, m/s².
    pub a_mps2: T,
    /// Pressure P_A, Pa.
    pub pa_pa: T,
    /// Pressure P_B, Pa.
    pub pb_pa: T,
    /// Ṗ_A, Pa/s.
    pub dpa_pas: T,
    /// Ṗ_B, Pa/s.
    pub dpb_pas: T,
    /// P̈_A, Pa/s².
    pub d2pa_pas2: T,
    /// P̈_B, Pa/s².
    pub d2pb_pas2: T,
    /// Where the reading of P_A lies in the sensor's play: 1 behind a rising pressure, −1 behind a falling one.
    pub pa_side: T,
    /// The same of P_B.
    pub pb_side: T,
    /// Its rate at A, 1/s.
    pub dpa_side_ps: T,
    /// Its rate at B, 1/s.
    pub dpb_side_ps: T,
    /// Where the reading of x lies in the sensor's play: 1 behind a piston that extends, −1 behind one that retracts.
    pub x_side: T,
    /// Its rate, 1/s.
    pub dx_side_ps: T,
    /// Flow Q_A that its meter does not show, as a share of the meter's dead band: 0 outside of it, −1 to 1 within.
    pub qa_unread: T,
    /// The same of Q_B.
    pub qb_unread: T,
    /// Flow Q_A, m³/s.
    pub qa_m3s: T,
    /// Flow Q_B, m³/s.
    pub qb_m3s: T,
    /// Q̇_A, m³/s².
    pub dqa_m3s2: T,
    /// Q̇_B, m³/s².
    pub dqb_m3s2: T,
    /// Load force F against extension, N.
    pub force_n: T,
    /// Oil temperature, K.
    pub temp_k: T,
    /// Time since the trace or the run began, s.
    pub t_s: T,
}

/// One number for each equation of the cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Terms<T> {
    /// In the continuity equation of chamber A, m³/s.
    pub chamber_a_m3s: T,
    /// In the continuity equation of chamber B, m³/s.
    pub chamber_b_m3s: T,
    /// In the force balance, N.
    pub force_n: T,
}

/// The declared model of a cylinder: what eq. (1)–(2) know about it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Model<T> {
    /// Geometry and moving mass.
    pub cylinder: Cylinder<T>,
    /// Oil.
    pub fluid: Fluid<T>,
    /// Laminar leak coefficients C_ip, C_epA, C_epB of eq. (1), m³/(s·Pa).
    pub leaks_m3spa: PerLeak<T>,
}

impl<T: Real> Model<T> {
    /// The rig of the paper without leaks.
    pub fn paper() -> Self {
        Self { cylinder: Cylinder::paper(), fluid: Fluid::paper(), leaks_m3spa: PerLeak::default() }
    }

    /// What eq. (1)–(2) leave over at an instant, left side less right side:
    ///
    /// ```text
    /// chamber A  Q_A − A_A ẋ − (V_A/β) Ṗ_A − C_ip P_L − C_epA P_A
    /// chamber B  Q_B + A_B ẋ − (V_B/β) Ṗ_B + C_ip P_L − C_epB P_B
    /// force      P_A A_A − P_B A_B − m ẍ − F
    /// ```
    ///
    /// Zero where the model is complete; else it is the missing effect's term.
    #[inline]
    pub fn residual(&self, at: &Signals<T>) -> Terms<T> {
        let (cylinder, leaks, bulk) = (&self.cylinder, &self.leaks_m3spa, self.fluid.bulk_modulus_pa);
        let internal = leaks.internal * (at.pa_pa - at.pb_pa);
        Terms {
            chamber_a_m3s: at.qa_m3s
                - cylinder.area_a_m2 * at.v_mps
                - cylinder.volume_a_m3(at.x_m) / bulk * at.dpa_pas
                - internal
                - leaks.external_a * at.pa_pa,
            chamber_b_m3s: at.qb_m3s + cylinder.area_b_m2 * at.v_mps
                - cylinder.volume_b_m3(at.x_m) / bulk * at.dpb_pas
                + internal
                - leaks.external_b * at.pb_pa,
            force_n: at.pa_pa * cylinder.area_a_m2
                - at.pb_pa * cylinder.area_b_m2
                - cylinder.moving_mass_kg * at.a_mps2
                - at.force_n,
        }
    }

    /// What one unit of a misreading adds to [`Self::residual`], to first order; `read` says what the sensors show with so much of it. The
    /// residual is quadratic in the signals: the central difference is exact whatever its step, where readings are linear in their error.
    #[inline]
    pub fn misread(&self, step: T, read: impl Fn(T) -> Signals<T>) -> Terms<T> {
        let (above, below) = (self.residual(&read(step)), self.residual(&read(-step)));
        above.zip(below, |above, below| (above - below) / (step + step))
    }
}

impl<T: Real> Terms<T> {
    /// Each number of `self` with its partner of `other` through `f`.
    #[inline]
    pub fn zip(self, other: Self, f: impl Fn(T, T) -> T) -> Self {
        Self {
            chamber_a_m3s: f(self.chamber_a_m3s, other.chamber_a_m3s),
            chamber_b_m3s: f(self.chamber_b_m3s, other.chamber_b_m3s),
            force_n: f(self.force_n, other.force_n),
        }
    }

    /// `self + scale · other`.
    #[inline]
    pub fn plus(self, scale: T, other: Self) -> Self {
        self.zip(other, |own, more| own + scale * more)
    }
}

impl<T: Real> Signals<T> {
    /// Each signal of `self` with its partner of `other` through `f`.
    #[inline]
    pub fn zip(self, other: Self, f: impl Fn(T, T) -> T) -> Self {
        Self {
            x_m: f(self.x_m, other.x_m),
            v_mps: f(self.v_mps, other.v_mps),
            a_mps2: f(self.a_mps2, other.a_mps2),
            pa_pa: f(self.pa_pa, other.pa_pa),
            pb_pa: f(self.pb_pa, other.pb_pa),
            dpa_pas: f(self.dpa_pas, other.dpa_pas),
            dpb_pas: f(self.dpb_pas, other.dpb_pas),
            d2pa_pas2: f(self.d2pa_pas2, other.d2pa_pas2),
            d2pb_pas2: f(self.d2pb_pas2, other.d2pb_pas2),
            pa_side: f(self.pa_side, other.pa_side),
            pb_side: f(self.pb_side, other.pb_side),
            dpa_side_ps: f(self.dpa_side_ps, other.dpa_side_ps),
            dpb_side_ps: f(self.dpb_side_ps, other.dpb_side_ps),
            x_side: f(self.x_side, other.x_side),
            dx_side_ps: f(self.dx_side_ps, other.dx_side_ps),
            qa_unread: f(self.qa_unread, other.qa_unread),
            qb_unread: f(self.qb_unread, other.qb_unread),
            qa_m3s: f(self.qa_m3s, other.qa_m3s),
            qb_m3s: f(self.qb_m3s, other.qb_m3s),
            dqa_m3s2: f(self.dqa_m3s2, other.dqa_m3s2),
            dqb_m3s2: f(self.dqb_m3s2, other.dqb_m3s2),
            force_n: f(self.force_n, other.force_n),
            temp_k: f(self.temp_k, other.temp_k),
            t_s: f(self.t_s, other.t_s),
        }
    }
}

/// Pressure difference below which an orifice turns laminar, Pa.
const LAMINAR_PA: f64 = 2e4;

/// sign(Δp) √|Δp| with a finite slope at zero: Δp / (Δp² + p_t²)^{1/4}, p_t = 0.2 bar, after
/// Borutzky, Barnard and Thoma, "An orifice flow model for laminar and turbulent conditions",
/// Simulation Modelling Practice and Theory 10 (2002). Off by less than 1 % above 1 bar.
#[inline]
pub fn signed_root<T: Real>(difference_pa: T) -> T {
    metering(difference_pa, T::lit(LAMINAR_PA))
}

/// [`signed_root`] with the transition at `laminar_pa`.
#[inline]
pub fn metering<T: Real>(difference_pa: T, laminar_pa: T) -> T {
    metering_with_slope(difference_pa, laminar_pa).0
}

/// [`metering`] and its slope by the difference.
#[inline]
pub fn metering_with_slope<T: Real>(difference_pa: T, laminar_pa: T) -> (T, T) {
    let (own, laminar) = (difference_pa * difference_pa, laminar_pa * laminar_pa);
    let root = (own + laminar).sqrt().sqrt();
    (difference_pa / root, (own * T::lit(0.5) + laminar) / ((own + laminar) * root))
}

#[cfg(test)]
mod tests {
    use super::{metering, metering_with_slope, signed_root};

    #[test]
    fn is_the_root_at_metering_pressures_and_smooth_at_zero() {
        for p in [1e5, 1e6, 1e7_f64] {
            assert!((signed_root(p) / p.sqrt() - 1.0).abs() < 0.0101);
            assert!((signed_root(-p) + signed_root(p)).abs() < 1e-12);
        }
        assert!((signed_root(1.0_f64) - 1.0 / 2e4_f64.sqrt()).abs() < 1e-9);
        assert!(signed_root(f64::MAX).is_finite());
    }

    #[test]
    fn its_slope_is_that_of_its_differences() {
        for p in [-3e6, -2e4, -7.0, 0.0, 9e3, 1e4, 5e6_f64] {
            let step = 1.0 + 1e-5 * p.abs();
            let rise = metering(p + step, 1e4) - metering(p - step, 1e4);
            let (_, slope) = metering_with_slope(p, 1e4);
            assert!((rise / (2.0 * step) / slope - 1.0).abs() < 1e-6, "{p}: {slope}");
        }
    }
}
