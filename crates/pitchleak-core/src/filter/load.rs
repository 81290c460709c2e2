use super::{FadingMemoryFilter, hydraulic_force_n};
use crate::{Cylinder, Real, Sample};

/// Load force F from eq. (2) by least squares, for a trace without a force column (paper, Section II after
/// eq. 14): F = P_A A_A − P_B A_B − m ẍ.
///
/// ẍ is the curvature of the [`FadingMemoryFilter`] through the positions; the hydraulic force is smoothed by
/// the same filter, so that both sides lag alike.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadEstimator<T> {
    position: FadingMemoryFilter<T>,
    force: FadingMemoryFilter<T>,
}

impl<T: Real> LoadEstimator<T> {
    /// With a memory of `memory_s` seconds.
    pub fn new(memory_s: T) -> Self {
        let filter = FadingMemoryFilter::new(memory_s);
        Self { position: filter, force: filter }
    }

    /// Takes a reading `dt_s` after the one before; returns the load F, N, against extension.
    pub fn update(&mut self, cylinder: &Cylinder<T>, dt_s: T, sample: &Sample<T>) -> T {
        let acceleration = self.position.update(dt_s, sample.x_m).curvature();
        let force = self.force.update(dt_s, hydraulic_force_n(cylinder, sample)).value();
        force - cylinder.moving_mass_kg * acceleration
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
