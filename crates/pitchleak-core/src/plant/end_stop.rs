use crate::{Cylinder, Real};

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
    use super::EndStop;
    use crate::Cylinder;

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
