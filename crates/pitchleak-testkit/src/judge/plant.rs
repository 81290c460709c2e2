//! The judge's own machine: valve, cylinder, load and supply, integrated by Runge and Kutta's fourth order at 2 kHz.
//!
//! It shares no code with the program. Textbook: Merritt, Hydraulic Control Systems (1967), §5-4 and §6-1. A minute takes about 30 ms.

use super::motion::Motion;
use super::worlds::Ailment;
use pitchleak::core::PerLeak;
use std::f64::consts::TAU;

/// Steps per second; trace rates divide it. Hydraulic resonance beside an end is at 850 rad/s.
pub const STEPS_HZ: f64 = 2000.0;
/// Time before the first sample, s: pressures settle.
const WARM_UP_S: f64 = 3.0;
const SUPPLY_PA: f64 = 10e6;
const ATMOSPHERE_PA: f64 = 101_325.0;
const SPOOL_HZ: f64 = 40.0;
const SPOOL_DAMPING: f64 = 0.8;
/// Share of the stroke of the spool by which both edges are open at rest.
const UNDERLAP: f64 = 1e-2;
/// Spool's stroke per stroke of the piston that is missing.
const LOOP_GAIN: f64 = 10.0;
/// Below these drops the flow through an edge of the valve, and through a leak, is laminar, Pa: the root's slope has no end at zero.
const EDGE_LAMINAR_PA: f64 = 1e6;
const LEAK_LAMINAR_PA: f64 = 2e4;
/// The controller opens the valve no further.
const WIDEST: f64 = 0.6;
/// Dry friction has its whole size from about this speed on, m/s.
const DRY_MPS: f64 = 2e-3;
/// The load is that of the paper's size, N.
pub const LOAD_N: f64 = 1e3;

/// A machine as its data sheets have it; SI.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// Lengths in those of the paper's rig.
    pub size: f64,
    /// Piston side, m².
    pub area_a: f64,
    /// Rod side, m².
    pub area_b: f64,
    /// m.
    pub stroke: f64,
    /// kg.
    pub mass: f64,
    /// Volume beside the cylinder's at each port, m³.
    pub dead: [f64; 2],
    /// Of the oil, Pa.
    pub bulk: f64,
}

impl Machine {
    /// Of so many times the paper's lengths.
    pub fn of_size(size: f64) -> Self {
        Self {
            size,
            area_a: 1.26e-3 * size.powi(2),
            area_b: 0.94e-3 * size.powi(2),
            stroke: 0.2 * size,
            mass: 60.0 * size.powi(3),
            dead: [3e-5 * size.powi(3); 2],
            bulk: 0.8e9,
        }
    }

    /// Full scale of the flow meters, m³/s.
    pub fn flow_scale(&self) -> f64 {
        20.0 / 60e3 * self.size.powi(3)
    }
}

/// What happens at one instant; SI, flows into the chambers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Instant {
    pub t: f64,
    pub x: f64,
    pub v: f64,
    pub pa: f64,
    pub pb: f64,
    pub qa: f64,
    pub qb: f64,
    pub force: f64,
    /// Internal, out of A, out of B, m³/s.
    pub leaks: PerLeak<f64>,
}

/// Position, speed, pressures, spool and its speed.
type State = [f64; 6];

/// A machine at work.
pub struct Plant<'a> {
    pub machine: Machine,
    pub ailment: &'a Ailment,
    pub motion: &'a Motion,
    /// m³/(s·Pa), at the full share of their courses.
    pub coefficients: PerLeak<f64>,
    pub seconds: f64,
}

/// Flow through an opening, per its root of a pascal.
fn root(drop: f64, laminar_pa: f64) -> f64 {
    let size = drop.abs();
    if size < laminar_pa { drop / laminar_pa.sqrt() } else { size.sqrt().copysign(drop) }
}

/// A leak's flow by the drop over it, of which a share follows the root; both laws meet at a typical drop.
fn law(drop: f64, orifice: f64, typical: f64) -> f64 {
    if orifice == 0.0 { drop } else { drop + orifice * (root(drop, LEAK_LAMINAR_PA) * typical.sqrt() - drop) }
}

impl Plant<'_> {
    fn supply(&self, t: f64) -> f64 {
        let swing = self.ailment.supply_swing;
        if swing == 0.0 { SUPPLY_PA } else { SUPPLY_PA + swing * (TAU * 0.11 * t).sin() }
    }

    fn flows(&self, t: f64, at: &State) -> [f64; 2] {
        let gain = 1.5 * self.machine.flow_scale() / (SUPPLY_PA / 2.0).sqrt();
        let [.., spool, _] = *at;
        let (out, back) = ((UNDERLAP + spool).max(0.0), (UNDERLAP - spool).max(0.0));
        let (supply, pa, pb) = (self.supply(t), at[2], at[3]);
        let edge = |drop| root(drop, EDGE_LAMINAR_PA);
        let a = out * edge(supply - pa) - back * edge(pa);
        let b = back * edge(supply - pb) - out * edge(pb);
        [gain * a, 0.75 * gain * b]
    }

    /// Leak flows, m³/s.
    fn leaks(&self, t: f64, at: &State) -> PerLeak<f64> {
        let (ailment, pl) = (self.ailment, at[2] - at[3]);
        let open = ailment.courses(t, self.seconds);
        let beyond = |drop: f64| {
            if ailment.cracking == 0.0 {
                drop
            } else {
                drop.signum() * (drop.abs() - ailment.cracking).max(0.0)
            }
        };
        let own = PerLeak {
            internal: law(beyond(pl), ailment.orifice, 2e6) * self.wear(at),
            external_a: law(beyond(at[2]), ailment.orifice, 6e6),
            external_b: law(beyond(at[3]), ailment.orifice, 4e6),
        };
        PerLeak::from_fn(|leak| self.coefficients[leak] * open[leak] * own[leak])
    }

    /// How much wider the internal leak is here than elsewhere.
    fn wear(&self, at: &State) -> f64 {
        let (ailment, place) = (self.ailment, at[0] / self.machine.stroke);
        if ailment.spot {
            6.0 * (-((place - 0.35) / 0.06).powi(2)).exp()
        } else if ailment.by_position > 0.0 {
            1.0 + ailment.by_position * (TAU * place).cos()
        } else if ailment.one_way && at[1] < 0.0 {
            0.0
        } else {
            1.0
        }
    }

    fn compliance(&self, volume: f64, pressure: f64) -> f64 {
        let oil = volume / (self.machine.bulk * self.ailment.bulk);
        if self.ailment.air > 0.0 {
            let absolute = (pressure + ATMOSPHERE_PA).max(1e4);
            let share = self.ailment.air * (ATMOSPHERE_PA / absolute).powf(1.0 / 1.2);
            return oil + volume * share / absolute / 1.2;
        }
        oil
    }

    fn rates(&self, t: f64, at: &State, told: f64, load: f64) -> State {
        let (machine, ailment) = (&self.machine, self.ailment);
        let [x, v, pa, pb, spool, spool_v] = *at;
        let (area_a, area_b) = (machine.area_a * ailment.areas[0], machine.area_b * ailment.areas[1]);
        let stroke = machine.stroke * ailment.stroke;
        let least = 1e-3 * stroke;
        let dead = [0, 1].map(|i| machine.dead[i] + ailment.dead[i] * machine.size.powi(3));
        let volume_a = area_a * x.max(least) + dead[0];
        let volume_b = area_b * (stroke - x).max(least) + dead[1];
        let area = machine.size.powi(2);
        let dry = ailment.dry * area * v / (v * v + DRY_MPS * DRY_MPS).sqrt();
        let friction = dry + 2e3 * machine.size * v;
        // The end stops: stiff, and heavily damped.
        let beyond = x.min(0.0) + (x - stroke).max(0.0);
        let stop = if beyond == 0.0 { 0.0 } else { 2e7 * area * beyond + 1e4 * area * v };
        let [qa, qb] = self.flows(t, at);
        let leak = self.leaks(t, at);
        let omega = TAU * SPOOL_HZ;
        [
            v,
            (pa * area_a - pb * area_b - load - friction - stop) / machine.mass,
            (qa - area_a * v - leak.internal - leak.external_a) / self.compliance(volume_a, pa),
            (qb + area_b * v + leak.internal - leak.external_b) / self.compliance(volume_b, pb),
            spool_v,
            omega * omega * (told - spool) - 2.0 * SPOOL_DAMPING * omega * spool_v,
        ]
    }

    /// Runs, and shows every instant from time zero on.
    pub fn run(&self, mut show: impl FnMut(&Instant)) {
        let (h, stroke) = (1.0 / STEPS_HZ, self.machine.stroke);
        let newtons = LOAD_N * self.machine.size.powi(2);
        let mut at: State = [stroke * self.motion.place(-WARM_UP_S), 0.0, 6e6, 4e6, 0.0, 0.0];
        for k in 0..((self.seconds + WARM_UP_S) * STEPS_HZ).round() as u64 {
            let t = k as f64 * h - WARM_UP_S;
            let [load, middle, later] = [0.0, 0.5, 1.0].map(|part| newtons * self.motion.load(t + part * h));
            let told = (LOOP_GAIN * (self.motion.place(t) - at[0] / stroke)).clamp(-WIDEST, WIDEST);
            if t > -0.5 * h {
                let [qa, qb] = self.flows(t, &at);
                let [x, v, pa, pb, ..] = at;
                show(&Instant { t, x, v, pa, pb, qa, qb, force: load, leaks: self.leaks(t, &at) });
            }
            let plus = |rate: &State, part: f64| std::array::from_fn(|i| at[i] + part * h * rate[i]);
            let k1 = self.rates(t, &at, told, load);
            let k2 = self.rates(t + h / 2.0, &plus(&k1, 0.5), told, middle);
            let k3 = self.rates(t + h / 2.0, &plus(&k2, 0.5), told, middle);
            let k4 = self.rates(t + h, &plus(&k3, 1.0), told, later);
            at = std::array::from_fn(|i| at[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
    }
}
