use crate::{Cylinder, Real, Sample};

/// ∫ (P_A A_A − P_B A_B − F) dt of f5, kept from drifting.
///
/// The integral is the momentum m ẋ, eq. (14), so its own integral is m (x − x₀), which the position sensor
/// measures. An observer of second order integrates the imbalance and pulls the result to the measured
/// position:
///
/// ```text
/// dx̂/dt = p̂/m + 2 ζ ω (x − x̂)        dp̂/dt = imbalance + m ω² (x − x̂)
/// ```
///
/// Above ω the imbalance decides, below it the position: a constant error ε of the imbalance gives a bounded
/// error 2 ζ ε/ω of p̂ instead of a ramp, and on exact data p̂ = m ẋ for every ω (Luenberger observer with a
/// double pole; complementary filter). The step is implicit, hence stable for every dt.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Momentum<T> {
    bandwidth_rad_s: T,
    mass_kg: T,
    position_m: T,
    momentum_n_s: T,
    started: bool,
}

impl<T: Real> Momentum<T> {
    /// At rest, with the bandwidth ω in rad/s.
    pub fn new(mass_kg: T, bandwidth_rad_s: T) -> Self {
        Self { bandwidth_rad_s, mass_kg, position_m: T::zero(), momentum_n_s: T::zero(), started: false }
    }

    /// Takes the imbalance over the step `dt_s` and the position at its end; returns the momentum, N·s.
    pub fn update(&mut self, dt_s: T, imbalance_n: T, x_m: T) -> T {
        if !self.started {
            self.started = true;
            self.position_m = x_m;
            return self.momentum_n_s;
        }
        let w = self.bandwidth_rad_s;
        let (h, m) = (dt_s, self.mass_kg);
        // Backward Euler of both equations, solved for the position error e = x − x̂ at the new time.
        let free = self.position_m + h * (self.momentum_n_s + h * imbalance_n) / m;
        let error = (x_m - free) / (T::one() + T::lit(2.0) * w * h + w * w * h * h);
        self.momentum_n_s += h * (imbalance_n + m * w * w * error);
        self.position_m = x_m - error;
        self.momentum_n_s
    }

    /// A gap: the piston is where it is read, the momentum as last known.
    pub fn restart(&mut self, x_m: T) {
        self.position_m = x_m;
    }
}

/// P_A A_A − P_B A_B − F, N: what accelerates the mass, eq. (2).
pub fn force_imbalance_n<T: Real>(cylinder: &Cylinder<T>, sample: &Sample<T>, load_n: T) -> T {
    hydraulic_force_n(cylinder, sample) - load_n
}

/// P_A A_A − P_B A_B, N.
pub fn hydraulic_force_n<T: Real>(cylinder: &Cylinder<T>, sample: &Sample<T>) -> T {
    sample.pa_pa * cylinder.area_a_m2 - sample.pb_pa * cylinder.area_b_m2
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sinusoidal motion: the observer has to give m ẋ, and to bound the effect of a wrong load.
    #[test]
    fn follows_the_momentum_and_bounds_the_drift() {
        let (m, h, w) = (20.0, 1e-3, 10.0);
        for (wrong_n, bound) in [(0.0, 0.05), (5.0, 2.0 * 5.0 / w + 0.05)] {
            let mut momentum = Momentum::new(m, w);
            let mut worst: f64 = 0.0;
            for k in 0..60_000 {
                let t = f64::from(k) * h;
                let x = 0.1 + 0.02 * (3.0 * t).sin();
                let force = -m * 0.02 * 9.0 * (3.0 * t).sin();
                let p = momentum.update(h, force + wrong_n, x);
                if k > 5_000 {
                    worst = worst.max((p - m * 0.06 * (3.0 * t).cos()).abs());
                }
            }
            assert!(worst < bound, "{worst} N·s with {wrong_n} N of wrong load");
        }
    }
}
