//! The truth: a cylinder that does what the estimator's model leaves out, each as much as a sound rig has it.

use pitchleak::Rig;
use pitchleak::core::effects::EffectConstants;
use pitchleak::core::{Effect, EffectSet, Leak, PerLeak};
use pitchleak::simulate::{LeakCourse, LeakSize, Scenario, Truth};
use pitchleak::units::LPM_PER_M3S;
use pitchleak::wind::{Emulation, History, Wind, WindCase};

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

/// The same cylinder, of which a leak of this mean flow opens at once after half of the minute.
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
    Scenario {
        rig: rig(1e-2),
        reference: Emulation::paper().reference(&history, 0.2).expect("fits the rig"),
        leaks,
        oil_temperature: None,
        effects,
        start_s: 20.0,
        warm_up_s: 10.0,
        duration_s: DURATION_S,
        sample_rate_hz: 100.0,
    }
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
