//! The pressures over a trace, and how warm its oil is and how fast it warms.

use crate::trace::Record;
use crate::viscosity::{THINNING_SPREAD, thinning_per_k};
use pitchleak_core::{Estimate, LeakPressures, PerLeak};
use serde::{Deserialize, Serialize};

/// Readings fade with this time, s.
const MEMORY_S: f64 = 120.0;
/// Readings over a shorter time tell no slope, s.
const LEAST_S: f64 = 10.0;

/// Least squares of a straight line through the temperature's readings, old ones faded. Times count back from the last
/// reading, temperatures from the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct OilTemperature {
    first_k: f64,
    last_s: f64,
    since_s: f64,
    readings: f64,
    time: f64,
    time_square: f64,
    temperature: f64,
    product: f64,
    temperature_square: f64,
}

impl OilTemperature {
    pub fn add(&mut self, record: &Record) {
        let Some(temperature_k) = record.temperature_k else { return };
        if self.readings == 0.0 {
            *self =
                Self { first_k: temperature_k, last_s: record.t_s, since_s: record.t_s, ..Self::default() };
        }
        self.pass(record.t_s - self.last_s);
        self.last_s = record.t_s;
        let above = temperature_k - self.first_k;
        self.readings += 1.0;
        self.temperature += above;
        self.temperature_square += above * above;
    }

    /// Moves the origin of time on and fades what is old.
    fn pass(&mut self, by_s: f64) {
        self.time_square += by_s * (by_s * self.readings - 2.0 * self.time);
        self.product -= by_s * self.temperature;
        self.time -= by_s * self.readings;
        let fading = (-by_s / MEMORY_S).exp();
        for sum in [
            &mut self.readings,
            &mut self.time,
            &mut self.time_square,
            &mut self.temperature,
            &mut self.product,
            &mut self.temperature_square,
        ] {
            *sum *= fading;
        }
    }

    /// How fast the oil thins, share of its viscosity per second: what the leaks' share grows by if they follow it.
    pub fn thinning_ps(&self) -> Option<Estimate<f64>> {
        let (now_k, warming_kps) = self.now()?;
        let per_k = thinning_per_k(now_k);
        let std = (per_k * warming_kps.std).hypot(THINNING_SPREAD * per_k * warming_kps.value);
        (per_k.is_finite() && std.is_finite()).then_some(Estimate { value: per_k * warming_kps.value, std })
    }

    /// Temperature at the last reading, K, and its slope, K/s; none where there are too few readings.
    fn now(&self) -> Option<(f64, Estimate<f64>)> {
        if self.last_s - self.since_s < LEAST_S || self.readings < 3.0 {
            return None;
        }
        let (n, t, y) = (self.readings, self.time, self.temperature);
        let spread = self.time_square - t * t / n;
        let shared = self.product - t * y / n;
        let slope = shared / spread;
        let left = (self.temperature_square - y * y / n - slope * shared).max(0.0);
        let std = (left / (n - 2.0) / spread).sqrt();
        let now_k = self.first_k + (y - slope * t) / n;
        let sound = slope.is_finite() && std.is_finite() && now_k.is_finite();
        sound.then_some((now_k, Estimate { value: slope, std }))
    }
}

/// Pressures across each leak, averaged over a whole trace, Pa.
///
/// The size of the internal leak goes with |P_L|: it is taken of means over a tenth of a second, so that
/// sensor noise does not count as pressure.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_found_again() {
        let mut oil = OilTemperature::default();
        for step in 0..6000 {
            let t_s = 1000.0 + f64::from(step) * 0.1;
            let wobble = if step % 2 == 0 { 0.1 } else { -0.1 };
            oil.add(&Record {
                t_s,
                temperature_k: Some(300.0 + 0.02 * (t_s - 1000.0) + wobble),
                ..Record::default()
            });
        }
        let (now_k, slope) = oil.now().expect("enough readings");
        assert!((now_k - 312.0).abs() < 0.05, "{now_k}");
        assert!((slope.value - 0.02).abs() < 4.0 * slope.std && slope.std < 2e-4, "{slope:?}");
    }

    #[test]
    fn no_reading_tells_nothing() {
        let mut oil = OilTemperature::default();
        oil.add(&Record::default());
        assert_eq!(oil.now(), None);
    }
}
