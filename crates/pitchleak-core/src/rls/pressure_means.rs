use super::balance::Integrals;
use crate::{PerLeak, Real};

/// Forgotten means of |P_L|, P_A, P_B, Pa: at these the leak flows are quoted. |P_L| is taken of each
/// block's mean, so that sensor noise does not count as pressure.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PressureMeans<T> {
    time: T,
    load: T,
    a: T,
    b: T,
}

impl<T: Real> PressureMeans<T> {
    pub fn add_block(&mut self, block: &Integrals<T>, keep: T) {
        self.forget(keep);
        self.time += block.time;
        self.load += (block.a.pressure - block.b.pressure).abs();
        self.a += block.a.pressure;
        self.b += block.b.pressure;
    }

    pub fn forget(&mut self, keep: T) {
        self.time *= keep;
        self.load *= keep;
        self.a *= keep;
        self.b *= keep;
    }

    pub fn means(&self) -> PerLeak<T> {
        let per_time = if self.time > T::zero() { T::one() / self.time } else { T::zero() };
        PerLeak {
            internal: self.load * per_time,
            external_a: self.a * per_time,
            external_b: self.b * per_time,
        }
    }
}
