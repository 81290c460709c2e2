//! A plant of this bench's own: valve, cylinder and load integrated at 10 kHz. It shares no code with the program's.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

const RATE_HZ: f64 = 10_000.0;
const SUPPLY_PA: f64 = 10e6;
const ATMOSPHERE_PA: f64 = 101_325.0;
const SPOOL_HZ: f64 = 40.0;
const SPOOL_DAMPING: f64 = 0.8;
const UNDERLAP: f64 = 5e-3;
const OIL_KGPM3: f64 = 870.0;
/// Time before the first sample, s.
const WARM_UP_S: f64 = 3.0;

/// A cylinder of the paper's proportions and another size, with what ails it; SI.
#[derive(Clone, Copy, Debug)]
pub struct Plant {
    pub area_a: f64,
    pub area_b: f64,
    pub stroke: f64,
    pub mass: f64,
    pub bulk: f64,
    pub internal: f64,
    pub external_a: f64,
    pub external_b: f64,
    /// Flow of the whole valve at half of the supply.
    pub valve: f64,
    /// Size of forces.
    pub load: f64,
    pub ailment: Physics,
}

/// Effects within the machine, zero where it is sound.
#[derive(Clone, Copy, Debug, Default)]
pub struct Physics {
    pub dead_a: f64,
    pub dead_b: f64,
    pub air: f64,
    pub gas_a: f64,
    pub turbulent: f64,
    pub viscous: f64,
    pub coulomb: f64,
    // What no table has.
    /// Leak past the piston with the spool's opening, per Pa.
    pub spool_leak: f64,
    /// Leak past the piston with the power 1.5 of the pressure.
    pub steep_leak: f64,
    /// Leak past the piston above a pressure difference.
    pub relief: f64,
    /// Leak past the piston while extending only, per Pa.
    pub extending: f64,
    /// Leak past the piston from A to B only, per Pa: past a check valve.
    pub checked: f64,
    /// Leak past the piston that grows with the time, per Pa and s.
    pub growing: f64,
    /// Friction with the cube of the speed.
    pub cubic: f64,
    /// Friction that is larger outwards.
    pub lopsided: f64,
    /// The oil's bulk modulus grows by this share per Pa.
    pub stiffening: f64,
    /// Volume of the hose from the valve, its meter and its pressure sensor to chamber A, m³; it has inertia.
    pub hose: f64,
}

/// One instant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Instant {
    pub t: f64,
    pub x: f64,
    pub pa: f64,
    pub pb: f64,
    pub qa: f64,
    pub qb: f64,
    pub force: f64,
}

/// How much of the time the piston stands.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Rest {
    Never,
    /// Every other 7.5 s.
    Half,
    /// All but one minute in ten.
    Mostly,
}

impl Plant {
    /// `size` times as long as the paper's rig.
    pub fn of_size(size: f64) -> Self {
        let (area, volume) = (size.powi(2), size.powi(3));
        Self {
            area_a: 1.26e-3 * area,
            area_b: 0.94e-3 * area,
            stroke: 0.2 * size,
            mass: 30.0 * volume,
            bulk: 0.9e9,
            internal: 1e-11 * area,
            external_a: 3e-12 * area,
            external_b: 1e-12 * area,
            valve: 30.0 / 60e3 * volume,
            load: 1e3 * area,
            ailment: Physics::default(),
        }
    }
}

/// Sines of random frequencies and phases, of unit power.
struct Lines(Vec<(f64, f64)>);

impl Lines {
    fn draw(random: &mut ChaCha8Rng, count: usize, low_hz: f64, high_hz: f64) -> Self {
        let line = |_| {
            let share: f64 = random.random();
            (TAU * low_hz * (high_hz / low_hz).powf(share), TAU * random.random::<f64>())
        };
        Self((0..count).map(line).collect())
    }

    fn at(&self, t: f64) -> f64 {
        let sum: f64 = self.0.iter().map(|(omega, phase)| (omega * t + phase).sin()).sum();
        sum * (2.0 / self.0.len() as f64).sqrt()
    }
}

#[derive(Clone, Copy, Default)]
struct State {
    x: f64,
    v: f64,
    pa: f64,
    pb: f64,
    spool: f64,
    spool_v: f64,
    /// At the valve's end of the hose, and what flows out of its other end.
    hose_p: f64,
    hose_q: f64,
}

impl State {
    fn plus(self, h: f64, rate: Self) -> Self {
        Self {
            x: self.x + h * rate.x,
            v: self.v + h * rate.v,
            pa: self.pa + h * rate.pa,
            pb: self.pb + h * rate.pb,
            spool: self.spool + h * rate.spool,
            spool_v: self.spool_v + h * rate.spool_v,
            hose_p: self.hose_p + h * rate.hose_p,
            hose_q: self.hose_q + h * rate.hose_q,
        }
    }
}

fn root(p: f64) -> f64 {
    p.signum() * p.abs().sqrt()
}

/// −dV/dP per volume of gas at the atmosphere's pressure.
fn gas(p: f64) -> f64 {
    let absolute = (p + ATMOSPHERE_PA).max(1e4);
    (ATMOSPHERE_PA / absolute).powf(1.0 / 1.2) / absolute / 1.2
}

impl Plant {
    fn pressure_at_valve_a(&self, at: &State) -> f64 {
        if self.ailment.hose > 0.0 { at.hose_p } else { at.pa }
    }

    /// Rates of pressure at the valve's end of the hose and of the flow through it.
    fn hose(&self, at: &State, valve_flow: f64) -> (f64, f64) {
        let volume = self.ailment.hose;
        if volume <= 0.0 {
            return (0.0, 0.0);
        }
        // Bore of a tenth of the piston's area.
        let bore = 0.1 * self.area_a;
        let inertia = OIL_KGPM3 * volume / (bore * bore);
        let resistance = 2e5 / self.valve;
        let flow = (at.hose_p - at.pa - resistance * at.hose_q) / inertia;
        ((valve_flow - at.hose_q) * self.bulk / volume, flow)
    }

    fn flows(&self, at: &State) -> (f64, f64) {
        let k = self.valve / (SUPPLY_PA / 2.0).sqrt();
        let (out, back) = ((UNDERLAP + at.spool).max(0.0), (UNDERLAP - at.spool).max(0.0));
        let pa = self.pressure_at_valve_a(at);
        let qa = k * (out * root(SUPPLY_PA - pa) - back * root(pa));
        let qb = k * 0.75 * (back * root(SUPPLY_PA - at.pb) - out * root(at.pb));
        (qa, qb)
    }

    fn rate(&self, t: f64, at: &State, wanted: f64, load: f64) -> State {
        let own = &self.ailment;
        let (valve_flow, qb) = self.flows(at);
        let (hose_p, hose_q) = self.hose(at, valve_flow);
        let qa = if own.hose > 0.0 { at.hose_q } else { valve_flow };
        let pl = at.pa - at.pb;
        let past = self.internal * pl
            + own.turbulent * root(pl)
            + own.spool_leak * at.spool.abs() * pl
            + own.steep_leak * pl.signum() * pl.abs().powf(1.5)
            + own.relief * ((pl.abs() - 2e6).max(0.0)) * pl.signum()
            + own.extending * if at.v > 0.0 { pl } else { 0.0 }
            + own.checked * pl.max(0.0)
            + own.growing * t * pl;
        let (va, vb) = (self.area_a * at.x.max(1e-4), self.area_b * (self.stroke - at.x).max(1e-4));
        let bulk = |p: f64| self.bulk * (1.0 + own.stiffening * p);
        let ca = (va + own.dead_a) / bulk(at.pa) + (own.air * va + own.gas_a) * gas(at.pa);
        let cb = (vb + own.dead_b) / bulk(at.pb) + own.air * vb * gas(at.pb);
        let dry = (at.v / 2e-3).tanh();
        let friction = own.viscous * at.v
            + own.coulomb * dry
            + own.cubic * at.v.powi(3)
            + own.lopsided * dry * if at.v > 0.0 { 1.0 } else { 0.4 };
        let omega = TAU * SPOOL_HZ;
        State {
            x: at.v,
            v: (at.pa * self.area_a - at.pb * self.area_b - load - friction) / self.mass,
            pa: (qa - self.area_a * at.v - past - self.external_a * at.pa) / ca,
            pb: (qb + self.area_b * at.v + past - self.external_b * at.pb) / cb,
            spool: at.spool_v,
            spool_v: omega * omega * (wanted - at.spool) - 2.0 * SPOOL_DAMPING * omega * at.spool_v,
            hose_p,
            hose_q,
        }
    }

    /// Runs for `seconds` and shows every instant of 10 kHz, from time zero.
    pub fn run(&self, rest: Rest, seconds: f64, seed: u64, mut show: impl FnMut(&Instant)) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let motion = Lines::draw(&mut random, 9, 0.04, 0.9);
        let wind = Lines::draw(&mut random, 12, 0.04, 1.4);
        let h = 1.0 / RATE_HZ;
        let mut at = State { x: self.stroke / 2.0, pa: 5e6, pb: 4e6, hose_p: 5e6, ..State::default() };
        // The clock of the reference, which stands while the piston rests.
        let mut clock = 0.0;
        let steps = ((seconds + WARM_UP_S) * RATE_HZ).round() as u64;
        let load_at = |t: f64| self.load * (2.0 + 0.8 * wind.at(t));
        let mut load = load_at(-WARM_UP_S);
        for k in 0..steps {
            let t = k as f64 * h - WARM_UP_S;
            let moving = match rest {
                Rest::Never => true,
                Rest::Half => t.rem_euclid(15.0) < 7.5,
                Rest::Mostly => t.rem_euclid(600.0) < 60.0,
            };
            clock += if moving { h } else { 0.0 };
            // What the valve is told is kept over one step, as a controller does; the load is not: half a step late, it would be
            // newtons in an hour's mean that the force sensor does not show.
            let aim = self.stroke * (0.5 + 0.13 * motion.at(clock)).clamp(0.06, 0.94);
            let later = load_at(t + h);
            let middle = (load + later) / 2.0;
            let wanted = (10.0 * (aim - at.x) / self.stroke).clamp(-1.0, 1.0);
            if k as f64 >= WARM_UP_S * RATE_HZ {
                let (qa, qb) = self.flows(&at);
                let pa = self.pressure_at_valve_a(&at);
                show(&Instant { t, x: at.x, pa, pb: at.pb, qa, qb, force: load });
            }
            let k1 = self.rate(t, &at, wanted, load);
            let k2 = self.rate(t, &at.plus(h / 2.0, k1), wanted, middle);
            let k3 = self.rate(t, &at.plus(h / 2.0, k2), wanted, middle);
            let k4 = self.rate(t, &at.plus(h, k3), wanted, later);
            load = later;
            at = at.plus(h / 6.0, k1).plus(h / 3.0, k2).plus(h / 3.0, k3).plus(h / 6.0, k4);
        }
    }
}
