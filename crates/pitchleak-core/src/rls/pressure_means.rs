use super::balance::Integrals;
use crate::{LeakPressures, PerLeak, Real};

/// Forgotten means of |P_L|, P_A, P_B, Pa: at these the leak flows are quoted. |P_L| is taken of each
/// block's mean, so that sensor noise does not count as pressure.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct PressureMeans<T> {
    time: T,
    load: T,
    load_sign: T,
    a: T,
    b: T,
}

impl<T: Real> PressureMeans<T> {
    pub fn add_block(&mut self, block: &Integrals<T>, keep: T) {
        self.forget(keep);
        self.time += block.time;
        let load = block.a.pressure - block.b.pressure;
        self.load += load.abs();
        self.load_sign += if load < T::zero() { -block.time } else { block.time };
        self.a += block.a.pressure;
        self.b += block.b.pressure;
    }

    pub fn forget(&mut self, keep: T) {
        self.time *= keep;
        self.load *= keep;
        self.load_sign *= keep;
        self.a *= keep;
        self.b *= keep;
    }

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
