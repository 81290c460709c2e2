//! A chamber: oil that may cavitate, and the stop at its end.

use crate::{Cylinder, Real};

/// One chamber of compressible oil that may cavitate. Its state is the oil it holds, counted at
/// zero gauge pressure, `W = V exp(P/β)`; d/dt of it is eq. (1) exactly:
/// `Q − leaks = V̇ + (V/β) Ṗ`.
///
/// When W no longer fills V at vapour pressure, the pressure stays there and the rest of V is
/// vapour (the vapour-volume form of column separation: Wylie and Streeter, "Fluid Transients in
/// Systems", ch. 8, discrete vapour cavity). As W goes on counting the oil, none is lost or made
/// when the cavity opens and closes, which clamping a pressure state would do.
#[derive(Clone, Copy)]
pub(super) struct Chamber<T> {
    pub bulk_modulus_pa: T,
    pub vapour_pressure_pa: T,
}

impl<T: Real> Chamber<T> {
    pub fn pressure_pa(&self, oil_m3: T, volume_m3: T) -> T {
        (self.bulk_modulus_pa * ln_of_quotient(oil_m3, volume_m3)).max(self.vapour_pressure_pa)
    }

    pub fn oil_m3(&self, pressure_pa: T, volume_m3: T) -> T {
        volume_m3 * self.density(pressure_pa.max(self.vapour_pressure_pa))
    }

    pub fn vapour_m3(&self, oil_m3: T, volume_m3: T) -> T {
        (volume_m3 - oil_m3 / self.density(self.vapour_pressure_pa)).max(T::zero())
    }

    /// Ṗ for a flow that a compliance V/β (and what stores oil beside it) has to take.
    pub fn slope_pas(&self, pressure_pa: T, net_m3s: T, compliance_m3pa: T) -> T {
        let opening = pressure_pa <= self.vapour_pressure_pa && net_m3s < T::zero();
        if opening { T::zero() } else { net_m3s / compliance_m3pa }
    }

    /// dW/dt for a net inflow at the chamber's own density. What passes is liquid, until only the
    /// last twentieth of the chamber is: then less and less leaves, so none is left owing.
    pub fn oil_rate_m3s(&self, oil_m3: T, volume_m3: T, inflow_m3s: T) -> T {
        let filled = oil_m3 / volume_m3;
        if filled >= T::one() {
            return filled * inflow_m3s;
        }
        let leaves = inflow_m3s < T::zero();
        let share = if leaves { (filled * T::lit(20.0)).min(T::one()) } else { T::one() };
        filled.max(self.density(self.vapour_pressure_pa)) * share * inflow_m3s
    }

    /// Density relative to that at zero gauge pressure.
    fn density(&self, pressure_pa: T) -> T {
        (pressure_pa / self.bulk_modulus_pa).libm_exp()
    }
}

/// Greatest z of the series: pressures up to 5 % of β. Below it, a chamber cavitates.
const NEAR_ZERO: f64 = 0.025;

/// ln(a/b) near a = b by the series of 2 artanh z, z = (a − b)/(a + b) (Abramowitz and Stegun, 4.1.27). What is left out
/// is less than rounding, and no logarithm is taken.
#[inline]
fn ln_of_quotient<T: Real>(a: T, b: T) -> T {
    let z = (a - b) / (a + b);
    if z.abs() > T::lit(NEAR_ZERO) {
        return (a / b).libm_ln();
    }
    let square = z * z;
    let series = [7.0, 5.0, 3.0]
        .into_iter()
        .fold(T::lit(1.0 / 9.0), |sum, odd: f64| sum * square + T::lit(odd.recip()));
    (z + z) * (series * square + T::one())
}

/// Both end stops: springs with dampers that begin `gap_m` before the ends of the stroke, so that
/// a chamber without dead volume keeps some oil. A stop pushes, it never pulls.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EndStop<T> {
    /// Where the stop begins, measured from the end of the stroke, m.
    pub gap_m: T,
    /// Stiffness, N/m.
    pub stiffness_npm: T,
    /// Damping, N·s/m.
    pub damping_nspm: T,
}

impl<T: Real> EndStop<T> {
    /// A stop at a thousandth of the stroke that 20 MPa on the piston side push in by half the
    /// gap, damped to 0.5 of critical.
    pub fn for_cylinder(cylinder: &Cylinder<T>) -> Self {
        let gap_m = cylinder.stroke_m * T::lit(1e-3);
        let stiffness_npm = T::lit(20e6) * cylinder.area_a_m2 / (gap_m / T::lit(2.0));
        let damping_nspm = (stiffness_npm * cylinder.moving_mass_kg).sqrt();
        Self { gap_m, stiffness_npm, damping_nspm }
    }

    pub(super) fn is_physical(&self, stroke_m: T) -> bool {
        self.gap_m.is_positive()
            && self.gap_m < stroke_m / T::lit(2.0)
            && self.stiffness_npm.is_positive()
            && self.damping_nspm.is_not_negative()
    }

    /// Force of the stops against extension, N.
    pub(super) fn force_n(&self, x_m: T, v_mps: T, stroke_m: T) -> T {
        let zero = T::zero();
        let push = |depth: T, speed: T| {
            if depth > zero {
                (self.stiffness_npm * depth + self.damping_nspm * speed).max(zero)
            } else {
                zero
            }
        };
        push(x_m - (stroke_m - self.gap_m), v_mps) - push(self.gap_m - x_m, -v_mps)
    }

    /// Stiffness and damping that may act within a step, N/m and N·s/m.
    pub(super) fn near(&self, x_m: T, stroke_m: T) -> (T, T) {
        let reach = T::lit(5.0) * self.gap_m;
        let far = x_m > reach && x_m < stroke_m - reach;
        if far { (T::zero(), T::zero()) } else { (self.stiffness_npm, self.damping_nspm) }
    }

    /// Position for which chamber volumes are counted: never closer than a tenth of the gap.
    pub(super) fn guarded_m(&self, x_m: T, stroke_m: T) -> T {
        let least = self.gap_m / T::lit(10.0);
        x_m.max(least).min(stroke_m - least)
    }
}

#[cfg(test)]
mod tests {
    use super::{EndStop, ln_of_quotient};
    use crate::Cylinder;

    /// Within the series, where it ends, and beyond.
    #[test]
    fn the_logarithm_is_that_of_libm_to_rounding() {
        let volume = 1.3e-4;
        for step in -4000..=4000 {
            let pressure_share = f64::from(step) * 5e-5;
            let oil = volume * pressure_share.exp();
            let found = ln_of_quotient(oil, volume);
            let rounding = 2.0 * f64::EPSILON;
            assert!((found - pressure_share).abs() <= rounding, "{found} of {pressure_share}");
            let single = f64::from(ln_of_quotient(oil as f32, volume as f32));
            assert!((single - pressure_share).abs() <= 2.0 * f64::from(f32::EPSILON), "{single} in f32");
        }
    }

    #[test]
    fn nothing_in_a_chamber_is_no_number_of_the_series() {
        assert!(ln_of_quotient(0.0_f64, 1e-4) < f64::MIN);
        assert!(ln_of_quotient(f64::NAN, 1e-4).is_nan());
    }

    #[test]
    fn the_piston_side_at_20_mpa_is_held_at_half_the_gap() {
        let cylinder = Cylinder::<f64>::paper();
        let stop = EndStop::for_cylinder(&cylinder);
        let held = stop.force_n(cylinder.stroke_m - 0.5 * stop.gap_m, 0.0, cylinder.stroke_m);
        assert!((held / (20e6 * cylinder.area_a_m2) - 1.0).abs() < 1e-9, "{held} N");
        let pushed = stop.force_n(0.5 * stop.gap_m, 0.0, cylinder.stroke_m);
        assert!((held + pushed).abs() < 1e-6, "both ends push inwards");
    }

    #[test]
    fn a_stop_counts_near_both_ends_and_nowhere_else() {
        let cylinder = Cylinder::<f64>::paper();
        let stop = EndStop::for_cylinder(&cylinder);
        let near = |x_m: f64| stop.near(x_m, cylinder.stroke_m);
        assert_eq!(near(0.5 * cylinder.stroke_m), (0.0, 0.0));
        for x_m in [stop.gap_m, cylinder.stroke_m - stop.gap_m] {
            assert_eq!(near(x_m), (stop.stiffness_npm, stop.damping_nspm));
        }
    }
}
