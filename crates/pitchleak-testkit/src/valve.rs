//! A cylinder on a four-edge valve, under a pitch controller and a windy load, integrated by Runge and Kutta's fourth order at 2 kHz:
//! the plant that judges leaks found without flow meters.
//!
//! It shares no code with the program. Textbook: Merritt, Hydraulic Control Systems (1967), §5-1 and §6-1. Each edge has its own gain,
//! lap, rounding and clearance; the spool is of second order; an accumulator is charged in a saw-tooth.

use crate::white_noise;
use std::f64::consts::TAU;
use std::fmt::Write;

const STEPS_HZ: f64 = 2000.0;
/// A trace begins so long after the motion does, s.
const WARM_UP_S: f64 = 5.0;
const AREA_A: f64 = 12.6e-4;
const AREA_B: f64 = 9.4e-4;
const STROKE: f64 = 0.2;
const MASS: f64 = 60.0;
const DEAD_M3: f64 = 5e-5;
const PRESSURE_SCALE_PA: f64 = 16e6;
/// L/min at 50 bar, in m³/(s·Pa).
const LEAK_UNIT: f64 = 1.0 / 60e3 / 50e5;
/// L/min at 35 bar over a fully open edge, in m³/(s·√Pa).
const EDGE_UNIT: f64 = 1.0 / 60e3 / 1_870.828_693_386_970_7;

/// The valve as it is.
#[derive(Clone, Copy, Debug)]
pub struct TrueValve {
    /// Of a fully open edge at 35 bar, L/min.
    pub rated_lpm: f64,
    /// Of the edges P–A, A–T, P–B, B–T, beside the rated one.
    pub gains: [f64; 4],
    /// Their overlap, shares of the stroke.
    pub laps: [f64; 4],
    /// By how much each corner is rounded off, a share of the stroke.
    pub rounding: f64,
    /// What a full opening lacks.
    pub saturation: f64,
    /// What passes their clearances at 50 bar, L/min.
    pub clearances_lpm: [f64; 4],
    /// Half width of the hysteresis between the spool as read and as it is, a share of the stroke.
    pub hysteresis: f64,
    /// The share of the reading's motion that the spool follows within it: none of a backlash.
    pub hysteresis_follows: f64,
    /// The spool's zero walks off by this in the whole trace.
    pub null_drift: f64,
    /// By how much the spool's reading is late, s.
    pub spool_lag_s: f64,
    /// Resistance between the supply's sensor and the valve: drop at 10 L/min, Pa.
    pub droop_pa: f64,
    /// Of the tank.
    pub tank_pa: f64,
}

/// A windy stretch of a pitch cylinder without flow meters.
#[derive(Clone, Copy, Debug)]
pub struct ValveCylinder {
    /// Between supply and cylinder.
    pub valve: TrueValve,
    /// Of its oil, Pa.
    pub bulk_pa: f64,
    /// Internal, out of A, out of B, at 50 bar, L/min.
    pub leaks_lpm: [f64; 3],
    /// The first leaks set in at this time, s.
    pub leaks_from_s: f64,
    /// … at once, or grow steadily until this time, s.
    pub leaks_until_s: f64,
    /// How windy it is: 1 is 13 m/s.
    pub wind: f64,
    /// Dry friction, N.
    pub dry_n: f64,
    /// Pressure of A is read so late, s.
    pub pressure_lag_s: f64,
    /// An accumulator at A: what it takes, m³/Pa.
    pub accumulator_m3pa: f64,
    /// Noise that goes on from reading to reading by 0.95, beside the white one, in that one's size.
    pub slow_noise: f64,
    /// The command is recorded instead of the spool's position.
    pub by_command: bool,
    /// Of motion, load and noise.
    pub seed: u64,
}

impl TrueValve {
    /// A servovalve of 4 L/min as its data sheet says.
    pub fn nominal() -> Self {
        Self {
            rated_lpm: 4.0,
            gains: [1.0; 4],
            laps: [0.0; 4],
            rounding: 0.02,
            saturation: 0.0,
            clearances_lpm: [0.0; 4],
            hysteresis: 0.0,
            hysteresis_follows: 0.0,
            null_drift: 0.0,
            spool_lag_s: 0.0,
            droop_pa: 0.0,
            tank_pa: 2e5,
        }
    }

    /// A valve as one of this type may be: gains ± 10 %, laps ± 1 %, clearances none or more.
    pub fn drawn(seed: u64) -> Self {
        let mut normal = white_noise(50_000 + seed);
        let mut four = |scale: f64| [(); 4].map(|()| scale * normal.next().unwrap_or(0.0).clamp(-2.5, 2.5));
        let mut valve = Self::nominal();
        valve.gains = four(0.1).map(|off| 1.0 + off);
        valve.laps = four(0.01);
        // 1 % of the rated flow at 35 bar, brought to 50 bar.
        valve.clearances_lpm = four(0.04 * 50.0 / 35.0).map(f64::abs);
        let [rounding, saturation, ..] = four(1.0);
        valve.rounding = 0.02 + 0.006 * rounding;
        valve.saturation = 0.04 * saturation;
        valve
    }

    fn opening(&self, s: f64, u: f64) -> f64 {
        0.5 * ((s * s + self.rounding * self.rounding).sqrt() + s) * (1.0 - self.saturation * u * u)
    }

    /// Into A and into B, m³/s.
    fn flows(&self, u: f64, pa: f64, pb: f64, ps: f64) -> [f64; 2] {
        let root = |drop: f64| drop / (drop * drop + 1e8).sqrt().sqrt();
        let edge = |i: usize, spool: f64, drop: f64| {
            let gain = self.rated_lpm * EDGE_UNIT * self.gains[i];
            gain * self.opening(spool - self.laps[i], u) * root(drop)
                + self.clearances_lpm[i] * LEAK_UNIT * drop
        };
        [
            edge(0, u, ps - pa) - edge(1, -u, pa - self.tank_pa),
            edge(2, -u, ps - pb) - edge(3, u, pb - self.tank_pa),
        ]
    }
}

impl ValveCylinder {
    /// A cylinder of this seed, its valve drawn, its oil as a rig file of 0.8 ± 0.2 GPa allows.
    pub fn drawn(seed: u64) -> Self {
        let off = white_noise(60_000 + seed).find(|off| off.abs() < 2.5).unwrap_or(0.0);
        Self {
            valve: TrueValve::drawn(seed),
            bulk_pa: 0.8e9 / (1.0 + 0.25 * off),
            leaks_lpm: [0.0; 3],
            leaks_from_s: f64::NEG_INFINITY,
            leaks_until_s: f64::NEG_INFINITY,
            wind: 1.0,
            dry_n: 100.0,
            pressure_lag_s: 0.0,
            accumulator_m3pa: 0.0,
            slow_noise: 0.0,
            by_command: false,
            seed,
        }
    }

    /// The same with one leak: 0 internal, 1 out of A, 2 out of B; L/min at 50 bar.
    pub fn leaking(mut self, leak: usize, lpm: f64) -> Self {
        self.leaks_lpm[leak] = lpm;
        self
    }

    /// A trace of so many seconds at `rate_hz` as CSV, with white noise of 3 σ = `accuracy` of full scale.
    pub fn trace(&self, seconds: f64, rate_hz: f64, accuracy: f64) -> String {
        let mut run = Run::new(self);
        let mut normal = white_noise(self.seed);
        let mut noise = |scale: f64| normal.next().unwrap_or(0.0) * scale * accuracy / 3.0;
        let mut slow = SlowNoise::new(self.slow_noise * accuracy / 3.0, self.seed);
        let spool = if self.by_command { "valve_command_percent" } else { "spool_percent" };
        let mut text = format!("t_s,x_mm,pa_bar,pb_bar,{spool},ps_bar\n");
        let every = (STEPS_HZ / rate_hz).round() as i64;
        let warm_up = (WARM_UP_S * STEPS_HZ) as i64;
        for k in -warm_up..(seconds * STEPS_HZ).round() as i64 {
            if k >= 0 && k % every == 0 {
                let read = slow.beside(run.readings(k as f64 / STEPS_HZ, seconds));
                let spool_noise = if self.by_command { 0.0 } else { noise(1.0) };
                let _ = writeln!(
                    text,
                    "{:.5},{:.6},{:.6},{:.6},{:.6},{:.6}",
                    k as f64 / STEPS_HZ,
                    1e3 * (read[0] + noise(STROKE)),
                    1e-5 * (read[1] + noise(PRESSURE_SCALE_PA)),
                    1e-5 * (read[2] + noise(PRESSURE_SCALE_PA)),
                    1e2 * (read[3] + spool_noise),
                    1e-5 * (read[4] + noise(PRESSURE_SCALE_PA))
                );
            }
            run.step(k as f64 / STEPS_HZ);
        }
        text
    }
}

/// Noise of position, pressures, spool and supply that is kept from reading to reading.
struct SlowNoise {
    size: f64,
    at: [f64; 5],
    normal: Box<dyn Iterator<Item = f64>>,
}

impl SlowNoise {
    const KEPT: f64 = 0.95;

    fn new(size: f64, seed: u64) -> Self {
        Self { size, at: [0.0; 5], normal: Box::new(white_noise(900_000 + seed)) }
    }

    fn beside(&mut self, read: [f64; 5]) -> [f64; 5] {
        let fresh = (1.0 - Self::KEPT * Self::KEPT).sqrt();
        for at in &mut self.at {
            *at = Self::KEPT * *at + fresh * self.normal.next().unwrap_or(0.0);
        }
        let scales = [STROKE, PRESSURE_SCALE_PA, PRESSURE_SCALE_PA, 1.0, PRESSURE_SCALE_PA];
        std::array::from_fn(|i| read[i] + self.size * scales[i] * self.at[i])
    }
}

/// x, v, P_A, P_B, u, u̇.
type State = [f64; 6];

struct Run<'a> {
    of: &'a ValveCylinder,
    at: State,
    position: Vec<Wave>,
    load: Vec<Wave>,
    command: f64,
    integral: f64,
    supply_pa: f64,
    charges: bool,
    drawn_m3s: f64,
    shown_pa: f64,
    /// Where a backlash of the hysteresis stands.
    inner: f64,
    spools: Vec<f64>,
}

/// A sine that is turned by half a step at a time: two products instead of a sine.
struct Wave {
    amplitude: f64,
    rad_ps: f64,
    /// Cosine and sine of its phase now, and of half a step.
    phase: [f64; 2],
    half_step: [f64; 2],
}

impl Wave {
    fn new(amplitude: f64, hz: f64, phase: f64) -> Self {
        let rad_ps = TAU * hz;
        let pair = |angle: f64| [angle.cos(), angle.sin()];
        let begin = rad_ps * -WARM_UP_S + phase;
        Self { amplitude, rad_ps, phase: pair(begin), half_step: pair(0.5 * rad_ps / STEPS_HZ) }
    }

    fn turn(&mut self) {
        let ([c, s], [by_c, by_s]) = (self.phase, self.half_step);
        self.phase = [c * by_c - s * by_s, s * by_c + c * by_s];
    }
}

fn sum(waves: &[Wave]) -> f64 {
    waves.iter().map(|wave| wave.amplitude * wave.phase[1]).sum()
}

fn slope(waves: &[Wave]) -> f64 {
    waves.iter().map(|wave| wave.amplitude * wave.rad_ps * wave.phase[0]).sum()
}

impl<'a> Run<'a> {
    fn new(of: &'a ValveCylinder) -> Self {
        let mut normal = white_noise(70_000 + of.seed);
        let mut lines = |scale: f64, bands: &[[f64; 2]]| {
            bands
                .iter()
                .map(|[amplitude, hz]| {
                    let [a, f, p] = [(); 3].map(|()| normal.next().unwrap_or(0.0).clamp(-2.0, 2.0));
                    Wave::new(scale * amplitude * (1.0 + 0.3 * a), hz * (1.0 + 0.1 * f), 3.0 * p)
                })
                .collect::<Vec<_>>()
        };
        let position =
            lines(of.wind, &[[0.012, 0.05], [0.008, 0.11], [0.004, 0.23], [0.002, 0.4], [0.0007, 0.9]]);
        let load = lines(
            of.wind.sqrt(),
            &[[700.0, 0.04], [500.0, 0.13], [400.0, 0.31], [300.0, 0.6], [200.0, 1.3], [80.0, 2.9]],
        );
        Self {
            of,
            at: [0.1, 0.0, 55e5, 45e5, 0.0, 0.0],
            position,
            load,
            command: 0.0,
            integral: 0.0,
            supply_pa: 100e5,
            charges: false,
            drawn_m3s: 0.0,
            shown_pa: 55e5,
            inner: 0.0,
            spools: Vec::new(),
        }
    }

    /// The spool's opening: the reading less its play and what its zero drifted by.
    fn true_spool(&self, u: f64) -> f64 {
        let follows = self.of.valve.hysteresis_follows;
        follows * u + (1.0 - follows) * self.backlash(u)
    }

    fn backlash(&self, u: f64) -> f64 {
        let width = self.of.valve.hysteresis / (1.0 - self.of.valve.hysteresis_follows);
        if width > 0.0 { self.inner.clamp(u - width, u + width) } else { u }
    }

    fn load_n(&self) -> f64 {
        2500.0 + sum(&self.load)
    }

    /// Motion and load half a step on.
    fn turn(&mut self) {
        self.position.iter_mut().chain(&mut self.load).for_each(Wave::turn);
    }

    fn rates(&self, t: f64, load_n: f64, at: &State) -> State {
        let [x, v, pa, pb, u, du] = *at;
        let of = self.of;
        let grows_s = of.leaks_until_s - of.leaks_from_s;
        let share = if grows_s > 0.0 { ((t - of.leaks_from_s) / grows_s).clamp(0.0, 1.0) } else { 1.0 };
        let share = if t >= of.leaks_from_s { share } else { 0.0 };
        let [internal, a, b] = of.leaks_lpm.map(|lpm| share * lpm * LEAK_UNIT);
        let ps = self.supply_pa - of.valve.droop_pa * self.drawn_m3s * 6e3;
        let [qa, qb] = of.valve.flows(self.true_spool(u), pa, pb, ps);
        let through = internal * (pa - pb);
        let friction = of.dry_n * v / (v * v + 1e-8).sqrt() + 2e3 * v;
        let omega = TAU * 60.0;
        [
            v,
            (pa * AREA_A - pb * AREA_B - load_n - friction) / MASS,
            (qa - AREA_A * v - through - a * pa)
                / ((AREA_A * x + DEAD_M3) / of.bulk_pa + of.accumulator_m3pa),
            (qb + AREA_B * v + through - b * pb) / ((AREA_B * (STROKE - x) + DEAD_M3) / of.bulk_pa),
            du,
            omega * (omega * (self.command - u) - 1.4 * du),
        ]
    }

    fn step(&mut self, t: f64) {
        let h = 1.0 / STEPS_HZ;
        let target = 0.1 + sum(&self.position);
        let error = target - self.at[0];
        self.integral = (self.integral + 10.0 * h * error).clamp(-0.02, 0.02);
        let feed = slope(&self.position) * AREA_A * 60e3 / self.of.valve.rated_lpm;
        self.command = (feed + 12.0 * error + 12.0 * self.integral).clamp(-1.0, 1.0);
        let begin_n = self.load_n();
        self.turn();
        let middle_n = self.load_n();
        self.turn();
        let end_n = self.load_n();
        let plus = |rate: &State, part: f64| std::array::from_fn(|i| self.at[i] + part * h * rate[i]);
        let k1 = self.rates(t, begin_n, &self.at);
        let k2 = self.rates(t + h / 2.0, middle_n, &plus(&k1, 0.5));
        let k3 = self.rates(t + h / 2.0, middle_n, &plus(&k2, 0.5));
        let k4 = self.rates(t + h, end_n, &plus(&k3, 1.0));
        self.at = std::array::from_fn(|i| self.at[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        self.inner = self.backlash(self.at[4]);
        let [_, _, pa, pb, ..] = self.at;
        let [qa, qb] = self.of.valve.flows(self.true_spool(self.at[4]), pa, pb, self.supply_pa);
        self.drawn_m3s = qa.max(0.0) + qb.max(0.0);
        // A saw-tooth between 95 and 105 bar, with the pump's ripple.
        self.charges = if self.supply_pa < 95e5 { true } else { self.charges && self.supply_pa < 105e5 };
        let pump = if self.charges { 6.0 / 60e3 } else { 0.0 };
        self.supply_pa += h * (pump - self.drawn_m3s - 0.3 / 60e3) / 4e-11;
        let late_s = self.of.pressure_lag_s;
        self.shown_pa = if late_s > 0.0 { self.shown_pa + h / late_s * (pa - self.shown_pa) } else { pa };
        self.spools.push(self.at[4]);
    }

    fn readings(&self, t: f64, seconds: f64) -> [f64; 5] {
        let [x, _, _, pb, ..] = self.at;
        let valve = &self.of.valve;
        let late = (valve.spool_lag_s * STEPS_HZ).round() as usize;
        let u = self.spools[self.spools.len() - 1 - late];
        let shown = if self.of.by_command { self.command } else { u };
        [x, self.shown_pa, pb, shown + valve.null_drift * t / seconds, self.supply_pa]
    }
}
