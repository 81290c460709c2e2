//! Integrals of both continuity equations over a step and a block, and the mean pressures of the blocks.

use crate::{Cylinder, LeakPressures, PerLeak, Real, Sample};

/// Integrals of one chamber's continuity equation (Q = A ẋ + κ V Ṗ + leaks, κ = 1/β), by the
/// trapezoidal rule over a step or summed over a block.
///
/// No derivative is taken of a noisy signal: ∫ V Ṗ dt is V at mid-step times the pressure's rise.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ChamberIntegrals<T> {
    /// ∫ Q dt, m³.
    pub flow: T,
    /// ∫ V dP, m³·Pa.
    pub compression: T,
    /// ∫ P dt, Pa·s.
    pub pressure: T,
}

/// Both chambers over the same time.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Integrals<T> {
    /// Chamber A.
    pub a: ChamberIntegrals<T>,
    /// Chamber B.
    pub b: ChamberIntegrals<T>,
    /// ∫ dt, s.
    pub time: T,
    /// Σ dt², s²: times the variance of one sample it is the variance of ∫ Q dt.
    pub time_square: T,
    /// Number of steps.
    pub steps: T,
}

/// From one sample to the next.
#[derive(Clone, Copy, Debug)]
pub struct Step<T> {
    /// A chamber whose flow was not measured at both ends has none here.
    pub integrals: Integrals<T>,
    /// Chambers whose flow was measured at both ends.
    pub measured: Measured,
}

/// Chambers whose flow was measured all through: the equation of any other rests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "they say it themselves")]
pub enum Measured {
    Both,
    OnlyA,
    OnlyB,
    Neither,
}

/// Sums of the flows at both ends of a step, m³/s.
struct Flows<T> {
    measured: Measured,
    a_m3s: T,
    b_m3s: T,
}

impl<T: Real> Flows<T> {
    #[inline]
    fn between(last: &Sample<T>, now: &Sample<T>) -> Self {
        match (last.qa_m3s, now.qa_m3s, last.qb_m3s, now.qb_m3s) {
            (Some(a), Some(a_now), Some(b), Some(b_now)) => {
                Self { measured: Measured::Both, a_m3s: a + a_now, b_m3s: b + b_now }
            }
            _ => Self::not_both(last, now),
        }
    }

    #[cold]
    fn not_both(last: &Sample<T>, now: &Sample<T>) -> Self {
        let none = T::zero();
        let (measured, a_m3s, b_m3s) = match (last.qa_m3s, now.qa_m3s, last.qb_m3s, now.qb_m3s) {
            (Some(a), Some(a_now), ..) => (Measured::OnlyA, a + a_now, none),
            (.., Some(b), Some(b_now)) => (Measured::OnlyB, none, b + b_now),
            _ => (Measured::Neither, none, none),
        };
        Self { measured, a_m3s, b_m3s }
    }
}

impl<T: Real> Step<T> {
    /// The step from `last` to `now`, `dt_s` later. A position beyond the stroke counts as its end.
    #[inline]
    pub fn between(cylinder: &Cylinder<T>, dt_s: T, last: &Sample<T>, now: &Sample<T>) -> Self {
        let flows = Flows::between(last, now);
        let half = T::lit(0.5);
        let half_dt = half * dt_s;
        let x = (half * (last.x_m + now.x_m)).at_least(T::zero()).at_most(cylinder.stroke_m);
        let integrals = Integrals {
            a: ChamberIntegrals {
                flow: half_dt * flows.a_m3s,
                compression: cylinder.volume_a_m3(x) * (now.pa_pa - last.pa_pa),
                pressure: half_dt * (last.pa_pa + now.pa_pa),
            },
            b: ChamberIntegrals {
                flow: half_dt * flows.b_m3s,
                compression: cylinder.volume_b_m3(x) * (now.pb_pa - last.pb_pa),
                pressure: half_dt * (last.pb_pa + now.pb_pa),
            },
            time: dt_s,
            time_square: dt_s * dt_s,
            steps: T::one(),
        };
        Self { integrals, measured: flows.measured }
    }
}

impl<T: Real> Integrals<T> {
    /// Goes on over `step`, the time that follows.
    pub fn add(&mut self, step: &Self) {
        self.a.add(&step.a);
        self.b.add(&step.b);
        self.time += step.time;
        self.time_square += step.time_square;
        self.steps += step.steps;
    }

    /// Over all but `steps`, some of those that it went over.
    #[cold]
    #[inline(never)]
    pub fn without(&self, steps: &Self) -> Self {
        Self {
            a: self.a.without(&steps.a),
            b: self.b.without(&steps.b),
            time: self.time - steps.time,
            time_square: self.time_square - steps.time_square,
            steps: self.steps - steps.steps,
        }
    }
}

impl<T: Real> ChamberIntegrals<T> {
    fn add(&mut self, step: &Self) {
        self.flow += step.flow;
        self.compression += step.compression;
        self.pressure += step.pressure;
    }

    fn without(&self, steps: &Self) -> Self {
        Self {
            flow: self.flow - steps.flow,
            compression: self.compression - steps.compression,
            pressure: self.pressure - steps.pressure,
        }
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
