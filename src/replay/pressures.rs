use crate::trace::Record;
use pitchleak_core::{LeakPressures, PerLeak};

/// Pressures across each leak, averaged over a whole trace, Pa.
///
/// The size of the internal leak goes with |P_L|: it is taken of means over a tenth of a second, so that
/// sensor noise does not count as pressure.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct TracePressures {
    block_time: f64,
    block_load: f64,
    time: f64,
    load_size: f64,
    load_sign: f64,
    load: f64,
    a: f64,
    b: f64,
}

const BLOCK_S: f64 = 0.1;

impl TracePressures {
    #[inline]
    pub fn add(&mut self, record: &Record) {
        let dt = record.step_s();
        let (pa, pb) = (record.sample.pa_pa, record.sample.pb_pa);
        self.time += dt;
        self.load += (pa - pb) * dt;
        self.a += pa * dt;
        self.b += pb * dt;
        self.block_time += dt;
        self.block_load += (pa - pb) * dt;
        if self.block_time >= BLOCK_S {
            self.load_size += self.block_load.abs();
            self.load_sign += self.block_time.copysign(self.block_load);
            (self.block_time, self.block_load) = (0.0, 0.0);
        }
    }

    /// Means of |P_L|, P_A, P_B, as read.
    pub fn sizes(&self) -> LeakPressures<f64> {
        let mean = |sum: f64| if self.time > 0.0 { sum / self.time } else { 0.0 };
        LeakPressures {
            sizes_pa: PerLeak {
                internal: mean(self.load_size + self.block_load.abs()),
                external_a: mean(self.a),
                external_b: mean(self.b),
            },
            load_sign: mean(self.load_sign + self.block_time.copysign(self.block_load)),
        }
    }

    /// Mean of P_L with its sign, as read, and of P_A and P_B.
    pub fn net(&self) -> LeakPressures<f64> {
        let load = if self.time > 0.0 { self.load / self.time } else { 0.0 };
        let sizes = self.sizes();
        LeakPressures { sizes_pa: PerLeak { internal: load, ..sizes.sizes_pa }, load_sign: 1.0 }
    }
}
