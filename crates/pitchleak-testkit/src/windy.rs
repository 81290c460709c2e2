//! A minute of the paper's rig in turbulent wind, as its sensors read it.

use pitchleak::Rig;
use pitchleak::core::{Leak, PerLeak, Sample};
use pitchleak::simulate::{Biases, LeakCourse, LeakSize, Scenario, Sensing};
use pitchleak::units::LPM_PER_M3S;
use pitchleak::wind::{Emulation, History, Wind, WindCase};

/// Times, s, and readings at 100 Hz, with a leak of this mean flow, L/min, where there is one.
///
/// # Panics
/// Where the built-in wind can't be followed: never.
pub fn minute(wind: WindCase, leak: Option<(Leak, f64)>, seed: u64) -> Vec<(f64, Sample<f64>)> {
    let rig = Rig::paper();
    let history = History::of(&Wind::BuiltIn(wind)).expect("is built in");
    let size_lpm = |which| leak.filter(|(leak, _)| *leak == which).map_or(0.0, |(_, size_lpm)| size_lpm);
    let size = |which| LeakCourse::from(LeakSize::MeanFlow(size_lpm(which) / LPM_PER_M3S));
    let mut sensing = Sensing::new(rig.sensors(), Biases::default(), seed);
    let reference = Emulation::paper().reference(&history, rig.cylinder.stroke_m).expect("fits the rig");
    let scenario = Scenario { leaks: PerLeak::from_fn(size), ..Scenario::new(rig, reference) };
    let truths = scenario.collect(scenario.leak_coefficients().expect("within reach")).expect("runs");
    truths.iter().map(|truth| (truth.t_s, sensing.read(&truth.sample))).collect()
}
