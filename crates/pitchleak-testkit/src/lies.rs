//! The bench of lies: what sensors, wires and recorders do to an honest trace, and the truth under it: a cylinder that does what
//! the estimator's model leaves out, each as much as a sound rig has it.

#![allow(missing_docs, reason = "cells of the bench's own tables")]

pub mod judge;
pub mod on_its_way;

use pitchleak::Rig;
use pitchleak::core::effects::EffectConstants;
use pitchleak::core::{Effect, EffectSet, Leak, PerLeak};
use pitchleak::simulate::{LeakCourse, LeakSize, Scenario, Truth};
use pitchleak::units::LPM_PER_M3S;
use pitchleak::wind::{Emulation, History, Wind, WindCase};

/// How a trace with a lie has to be judged.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Family {
    /// Nothing is wrong: right and sure.
    Honest,
    /// Something else than usual, but no reason to be unsure: right and sure.
    Harmless,
    /// A meter's zero is off and nobody said so: right or in doubt.
    Offset,
    /// A mistake: right or in doubt.
    Mistake,
}

impl Family {
    pub const ALL: [Self; 4] = [Self::Honest, Self::Harmless, Self::Offset, Self::Mistake];

    pub fn name(self) -> &'static str {
        match self {
            Self::Honest => "honest",
            Self::Harmless => "harmless",
            Self::Offset => "offset",
            Self::Mistake => "mistake",
        }
    }
}

/// One lie.
#[derive(Clone, Copy, Debug)]
pub struct Lie {
    pub family: Family,
    pub name: &'static str,
    /// As `pitchleak simulate --fault` takes them.
    pub faults: &'static [&'static str],
    /// One of so many rows is recorded.
    pub every: usize,
    /// Id of the reason that names it, and words of the reason's text, one of several between bars; or `explanation` and part of
    /// the id of the likeliest.
    pub named: Option<[&'static str; 2]>,
}

const fn lie(family: Family, name: &'static str, faults: &'static [&'static str]) -> Lie {
    Lie { family, name, faults, every: 1, named: None }
}

const fn mistake(
    name: &'static str,
    faults: &'static [&'static str],
    id: &'static str,
    words: &'static str,
) -> Lie {
    Lie { named: Some([id, words]), ..lie(Family::Mistake, name, faults) }
}

const fn harmless(name: &'static str, faults: &'static [&'static str]) -> Lie {
    lie(Family::Harmless, name, faults)
}

const fn offset(name: &'static str, faults: &'static [&'static str]) -> Lie {
    lie(Family::Offset, name, faults)
}

/// Every lie of the bench; a trace lasts 60 s.
pub const LIES: &[Lie] = &[
    lie(Family::Honest, "nothing", &[]),
    harmless("no force column", &["force missing"]),
    Lie { every: 5, ..harmless("20 Hz", &[]) },
    harmless("rows lost", &["rows lost 5 %"]),
    harmless("spikes", &["pa spikes 0.1 %", "qa spikes 0.1 %"]),
    harmless("a gap", &["rows lost 20 s..25 s"]),
    harmless("absolute pressure", &["pa offset 1.01325 bar", "pb offset 1.01325 bar"]),
    harmless("half the length", &["rows lost 30 s.."]),
    offset("qa +0.5 %", &["qa offset 0.5 %"]),
    offset("qa +1 %", &["qa offset 1 %"]),
    offset("qa +2 %", &["qa offset 2 %"]),
    offset("qa -1 %", &["qa offset -1 %"]),
    offset("qb +0.5 %", &["qb offset 0.5 %"]),
    offset("qb +1 %", &["qb offset 1 %"]),
    offset("qb +2 %", &["qb offset 2 %"]),
    mistake("qa dead", &["qa dead"], "channel_dead", "qa reads"),
    mistake("qb dead", &["qb dead"], "channel_dead", "qb reads"),
    mistake("pa dead", &["pa dead"], "channel_dead", "pa reads"),
    mistake("pb dead", &["pb dead"], "channel_dead", "pb reads"),
    mistake("x dead", &["x dead"], "channel_dead", "x reads"),
    mistake("qa stuck", &["qa stuck"], "channel_dead", "qa reads"),
    mistake("qb stuck", &["qb stuck"], "channel_dead", "qb reads"),
    mistake("pa stuck", &["pa stuck"], "channel_dead", "pa reads"),
    mistake("pb stuck", &["pb stuck"], "channel_dead", "pb reads"),
    mistake("x stuck", &["x stuck"], "channel_dead", "x reads"),
    mistake("qa half stuck", &["qa stuck 30 s.."], "channel_stuck", "qa reads"),
    mistake("pa half stuck", &["pa stuck 30 s.."], "channel_stuck", "pa reads"),
    mistake("x half stuck", &["x stuck 30 s.."], "channel_stuck", "x reads"),
    mistake("qa and qb swapped", &["swap qa qb"], "wiring", "qa and qb exchanged|qa and qb are exchanged"),
    mistake("pa and pb swapped", &["swap pa pb"], "wiring", "pa and pb exchanged|pa and pb are exchanged"),
    mistake(
        "all of A and B swapped",
        &["swap qa qb", "swap pa pb"],
        "wiring",
        "(A and B)|A and B are exchanged",
    ),
    mistake("qa wrong sign", &["qa reversed"], "wiring", "sign of qa turned|qa counts the other way"),
    mistake("qb wrong sign", &["qb reversed"], "wiring", "sign of qb turned|qb counts the other way"),
    mistake(
        "both flows wrong sign",
        &["qa reversed", "qb reversed"],
        "wiring",
        "sign of qa and qb turned|qa and qb count the other way",
    ),
    mistake(
        "qa without sign",
        &["qa absolute"],
        "wiring",
        "sign that qa lost|qa counts the other way, or lost its sign",
    ),
    mistake(
        "qb without sign",
        &["qb absolute"],
        "wiring",
        "sign that qb lost|qb counts the other way, or lost its sign",
    ),
    mistake(
        "both flows without sign",
        &["qa absolute", "qb absolute"],
        "wiring",
        "sign that qa and qb lost|lost its sign|lost their signs",
    ),
    mistake("x from the other end", &["x other_end"], "wiring", "other end|x counts from the B end"),
    mistake("pa in psi", &["pa in psi"], "wiring", "pa divided by 14.5|pa is in another unit: 14.5"),
    mistake(
        "both pressures in psi",
        &["pa in psi", "pb in psi"],
        "wiring",
        "pa and pb divided by 14.5|pa and pb are in another unit: 14.5",
    ),
    mistake(
        "both pressures times 10",
        &["pa times 10", "pb times 10"],
        "wiring",
        "pa and pb divided by 10|pa and pb are in another unit: 10 times too large",
    ),
    mistake(
        "qa in m3/h",
        &["qa in m3/h"],
        "wiring",
        "qa times 16.66|qa is in another unit: 16.67 times too small",
    ),
    mistake(
        "both flows in m3/h",
        &["qa in m3/h", "qb in m3/h"],
        "wiring",
        "qa and qb times 16.66|qa and qb are in another unit: 16.67 times too small",
    ),
    mistake("qa in gal/min", &["qa in gal/min"], "wiring", "qa times 3.785|qa is in another unit: 3.79"),
    mistake(
        "both flows in gal/min",
        &["qa in gal/min", "qb in gal/min"],
        "wiring",
        "qa and qb times 3.785|qa and qb are in another unit: 3.79",
    ),
    mistake(
        "both flows times 10",
        &["qa times 10", "qb times 10"],
        "wiring",
        "qa and qb divided by 10|qa and qb are in another unit: 10 times too large",
    ),
    mistake("x in cm", &["x in cm"], "wiring", "x times"),
    mistake("t in ms", &["t in ms"], "wiring", "t "),
    mistake("flows 100 ms late", &["qa late 100 ms", "qb late 100 ms"], "wiring", "qa and qb moved"),
    mistake("pressures 100 ms late", &["pa late 100 ms", "pb late 100 ms"], "wiring", "pa and pb moved"),
    mistake("x 100 ms late", &["x late 100 ms"], "wiring", "x moved"),
    mistake("qa clipped", &["qa clipped 1 L/min"], "channel_clipped", "qa reads"),
    mistake("pa clipped", &["pa clipped 40 bar"], "channel_clipped", "pa reads"),
    mistake("qa held", &["qa held 500 ms"], "channel_held", "qa repeats"),
    mistake("x held", &["x held 500 ms"], "channel_held", "x repeats"),
    mistake("qa 20 % gain", &["qa gain 20 %"], "wiring", "qa divided by"),
    mistake("qb 20 % gain", &["qb gain 20 %"], "wiring", "qb divided by"),
    mistake("pa 10 bar zero", &["pa offset 10 bar"], "explanation", "pressure_zero"),
    mistake("pb 10 bar zero", &["pb offset 10 bar"], "explanation", "pressure_zero"),
];

const DURATION_S: f64 = 60.0;
/// When a leak opens that does so at once, s.
pub const OPENS_S: f64 = 30.0;
/// Size of a leak, L/min; the alarm stands at 0.1.
const LEAK_LPM: f64 = 0.5;
/// Of which about this passes an orifice: C √P, where the estimator has C P.
const TURBULENT_LPM: f64 = 0.1;
/// A leak is made this large at the beginning of the minute, s.
const SIZED_OVER_S: f64 = 15.0;
/// Every seal weeps, m³/(s·Pa): some 0.02 L/min, far below the alarm.
const WEEPING_M3SPA: f64 = 4.5e-13;
/// Free air in the oil at atmospheric pressure, by volume: the bulk modulus follows the pressure.
const FREE_AIR: f64 = 5e-3;
/// N.
const DRY_FRICTION_N: f64 = 100.0;
/// Roots of the mean pressures behind the leaks in wind, √Pa: turbulent coefficients follow from them.
const ROOT_PRESSURE: PerLeak<f64> = PerLeak { internal: 9e2, external_a: 2.4e3, external_b: 2.4e3 };

/// What leaks.
pub type Leaking = Option<Leak>;
pub const LEAKING: [Leaking; 3] = [None, Some(Leak::Internal), Some(Leak::ExternalA)];

pub fn leak_name(leaking: Leaking) -> &'static str {
    leaking.map_or("sound", Leak::id)
}

pub fn rig(accuracy: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.instruments = rig.instruments.with_accuracy(accuracy);
    rig
}

/// A minute of a cylinder in wind at 100 Hz; each sample is that of one instant of a simulation in steps of 1 ms.
pub fn truths(wind: WindCase, leaking: Leaking) -> Vec<Truth> {
    let laminar = |leak: Leak| match leak {
        _ if leaking == Some(leak) => LeakSize::MeanFlow((LEAK_LPM - TURBULENT_LPM) / LPM_PER_M3S),
        Leak::Internal => LeakSize::Coefficient(WEEPING_M3SPA),
        _ => LeakSize::default(),
    };
    let scenario = scenario(wind, PerLeak::from_fn(laminar).map(LeakCourse::from), effects(leaking));
    let beginning = Scenario { duration_s: SIZED_OVER_S, ..scenario.clone() };
    scenario.collect(beginning.leak_coefficients().expect("within reach")).expect("runs")
}

/// This cylinder with a leak of this mean flow that opens suddenly after half of the minute.
pub fn opening(wind: WindCase, leak: Leak, size_lpm: f64) -> Vec<Truth> {
    let size = |which| {
        let size = LeakSize::MeanFlow(if which == leak { size_lpm / LPM_PER_M3S } else { 0.0 });
        LeakCourse::from_onset(size, OPENS_S)
    };
    let scenario = scenario(wind, PerLeak::from_fn(size), effects(None));
    let open = Scenario { start_s: scenario.start_s + OPENS_S, ..scenario.clone() };
    scenario.collect(open.leak_coefficients().expect("within reach")).expect("runs")
}

fn scenario(wind: WindCase, leaks: PerLeak<LeakCourse>, effects: EffectSet<f64>) -> Scenario {
    let history = History::of(&Wind::BuiltIn(wind)).expect("is built in");
    let reference = Emulation::paper().reference(&history, 0.2).expect("fits the rig");
    Scenario { leaks, effects, start_s: 20.0, duration_s: DURATION_S, ..Scenario::new(rig(1e-2), reference) }
}

fn effects(leaking: Leaking) -> EffectSet<f64> {
    let turbulent = |leak: Leak, effect: Effect| {
        let flow_lpm = if leaking == Some(leak) { TURBULENT_LPM } else { 0.0 };
        (effect, flow_lpm / LPM_PER_M3S / ROOT_PRESSURE[leak])
    };
    let mut effects = EffectSet::default();
    for (effect, size) in [
        (Effect::EntrainedAir, FREE_AIR),
        (Effect::CoulombFriction, DRY_FRICTION_N),
        turbulent(Leak::Internal, Effect::InternalLeakTurbulent),
        turbulent(Leak::ExternalA, Effect::ExternalLeakATurbulent),
    ] {
        if size > 0.0 {
            effects.set(effect, size, EffectConstants::default()).expect("within bounds");
        }
    }
    effects
}
