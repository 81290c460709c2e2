use super::integrals::Integrals;
use crate::{LeakPressures, PerLeak, Real};

/// A block's length by now, and its pressures.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BlockPressures<T> {
    /// ∫ dt, s.
    pub time_s: T,
    /// Number of steps.
    pub steps: T,
    /// ∫ P_A dt, Pa·s.
    a: T,
    /// ∫ P_B dt, Pa·s.
    b: T,
}

impl<T: Real> BlockPressures<T> {
    /// Goes on over `step`, the time that follows.
    #[inline]
    pub fn add(&mut self, step: &Integrals<T>) {
        self.time_s += step.time;
        self.steps += step.steps;
        self.a += step.a.pressure;
        self.b += step.b.pressure;
    }
}

/// Forgotten means of |P_L|, P_A, P_B, Pa: at these the leak flows are quoted. |P_L| is taken of each
/// block's mean, so that sensor noise does not count as pressure.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PressureMeans<T> {
    time: T,
    load: T,
    load_sign: T,
    a: T,
    b: T,
}

impl<T: Real> PressureMeans<T> {
    /// Takes in a block; all before it counts by `keep` (0 to 1).
    pub fn add_block(&mut self, block: &BlockPressures<T>, keep: T) {
        self.forget(keep);
        self.time += block.time_s;
        let load = block.a - block.b;
        self.load += load.abs();
        self.load_sign += if load < T::zero() { -block.time_s } else { block.time_s };
        self.a += block.a;
        self.b += block.b;
    }

    /// Weighs all that was taken in by `keep` (0 to 1).
    pub fn forget(&mut self, keep: T) {
        self.time *= keep;
        self.load *= keep;
        self.load_sign *= keep;
        self.a *= keep;
        self.b *= keep;
    }

    /// The means; zero before the first block.
    pub fn means(&self) -> LeakPressures<T> {
        let per_time = if self.time > T::zero() { T::one() / self.time } else { T::zero() };
        let mean = |sum: T| sum * per_time;
        LeakPressures {
            sizes_pa: PerLeak {
                internal: mean(self.load),
                external_a: mean(self.a),
                external_b: mean(self.b),
            },
            load_sign: mean(self.load_sign),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(time_s: f64, pa_pa: f64, pb_pa: f64) -> BlockPressures<f64> {
        BlockPressures { time_s, steps: 25.0, a: pa_pa * time_s, b: pb_pa * time_s }
    }

    /// What is weighed by time and forgetting is the mean: Σ w P / Σ w.
    #[test]
    fn means_weigh_by_time_and_age() {
        let mut means = PressureMeans::default();
        means.add_block(&block(1.0, 5e6, 3e6), 0.9);
        means.add_block(&block(3.0, 1e6, 2e6), 0.5);
        let LeakPressures { sizes_pa, load_sign } = means.means();
        let mean = |first: f64, second: f64| (0.5 * first + 3.0 * second) / 3.5;
        for (found, expected) in [
            (sizes_pa.internal, mean(2e6, 1e6)),
            (sizes_pa.external_a, mean(5e6, 1e6)),
            (sizes_pa.external_b, mean(3e6, 2e6)),
            (load_sign, mean(1.0, -1.0)),
        ] {
            assert!((found - expected).abs() < 1e-9 * expected.abs(), "{found} for {expected}");
        }
    }

    #[test]
    fn nothing_watched_is_no_pressure() {
        assert_eq!(PressureMeans::<f64>::default().means(), LeakPressures::default());
    }
}
