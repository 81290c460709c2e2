//! Warming oil makes a leak grow; a worn seal does too. With the oil's temperature the two are told apart.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::core::PerLeak;
use pitchleak::replay::Replay;
use pitchleak::report::{LeakTrend, TraceSummary};
use pitchleak::simulate::{Biases, LeakCourse, OilTemperature, Scenario, Sensing};
use pitchleak::trace::{Record, TraceQuality};
use pitchleak::wind::{Emulation, History, Wind, WindCase};

const DURATION_S: f64 = 240.0;
/// About half a litre per minute past the piston.
const INTERNAL_M3SPA: f64 = 1e-11;

/// Trend of the internal leak after a replay; `grows` from nothing to its size, at an oil temperature as `simulate` takes it.
fn trend(grows: bool, oil: &str, shown: bool) -> LeakTrend {
    let mut rig = Rig::paper();
    rig.instruments = rig.instruments.with_accuracy(3e-3);
    let history = History::of(&Wind::BuiltIn(WindCase::Mps13)).unwrap();
    let leaks = PerLeak { internal: INTERNAL_M3SPA, ..PerLeak::default() };
    let course: LeakCourse = if grows { "0 L/min -> 0.5 L/min" } else { "0.5 L/min" }.parse().unwrap();
    let reference = Emulation::paper().reference(&history, rig.cylinder.stroke_m).unwrap();
    let scenario = Scenario {
        leaks: leaks.map(|_| course.within_trace(DURATION_S)),
        oil_temperature: Some(OilTemperature::of(oil, DURATION_S).unwrap()),
        duration_s: DURATION_S,
        ..Scenario::new(rig.clone(), reference)
    };
    let mut sensing = Sensing::new(rig.sensors(), Biases::default(), 1);
    let mut replay = Replay::new(&rig).unwrap();
    let mut last_s = None;
    for truth in scenario.collect(leaks).unwrap() {
        let dt_s = last_s.replace(truth.t_s).map_or(0.0, |last| truth.t_s - last);
        let sample = sensing.read(&truth.sample);
        let temperature_k = truth.temp_k.filter(|_| shown);
        replay.push(&Record { t_s: truth.t_s, dt_s, sample, temperature_k, ..Record::default() });
    }
    replay.report(TraceSummary::new("trace", &TraceQuality::default())).trend.internal.unwrap()
}

#[test]
fn a_leak_that_follows_the_oil_is_not_worn() {
    let oil = trend(false, "40 °C -> 50 °C", true).oil.unwrap();
    let (with, beyond) = (oil.with_viscosity, oil.beyond_viscosity);
    assert!(with.slope_lpm_per_h > 4.0 * with.std, "{oil:?}");
    assert!(beyond.slope_lpm_per_h.abs() < 3.0 * beyond.std, "{oil:?}");
    assert!(beyond.slope_lpm_per_h.abs() < 0.5 * with.slope_lpm_per_h, "{oil:?}");
}

#[test]
fn a_leak_that_grows_in_steady_oil_is() {
    let trend = trend(true, "40 °C", true);
    let oil = trend.oil.unwrap();
    assert!(oil.with_viscosity.slope_lpm_per_h.abs() < 0.05 * trend.slope_lpm_per_h, "{oil:?}");
    assert!((oil.beyond_viscosity.slope_lpm_per_h / trend.slope_lpm_per_h - 1.0).abs() < 0.05, "{oil:?}");
}

#[test]
fn without_a_temperature_nothing_is_told_apart() {
    assert_eq!(trend(true, "40 °C", false).oil, None);
}
