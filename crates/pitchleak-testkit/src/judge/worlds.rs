//! The worlds: what machine, sensors, wires and recorder do, that data sheets don't say. One line each.

use pitchleak::core::PerLeak;

/// What may be told to be wrong.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Part {
    MeterA,
    MeterB,
    PressureA,
    PressureB,
    Position,
    /// Areas, stroke, volumes, oil: the numbers of the rig file.
    Rig,
}

/// How a leak goes over the trace.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Course {
    #[default]
    Steady,
    /// Grows from none.
    Ramp,
    /// Opens at half of the trace.
    Step,
    /// Closes at two thirds.
    Repaired,
    /// The first leak closes at half of the trace, where the second opens.
    InTurn,
    /// Open for 5 of 10 s.
    Pulses,
    /// ± 20 % in 10 s.
    Wobbles,
    /// Grows with the square of the time, from none.
    Quadratic,
}

/// How wires and units are wrong.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Wires {
    #[default]
    Right,
    FlowsExchanged,
    PressuresExchanged,
    BothExchanged,
    SignOfA,
    BothSigns,
    OtherEnd,
    TenfoldA,
    WithoutSign,
}

/// Everything that can be off; `default` is the declared rig with honest sensors. Pairs are those of chambers A and B.
#[derive(Clone, Debug)]
pub struct Ailment {
    // The machine.
    pub course: Course,
    /// Share of each leak that passes an orifice.
    pub orifice: f64,
    /// Share by which the internal leak follows the position.
    pub by_position: f64,
    /// A worn spot in the bore: the internal leak is there alone.
    pub spot: bool,
    /// The internal leak flows while extending only.
    pub one_way: bool,
    /// Leaks open above this drop, Pa.
    pub cracking: f64,
    /// Share by which all leaks grow as the oil warms.
    pub warming: f64,
    /// Free air by volume at the atmosphere's pressure.
    pub air: f64,
    /// Factor on the bulk modulus.
    pub bulk: f64,
    /// Factors on the areas, and on the stroke.
    pub areas: [f64; 2],
    pub stroke: f64,
    /// m³, of the paper's size.
    pub dead: [f64; 2],
    /// Pa.
    pub supply_swing: f64,
    /// N, of the paper's size.
    pub dry: f64,
    // Meters; zeros, drifts and bands in full scales, times in s.
    pub zeros: [f64; 2],
    pub drifts: [f64; 2],
    pub gains: [f64; 2],
    /// Share that is missing at full scale.
    pub curved: f64,
    pub lags: [f64; 2],
    pub delays: [f64; 2],
    /// Mean over this time.
    pub averaged: f64,
    /// Flows are repeated in between, as a controller does that asks the meters so often.
    pub held_hz: Option<f64>,
    /// How late both are at the end, if they are not at the begin.
    pub clock: f64,
    /// Meter A's zero jumps at 40 % of the trace, and sways in 20 s.
    pub jump: f64,
    pub sway: f64,
    /// Meter A's gain is so much larger for flow in, and smaller for flow out.
    pub by_direction: f64,
    /// Noise of both meters, in shares of the flow.
    pub turbulent: f64,
    /// Both meters have the same noise.
    pub common_noise: bool,
    pub dead_bands: [f64; 2],
    /// Counts of this many full scales; none where zero.
    pub cut: f64,
    // Pressures: zeros in full scales, lags in s.
    pub pressure_zeros: [f64; 2],
    pub pressure_gains: [f64; 2],
    pub pressure_lags: [f64; 2],
    /// P_A reads no more than this, in full scales.
    pub pressure_limit: f64,
    /// Both zeros at the end of the trace, in full scales.
    pub pressure_drift: f64,
    // Position.
    pub position_gain: f64,
    pub position_zero: f64,
    /// Off by as much at a quarter of the stroke, and the other way at three quarters; in strokes.
    pub bent: f64,
    pub backlash: f64,
    // All channels.
    pub noise: f64,
    /// Of successive samples.
    pub correlation: f64,
    /// In full scales of flows and pressures, at about 50 Hz.
    pub hum: f64,
    /// Share of readings that are three times as noisy.
    pub outliers: f64,
    pub bits: Option<u32>,
    // Recorder.
    pub wires: Wires,
    pub rate_hz: f64,
    /// Flows of a slower clock of their own.
    pub flow_rate_hz: Option<f64>,
    /// Of the recorded time, s.
    pub jitter: f64,
    /// Share of rows that are lost.
    pub lost: f64,
    /// All rows of 2 s in 20 s are lost.
    pub gaps: bool,
}

impl Default for Ailment {
    fn default() -> Self {
        Self {
            course: Course::Steady,
            orifice: 0.0,
            by_position: 0.0,
            spot: false,
            one_way: false,
            cracking: 0.0,
            warming: 0.0,
            air: 0.0,
            bulk: 1.0,
            areas: [1.0; 2],
            stroke: 1.0,
            dead: [0.0; 2],
            supply_swing: 0.0,
            dry: 20.0,
            zeros: [0.0; 2],
            drifts: [0.0; 2],
            gains: [0.0; 2],
            curved: 0.0,
            lags: [0.0; 2],
            delays: [0.0; 2],
            averaged: 0.0,
            held_hz: None,
            clock: 0.0,
            jump: 0.0,
            sway: 0.0,
            by_direction: 0.0,
            turbulent: 0.0,
            common_noise: false,
            dead_bands: [0.0; 2],
            cut: 0.0,
            pressure_zeros: [0.0; 2],
            pressure_gains: [0.0; 2],
            pressure_lags: [0.0; 2],
            pressure_limit: f64::INFINITY,
            pressure_drift: 0.0,
            position_gain: 0.0,
            position_zero: 0.0,
            bent: 0.0,
            backlash: 0.0,
            noise: 1.0,
            correlation: 0.0,
            hum: 0.0,
            outliers: 0.0,
            bits: None,
            wires: Wires::Right,
            rate_hz: 100.0,
            flow_rate_hz: None,
            jitter: 0.0,
            lost: 0.0,
            gaps: false,
        }
    }
}

impl Ailment {
    /// Share of each leak that is open, and its growth as the oil warms.
    pub fn courses(&self, t: f64, seconds: f64) -> PerLeak<f64> {
        let share = (t / seconds).clamp(0.0, 1.0);
        let when = |open: bool| if open { 1.0 } else { 0.0 };
        let of = |share: f64| PerLeak { internal: share, external_a: share, external_b: share };
        let open = match self.course {
            Course::Steady => of(1.0),
            Course::Ramp => of(share),
            Course::Quadratic => of(share * share),
            Course::Step => of(when(share >= 0.5)),
            Course::Repaired => of(when(share < 2.0 / 3.0)),
            Course::InTurn => PerLeak {
                internal: when(share < 0.5),
                external_a: when(share >= 0.5),
                external_b: when(share >= 0.5),
            },
            Course::Pulses => of(when(t.rem_euclid(10.0) < 5.0)),
            Course::Wobbles => of(1.0 + 0.2 * (std::f64::consts::TAU * 0.1 * t).sin()),
        };
        open.map(|open| open * (1.0 + self.warming * share))
    }
}

/// A world.
pub struct World {
    pub name: &'static str,
    /// The posterior was not built on it.
    pub held_out: bool,
    /// What may rightly be told to be wrong.
    pub at_fault: &'static [Part],
    pub make: fn(&mut Ailment),
}

impl World {
    pub fn ailment(&self) -> Ailment {
        let mut ailment = Ailment::default();
        (self.make)(&mut ailment);
        ailment
    }
}

use Part::{MeterA, MeterB, Position, PressureA, PressureB, Rig};

const METERS: &[Part] = &[MeterA, MeterB];
const PRESSURES: &[Part] = &[PressureA, PressureB];
const SENSORS: &[Part] = &[MeterA, MeterB, PressureA, PressureB, Position];

const fn world(name: &'static str, at_fault: &'static [Part], make: fn(&mut Ailment)) -> World {
    World { name, held_out: false, at_fault, make }
}

const fn held_out(name: &'static str, at_fault: &'static [Part], make: fn(&mut Ailment)) -> World {
    World { held_out: true, ..world(name, at_fault, make) }
}

/// Every world of the judge.
pub const WORLDS: &[World] = &[
    world("honest", &[], |_| ()),
    world("zero 0.2 %, A", &[MeterA], |a| a.zeros[0] = 2e-3),
    world("zero -0.3 %, B", &[MeterB], |a| a.zeros[1] = -3e-3),
    world("zeros 0.3 %, both", METERS, |a| a.zeros = [3e-3; 2]),
    world("zero 1 %, A", &[MeterA], |a| a.zeros[0] = 1e-2),
    world("zero -1 %, B", &[MeterB], |a| a.zeros[1] = -1e-2),
    world("zero drifts 0.3 %, A", &[MeterA], |a| a.drifts[0] = 3e-3),
    world("zero drifts 1 %, A", &[MeterA], |a| a.drifts[0] = 1e-2),
    world("lag 20 ms", METERS, |a| a.lags = [0.02; 2]),
    world("lag 50 ms", METERS, |a| a.lags = [0.05; 2]),
    world("lag 100 ms", METERS, |a| a.lags = [0.1; 2]),
    world("lag 500 ms", METERS, |a| a.lags = [0.5; 2]),
    world("lag 100 ms, A", &[MeterA], |a| a.lags[0] = 0.1),
    world("lag 50 ms, B", &[MeterB], |a| a.lags[1] = 0.05),
    world("noise x 1.5", SENSORS, |a| a.noise = 1.5),
    world("noise x 0.5", &[], |a| a.noise = 0.5),
    world("AR 0.9", SENSORS, |a| a.correlation = 0.9),
    world("AR 0.99", SENSORS, |a| a.correlation = 0.99),
    world("hum 0.2 %", SENSORS, |a| a.hum = 2e-3),
    world("hum 1 %", SENSORS, |a| a.hum = 1e-2),
    world("dead band 0.5 %", METERS, |a| a.dead_bands = [5e-3; 2]),
    world("dead band 2 %", METERS, |a| a.dead_bands = [2e-2; 2]),
    world("12 bit", &[], |a| a.bits = Some(12)),
    world("curved 2 %", METERS, |a| a.curved = 2e-2),
    world("gains +1, -1 %", METERS, |a| a.gains = [1e-2, -1e-2]),
    world("P_B gain 2 %", &[PressureB], |a| a.pressure_gains[1] = 2e-2),
    world("P_B zero 1 %", &[PressureB], |a| a.pressure_zeros[1] = 1e-2),
    world("P_A zero -1 %", &[PressureA], |a| a.pressure_zeros[0] = -1e-2),
    world("P_A zero 5 bar", &[PressureA], |a| a.pressure_zeros[0] = 5.0 / 160.0),
    world("area A +5 %", &[Rig], |a| a.areas[0] = 1.05),
    world("area B -5 %", &[Rig], |a| a.areas[1] = 0.95),
    world("stroke +3 %", &[Rig], |a| a.stroke = 1.03),
    world("dead volume A 50 cm3", &[Rig], |a| a.dead[0] = 5e-5),
    world("bulk modulus x 0.6", &[Rig], |a| a.bulk = 0.6),
    world("air 3 %", &[Rig], |a| a.air = 3e-2),
    world("orifice, half", &[], |a| a.orifice = 0.5),
    world("orifice, all", &[], |a| a.orifice = 1.0),
    world("ramp", &[], |a| a.course = Course::Ramp),
    world("step", &[], |a| a.course = Course::Step),
    world("repaired", &[], |a| a.course = Course::Repaired),
    world("two in turn", &[], |a| a.course = Course::InTurn),
    world("pulses", &[], |a| a.course = Course::Pulses),
    world("wobbles", &[], |a| a.course = Course::Wobbles),
    world("Q exchanged", METERS, |a| a.wires = Wires::FlowsExchanged),
    world("P exchanged", PRESSURES, |a| a.wires = Wires::PressuresExchanged),
    world("Q and P exchanged", SENSORS, |a| a.wires = Wires::BothExchanged),
    world("sign of Q_A", &[MeterA], |a| a.wires = Wires::SignOfA),
    world("signs of both Q", &[MeterA, MeterB, Position], |a| a.wires = Wires::BothSigns),
    world("x from the other end", &[MeterA, MeterB, Position], |a| a.wires = Wires::OtherEnd),
    world("Q_A x 10", &[MeterA], |a| a.wires = Wires::TenfoldA),
    world("|Q|", METERS, |a| a.wires = Wires::WithoutSign),
    world("leak follows x by 80 %", &[], |a| a.by_position = 0.8),
    world("supply +-15 bar", &[], |a| a.supply_swing = 1.5e6),
    world("stick-slip", &[], |a| a.dry = 400.0),
    world("10 Hz", &[], |a| a.rate_hz = 10.0),
    world("500 Hz", &[], |a| a.rate_hz = 500.0),
    world("1000 Hz", &[], |a| a.rate_hz = 1000.0),
    world("flows at 10 Hz", &[], |a| a.flow_rate_hz = Some(10.0)),
    held_out("flows averaged over 0.3 s", METERS, |a| a.averaged = 0.3),
    held_out("flows 50 ms late", METERS, |a| a.delays = [0.05; 2]),
    held_out("flow A 200 ms late", &[MeterA], |a| a.delays[0] = 0.2),
    held_out("clock jitters by 3 ms", &[], |a| a.jitter = 3e-3),
    held_out("oil warms, leaks +60 %", &[], |a| a.warming = 0.6),
    world("quadratic growth", &[], |a| a.course = Course::Quadratic),
    held_out("dead band 1 %, A", &[MeterA], |a| a.dead_bands[0] = 1e-2),
    held_out("meters cut off at 0.2 L/min", METERS, |a| a.dead_bands = [1e-2; 2]),
    held_out("P_A saturates at 60 bar", &[PressureA], |a| a.pressure_limit = 60.0 / 160.0),
    held_out("pressure zeros drift 1 %", PRESSURES, |a| a.pressure_drift = 1e-2),
    held_out("pressures 50 ms late", PRESSURES, |a| a.pressure_lags = [0.05; 2]),
    held_out("worn spot", &[], |a| a.spot = true),
    held_out("leak one way", &[], |a| a.one_way = true),
    held_out("leak above 10 bar", &[], |a| a.cracking = 1e6),
    held_out("x gain 2 %", &[Position, Rig], |a| a.position_gain = 2e-2),
    held_out("x zero 5 %", &[Position, Rig], |a| a.position_zero = 5e-2),
    held_out("backlash 0.5 %", &[Position], |a| a.backlash = 5e-3),
    held_out("pulses of 0.5 % of full scale", METERS, |a| a.cut = 5e-3),
    held_out("outliers, 1 % of noise x 10", SENSORS, |a| a.outliers = 1e-2),
    held_out("AR 0.5", SENSORS, |a| a.correlation = 0.5),
    held_out("rows lost 20 %", &[], |a| a.lost = 0.2),
    held_out("gaps of 2 s", &[], |a| a.gaps = true),
    held_out("zero 0.3 %, A, and lag 50 ms", METERS, |a| (a.zeros[0], a.lags) = (3e-3, [0.05; 2])),
    held_out("zeros +0.3, -0.3 %, noise x 1.5", SENSORS, |a| (a.zeros, a.noise) = ([3e-3, -3e-3], 1.5)),
    held_out("areas both +2 %", &[Rig, MeterA, MeterB, Position], |a| a.areas = [1.02; 2]),
    world("zero of A jumps 0.5 %", &[MeterA], |a| a.jump = 5e-3),
    held_out("zero of A sways 0.5 %", &[MeterA], |a| a.sway = 5e-3),
    world("gain of A by direction 2 %", &[MeterA], |a| a.by_direction = 2e-2),
    held_out("x bent 0.5 %", &[Position], |a| a.bent = 5e-3),
    held_out("flows held, 10 Hz", METERS, |a| a.held_hz = Some(10.0)),
    held_out("clocks 100 ms apart at the end", METERS, |a| a.clock = 0.1),
    held_out("noise 5 % of the flow", METERS, |a| a.turbulent = 5e-2),
    held_out("both meters' noise the same", METERS, |a| a.common_noise = true),
    held_out("lag 30 ms, A; 80 ms, B", METERS, |a| a.lags = [0.03, 0.08]),
    held_out("P_A 30 ms late", &[PressureA], |a| a.pressure_lags[0] = 0.03),
    held_out("dead volumes 100 cm3", &[Rig], |a| a.dead = [1e-4; 2]),
];
