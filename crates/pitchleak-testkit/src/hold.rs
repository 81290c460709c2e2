//! A cylinder whose ports are shut, integrated by Runge and Kutta's fourth order at 2 kHz: the plant that judges hold tests.
//!
//! It shares no code with the program. Textbook: Merritt, Hydraulic Control Systems (1967), §6-1, with both flows zero.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;
use std::fmt::Write;

const STEPS_HZ: f64 = 2000.0;
const PRESSURE_SCALE_PA: f64 = 16e6;
/// Dry friction has its whole size from about this speed on, m/s.
const DRY_MPS: f64 = 1e-4;
const VAPOUR_PA: f64 = -0.95e5;

/// A cylinder of the paper's size in a hold; SI.
#[derive(Clone, Copy, Debug)]
pub struct HeldCylinder {
    /// Beside the swept volume, at each port, m³.
    pub dead_m3: f64,
    /// Of its oil, Pa.
    pub bulk_pa: f64,
    /// Internal, out of A, out of B, at 50 bar, L/min.
    pub leaks_lpm: [f64; 3],
    /// At the begin, m …
    pub x_m: f64,
    /// … and Pa.
    pub pressures_pa: [f64; 2],
    /// The load swings by this beside what balances the pressures, N.
    pub swing_n: f64,
    /// Dry friction, N.
    pub dry_n: f64,
    /// A pipe's flow through a valve that isn't quite shut, into A, m³/s.
    pub seeps_m3s: f64,
}

impl Default for HeldCylinder {
    fn default() -> Self {
        Self {
            dead_m3: 5e-5,
            bulk_pa: 0.8e9,
            leaks_lpm: [0.0; 3],
            x_m: 0.1,
            pressures_pa: [60e5, 40e5],
            swing_n: 0.0,
            dry_n: 0.0,
            seeps_m3s: 0.0,
        }
    }
}

/// x, v, P_A, P_B.
type State = [f64; 4];

/// What was recorded of a hold.
#[derive(Clone, Debug, Default)]
pub struct HeldTrace {
    /// As CSV: t_s, x_mm, pa_bar, pb_bar, shut.
    pub text: String,
    /// Time and true flows of the leaks at each row: internal by its size, out of A, out of B; s and L/min.
    pub truth: Vec<(f64, [f64; 3])>,
}

impl HeldTrace {
    /// Mean flows until a time, L/min.
    pub fn mean_lpm(&self, until_s: f64) -> [f64; 3] {
        let rows: Vec<_> = self.truth.iter().filter(|(t_s, _)| *t_s <= until_s + 1e-9).collect();
        [0, 1, 2].map(|i| rows.iter().map(|(_, flows)| flows[i]).sum::<f64>() / rows.len() as f64)
    }
}

const AREA_A: f64 = 12.6e-4;
const AREA_B: f64 = 9.4e-4;
const STROKE: f64 = 0.2;
const MASS: f64 = 60.0;

impl HeldCylinder {
    fn leaks_m3s(&self, at: &State) -> [f64; 3] {
        let [.., pa, pb] = *at;
        let [internal, a, b] = self.leaks_lpm.map(|lpm| lpm / 60e3 / 50e5);
        [internal * (pa - pb), a * pa.max(0.0), b * pb.max(0.0)]
    }

    fn rates(&self, t_s: f64, at: &State) -> State {
        let [x, v, pa, pb] = *at;
        let [through, out_a, out_b] = self.leaks_m3s(at);
        let volume_a = AREA_A * x + self.dead_m3;
        let volume_b = AREA_B * (STROKE - x) + self.dead_m3;
        let [pa0, pb0] = self.pressures_pa;
        let load = pa0 * AREA_A - pb0 * AREA_B + self.swing_n * (TAU * 0.4 * t_s).sin();
        let friction = self.dry_n * v / (v * v + DRY_MPS * DRY_MPS).sqrt() + 2e3 * v;
        let filled = |pressure: f64, rate: f64| if pressure <= VAPOUR_PA && rate < 0.0 { 0.0 } else { rate };
        [
            v,
            (pa * AREA_A - pb * AREA_B - load - friction) / MASS,
            filled(pa, self.bulk_pa / volume_a * (self.seeps_m3s - AREA_A * v - through - out_a)),
            filled(pb, self.bulk_pa / volume_b * (AREA_B * v + through - out_b)),
        ]
    }

    /// A hold of so many seconds, read at `rate_hz` with white noise of 3 σ = `accuracy` of full scale (0.2 m, 160 bar).
    pub fn trace(&self, seconds: f64, rate_hz: f64, accuracy: f64, seed: u64) -> HeldTrace {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut noise = |scale: f64| -> f64 {
            let normal: f64 = StandardNormal.sample(&mut random);
            normal * scale * accuracy / 3.0
        };
        let h = 1.0 / STEPS_HZ;
        let every = (STEPS_HZ / rate_hz).round() as u64;
        let mut at: State = [self.x_m, 0.0, self.pressures_pa[0], self.pressures_pa[1]];
        let mut trace =
            HeldTrace { text: "t_s,x_mm,pa_bar,pb_bar,shut\n".to_owned(), ..HeldTrace::default() };
        for k in 0..=(seconds * STEPS_HZ).round() as u64 {
            let t_s = k as f64 * h;
            if k.is_multiple_of(every) {
                let [x, _, pa, pb] = at;
                let shown = [x + noise(STROKE), pa + noise(PRESSURE_SCALE_PA), pb + noise(PRESSURE_SCALE_PA)];
                let _ = writeln!(
                    trace.text,
                    "{t_s:.5},{:.6},{:.6},{:.6},1",
                    1e3 * shown[0],
                    1e-5 * shown[1],
                    1e-5 * shown[2]
                );
                let [through, a, b] = self.leaks_m3s(&at).map(|flow| flow * 60e3);
                trace.truth.push((t_s, [through.abs(), a, b]));
            }
            let plus = |rate: &State, part: f64| std::array::from_fn(|i| at[i] + part * h * rate[i]);
            let k1 = self.rates(t_s, &at);
            let k2 = self.rates(t_s + h / 2.0, &plus(&k1, 0.5));
            let k3 = self.rates(t_s + h / 2.0, &plus(&k2, 0.5));
            let k4 = self.rates(t_s + h, &plus(&k3, 1.0));
            at = std::array::from_fn(|i| at[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
        trace
    }
}
