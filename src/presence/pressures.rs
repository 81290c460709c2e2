//! The pressures that drive leaks, as means over time.

use pitchleak_core::PerLeak;
use serde::{Deserialize, Serialize};

/// Sums over time of |P_L|, P_A, P_B and of P_L, Pa s.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Pressures {
    sizes_pas: PerLeak<f64>,
    load_pas: f64,
    pub time_s: f64,
}

impl Pressures {
    /// A step in which P_A and P_B went from the first to the second.
    pub fn add(&mut self, step_s: f64, a_pa: [f64; 2], b_pa: [f64; 2]) {
        let [a_pa, b_pa] = [a_pa, b_pa].map(|[from, to]| 0.5 * (from + to));
        let sizes = PerLeak { internal: (a_pa - b_pa).abs(), external_a: a_pa, external_b: b_pa };
        self.sizes_pas = self.sizes_pas.zip(sizes).map(|(sum, size)| sum + step_s * size);
        self.load_pas += step_s * (a_pa - b_pa);
        self.time_s += step_s;
    }

    /// Both together.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            sizes_pas: self.sizes_pas.zip(other.sizes_pas).map(|(a, b)| a + b),
            load_pas: self.load_pas + other.load_pas,
            time_s: self.time_s + other.time_s,
        }
    }

    /// Means of |P_L|, P_A, P_B, Pa.
    pub fn sizes_pa(&self) -> PerLeak<f64> {
        self.sizes_pas.map(|sum| sum / self.time_s.max(f64::MIN_POSITIVE))
    }

    /// Mean of P_L, Pa.
    pub fn load_pa(&self) -> f64 {
        self.load_pas / self.time_s.max(f64::MIN_POSITIVE)
    }
}
