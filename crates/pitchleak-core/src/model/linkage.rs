use crate::Real;

/// The slider-crank between blade and cylinder, Wu et al. (2011), Fig. 4 and eq. (17)–(18).
///
/// Pitch angle θ in rad, positive towards feather; piston position x_p in m from the A end,
/// growing with θ; torque positive towards feather, force positive along extension.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Linkage<T> {
    /// Distance L_p between blade axis and cylinder pivot, m.
    pub pivot_distance_m: T,
    /// Length l_p of the retracted cylinder, m.
    pub retracted_length_m: T,
    /// Crank radius r_p, m.
    pub crank_radius_m: T,
    /// Angle φ between crank and pivot line at zero pitch, rad.
    pub zero_angle_rad: T,
}

/// Error returned by [`Linkage`]'s functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LinkageError {
    /// A length is not positive and finite, or the angle is not finite.
    #[error("lengths of the linkage must be positive")]
    Geometry,
    /// No crank angle between the dead points has this pitch with the piston inside the cylinder.
    #[error("the linkage cannot reach this pitch angle")]
    Pitch,
    /// The linkage cannot put the piston there.
    #[error("the linkage cannot reach this piston position")]
    Position,
    /// Crank and cylinder are in line: no force makes a torque.
    #[error("crank and cylinder are in line: force and torque are unrelated")]
    DeadPoint,
    /// A torque or force is not finite.
    #[error("torque and force must be numbers")]
    Load,
}

impl<T: Real> Linkage<T> {
    /// The mechanism of the paper: L_p = 1.1 m, l_p = 1.0 m, r_p = 0.5 m, φ = 63°.
    pub fn paper() -> Self {
        Self {
            pivot_distance_m: T::lit(1.1),
            retracted_length_m: T::one(),
            crank_radius_m: T::lit(0.5),
            zero_angle_rad: T::lit(63.0).to_radians(),
        }
    }

    /// Says whether a linkage like this can exist.
    pub fn check(&self) -> Result<(), LinkageError> {
        let lengths = [self.pivot_distance_m, self.retracted_length_m, self.crank_radius_m];
        let sound = lengths.into_iter().all(T::is_positive);
        if sound && self.zero_angle_rad.is_finite() { Ok(()) } else { Err(LinkageError::Geometry) }
    }

    /// x_p(θ), eq. (17), m. Below about 2.28° the paper's mechanism would need a negative
    /// position: [`LinkageError::Pitch`].
    pub fn position_m(&self, pitch_rad: T) -> Result<T, LinkageError> {
        let crank = self.zero_angle_rad + pitch_rad;
        if !(crank >= T::zero() && crank <= T::lit(core::f64::consts::PI)) {
            return Err(LinkageError::Pitch);
        }
        let square = self.squares() - self.twice_product() * crank.libm_cos();
        let position = square.max(T::zero()).sqrt() - self.retracted_length_m;
        if position >= T::zero() { Ok(position) } else { Err(LinkageError::Pitch) }
    }

    /// θ(x_p), the inverse of eq. (17), rad.
    pub fn pitch_rad(&self, position_m: T) -> Result<T, LinkageError> {
        if position_m.is_nan() || position_m < T::zero() {
            return Err(LinkageError::Position);
        }
        let length = position_m + self.retracted_length_m;
        let cosine = (self.squares() - length * length) / self.twice_product();
        if !(cosine >= -T::one() && cosine <= T::one()) {
            return Err(LinkageError::Position);
        }
        Ok(cosine.libm_acos() - self.zero_angle_rad)
    }

    /// Lever arm dx_p/dθ, m/rad: also the ratio of piston speed to pitch rate.
    pub fn arm_m(&self, pitch_rad: T) -> Result<T, LinkageError> {
        let length = self.position_m(pitch_rad)? + self.retracted_length_m;
        let crank = self.zero_angle_rad + pitch_rad;
        Ok(self.pivot_distance_m * self.crank_radius_m * crank.libm_sin() / length)
    }

    /// Torque T_p on the blade by cylinder force F_c, N·m: eq. (18) by virtual work,
    /// T_p θ' = F_c x_p'. (The paper prints F_c r_p cos θ, which does no such thing.)
    pub fn torque_nm(&self, pitch_rad: T, force_n: T) -> Result<T, LinkageError> {
        finite(force_n * self.arm_m(pitch_rad)?)
    }

    /// Cylinder force F_c that makes torque T_p = J θ'' + T_w, N: eq. (18) by virtual work.
    pub fn force_n(&self, pitch_rad: T, torque_nm: T) -> Result<T, LinkageError> {
        let arm = self.arm_m(pitch_rad)?;
        if arm <= self.crank_radius_m * T::epsilon() * T::lit(16.0) {
            return Err(LinkageError::DeadPoint);
        }
        finite(torque_nm / arm)
    }

    fn squares(&self) -> T {
        self.pivot_distance_m * self.pivot_distance_m + self.crank_radius_m * self.crank_radius_m
    }

    fn twice_product(&self) -> T {
        T::lit(2.0) * self.pivot_distance_m * self.crank_radius_m
    }
}

fn finite<T: Real>(load: T) -> Result<T, LinkageError> {
    if load.is_finite() { Ok(load) } else { Err(LinkageError::Load) }
}

#[cfg(test)]
mod tests {
    use super::{Linkage, LinkageError};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn position_and_pitch_invert_each_other(degrees in 2.3..110.0_f64) {
            let (linkage, pitch) = (Linkage::paper(), degrees.to_radians());
            let position = linkage.position_m(pitch).unwrap();
            prop_assert!((linkage.pitch_rad(position).unwrap() - pitch).abs() < 1e-9);
        }

        #[test]
        fn arm_is_the_derivative_of_position(degrees in 2.4..110.0_f64) {
            let (linkage, pitch, step) = (Linkage::paper(), degrees.to_radians(), 1e-5);
            let slope = (linkage.position_m(pitch + step).unwrap() - linkage.position_m(pitch - step).unwrap())
                / (2.0 * step);
            prop_assert!((linkage.arm_m(pitch).unwrap() - slope).abs() < 1e-8);
        }

        #[test]
        fn cylinder_and_blade_do_the_same_work(degrees in 2.4..110.0_f64, torque in -5e4..5e4_f64) {
            let (linkage, pitch, turn) = (Linkage::paper(), degrees.to_radians(), 1e-5);
            let force = linkage.force_n(pitch, torque).unwrap();
            let travel = linkage.position_m(pitch + turn).unwrap() - linkage.position_m(pitch - turn).unwrap();
            prop_assert!((force * travel - torque * 2.0 * turn).abs() < 1e-8 * torque.abs().max(1.0));
            prop_assert!((linkage.torque_nm(pitch, force).unwrap() - torque).abs() < 1e-9 * torque.abs().max(1.0));
        }

        #[test]
        fn any_number_gives_a_number_or_an_error(a in any::<f64>(), b in any::<f64>()) {
            let linkage = Linkage::paper();
            for result in [linkage.position_m(a), linkage.pitch_rad(a), linkage.arm_m(a),
                linkage.torque_nm(a, b), linkage.force_n(a, b), linkage.torque_nm(0.5, b), linkage.force_n(0.5, b)] {
                prop_assert!(result.map_or(true, |value| value.is_finite()));
            }
        }
    }

    #[test]
    fn fine_pitch_of_the_windpact_turbine() {
        let linkage = Linkage::<f64>::paper();
        assert!((linkage.position_m(2.6_f64.to_radians()).unwrap() - 2.8e-3).abs() < 5e-5);
        assert!((linkage.pitch_rad(0.0).unwrap().to_degrees() - 2.28).abs() < 5e-3);
        assert_eq!(linkage.position_m(0.0), Err(LinkageError::Pitch));
        assert_eq!(linkage.pitch_rad(0.61), Err(LinkageError::Position));
    }

    #[test]
    fn lengths_are_positive() {
        let paper = Linkage::<f64>::paper();
        assert_eq!(paper.check(), Ok(()));
        for length in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            for bad in [
                Linkage { pivot_distance_m: length, ..paper },
                Linkage { retracted_length_m: length, ..paper },
                Linkage { crank_radius_m: length, ..paper },
            ] {
                assert_eq!(bad.check(), Err(LinkageError::Geometry), "{bad:?}");
            }
        }
        let bad = Linkage { zero_angle_rad: f64::NAN, ..paper };
        assert_eq!(bad.check(), Err(LinkageError::Geometry));
    }

    #[test]
    fn dead_point_has_no_force() {
        let linkage = Linkage { zero_angle_rad: 0.0, retracted_length_m: 0.5, ..Linkage::paper() };
        assert_eq!(linkage.force_n(0.0, 1.0), Err(LinkageError::DeadPoint));
        assert_eq!(linkage.torque_nm(0.0, 1.0), Ok(0.0));
    }
}
