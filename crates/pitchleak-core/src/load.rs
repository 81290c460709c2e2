use crate::{Cylinder, Real, Sample, momentum::hydraulic_force_n};

/// Load force F from eq. (2) by least squares, for a trace without a force column (paper, Section II after
/// eq. 14): F = P_A A_A − P_B A_B − m ẍ.
///
/// ẍ is the curvature of the parabola that fits the past positions best, each older one weighted by the factor
/// d^(age): discounted least squares, whose recursive form has constant gains (N. Morrison 1969,
/// Introduction to Sequential Smoothing and Prediction, ch. 13; E. Brookner 1998, Tracking and Kalman
/// Filtering Made Easy, §1.3, "critically damped g-h-k filter"). The hydraulic force is averaged with the
/// same memory, so that both sides lag alike.
#[derive(Clone, Copy, Debug)]
pub struct LoadEstimator<T> {
    memory_s: T,
    position: Parabola<T>,
    force: Parabola<T>,
}

impl<T: Real> LoadEstimator<T> {
    /// With a memory of `memory_s` seconds.
    pub fn new(memory_s: T) -> Self {
        Self { memory_s, position: Parabola::default(), force: Parabola::default() }
    }

    /// Takes a reading `dt_s` after the one before; returns the load F, N, against extension.
    pub fn update(&mut self, cylinder: &Cylinder<T>, dt_s: T, sample: &Sample<T>) -> T {
        let discount = (-dt_s / self.memory_s).libm_exp();
        let acceleration = self.position.update(discount, dt_s, sample.x_m).curvature;
        let force = self.force.update(discount, dt_s, hydraulic_force_n(cylinder, sample)).value;
        force - cylinder.moving_mass_kg * acceleration
    }
}

/// Discounted least-squares parabola through a signal: value, slope and curvature at the newest sample.
#[derive(Clone, Copy, Debug, Default)]
struct Parabola<T> {
    value: T,
    slope: T,
    curvature: T,
    started: bool,
}

impl<T: Real> Parabola<T> {
    fn update(&mut self, discount: T, dt_s: T, reading: T) -> &Self {
        if !self.started || dt_s <= T::zero() {
            *self = Self { value: reading, started: true, ..Self::default() };
            return self;
        }
        let half = T::lit(0.5);
        let fresh = T::one() - discount;
        let slope = self.slope + dt_s * self.curvature;
        let value = self.value + dt_s * (self.slope + half * dt_s * self.curvature);
        let error = reading - value;
        self.value = value + (T::one() - discount.powi(3)) * error;
        self.slope = slope + T::lit(1.5) * fresh * fresh * (T::one() + discount) * error / dt_s;
        self.curvature += fresh.powi(3) * error / (dt_s * dt_s);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_load_of_an_accelerating_piston() {
        let cylinder = Cylinder::<f64>::paper();
        let mut estimator = LoadEstimator::new(0.02);
        let mut load = 0.0;
        for k in 0..2000 {
            let t = f64::from(k) * 1e-3;
            let sample = Sample {
                x_m: 0.01 + 0.5 * 0.04 * t * t,
                pa_pa: (1500.0 + cylinder.moving_mass_kg * 0.04) / cylinder.area_a_m2,
                ..Sample::default()
            };
            load = estimator.update(&cylinder, 1e-3, &sample);
        }
        assert!((load - 1500.0).abs() < 1e-6, "{load} N");
    }
}
