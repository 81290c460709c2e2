use super::integrals::Integrals;
use crate::{LeakPressures, PerLeak, Real};

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
    pub fn add_block(&mut self, block: &Integrals<T>, keep: T) {
        self.forget(keep);
        self.time += block.time;
        let load = block.a.pressure - block.b.pressure;
        self.load += load.abs();
        self.load_sign += if load < T::zero() { -block.time } else { block.time };
        self.a += block.a.pressure;
        self.b += block.b.pressure;
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

    fn block(time_s: f64, pa_pa: f64, pb_pa: f64) -> Integrals<f64> {
        let mut block = Integrals { time: time_s, ..Integrals::default() };
        (block.a.pressure, block.b.pressure) = (pa_pa * time_s, pb_pa * time_s);
        block
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
