//! The simulated rig: cylinder, valve and supply as one ordinary differential equation.

mod chamber;
mod cylinder_plant;
mod valve;

pub use chamber::EndStop;
pub use cylinder_plant::{CylinderPlant, CylinderRates, CylinderState, Drive};
pub use valve::{Supply, Valve, ValveFlows};

pub(crate) use cylinder_plant::{number_or_zero, substeps};

use crate::{CylinderError, Real};

/// Error returned by the `check` functions of the plant and the emulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlantError {
    /// Cylinder or oil cannot exist.
    #[error(transparent)]
    Cylinder(#[from] CylinderError),
    /// A leak coefficient is negative or not a number.
    #[error("leak coefficients must not be negative")]
    Leaks,
    /// Gap, stiffness or damping of the end stops is not usable.
    #[error("end stops need a gap below half the stroke and a positive stiffness")]
    EndStop,
    /// The vapour pressure is not between minus one atmosphere and zero gauge.
    #[error("the vapour pressure must lie between -101325 Pa and 0 Pa gauge")]
    VapourPressure,
    /// The temperature is not positive and finite.
    #[error("the oil temperature must be positive")]
    Temperature,
    /// A figure of a valve is not usable.
    #[error("figures of a valve must be positive and its lap below its stroke")]
    Valve,
    /// A figure of the supply is not usable.
    #[error("figures of the supply must be positive")]
    Supply,
    /// A gain of a controller is negative or not a number.
    #[error("gains of a controller must not be negative")]
    Controller,
    /// A step is not positive and finite, or far too long.
    #[error("the step must be positive and of sensible length")]
    Step,
}

/// One step of the classical fourth-order Runge–Kutta method (Hairer, Nørsett, Wanner,
/// "Solving Ordinary Differential Equations I", §II.1, table 1.2): `state` advanced by `step_s`.
///
/// `rates(elapsed_s, state)` gives the time derivative; `elapsed_s` counts from the start of the step.
#[inline]
pub fn rk4_step<T: Real, const N: usize>(
    state: &[T; N],
    step_s: T,
    mut rates: impl FnMut(T, &[T; N]) -> [T; N],
) -> [T; N] {
    let half = step_s / T::lit(2.0);
    let k1 = rates(T::zero(), state);
    let k2 = rates(half, &ahead(state, &k1, half));
    let k3 = rates(half, &ahead(state, &k2, half));
    let k4 = rates(step_s, &ahead(state, &k3, step_s));
    let (sixth, third) = (step_s / T::lit(6.0), step_s / T::lit(3.0));
    ahead(&ahead(&ahead(&ahead(state, &k1, sixth), &k2, third), &k3, third), &k4, sixth)
}

#[inline]
fn ahead<T: Real, const N: usize>(state: &[T; N], rates: &[T; N], step: T) -> [T; N] {
    let mut next = *state;
    for (value, rate) in next.iter_mut().zip(rates) {
        *value += *rate * step;
    }
    next
}

#[cfg(test)]
mod tests {
    use super::rk4_step;

    /// A forced pendulum-like system with known solution: y = sin t, y' = cos t, y'' = −y³ + sin³ t − sin t.
    fn error_at_two_seconds(steps: u32) -> f64 {
        let step = 2.0 / f64::from(steps);
        let mut y = [0.0, 1.0];
        for i in 0..steps {
            let start = f64::from(i) * step;
            y = rk4_step(&y, step, |elapsed, y| {
                let s = (start + elapsed).sin();
                [y[1], -y[0].powi(3) + s.powi(3) - s]
            });
        }
        (y[0] - 2.0_f64.sin()).hypot(y[1] - 2.0_f64.cos())
    }

    #[test]
    fn converges_with_the_fourth_power_of_the_step() {
        for steps in [20, 40, 80] {
            let order = (error_at_two_seconds(steps) / error_at_two_seconds(2 * steps)).log2();
            assert!((order - 4.0).abs() < 0.25, "order {order} at {steps} steps");
        }
    }
}
