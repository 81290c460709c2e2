//! A leak that opens suddenly is found soon, and only that leak is named.

use pitchleak::core::{EffectSet, PerLeak};
use pitchleak::replay::Replay;
use pitchleak::reproduce::rig;
use pitchleak::simulate::{Biases, LeakSize, Scenario, Sensing};
use pitchleak::trace::Record;
use pitchleak::wind::{Emulation, History, Wind, WindCase};

const ONSET_S: f64 = 30.0;

#[test]
fn a_sudden_leak_is_named_alone_and_within_ten_seconds() {
    let none = LeakSize::default();
    let half = LeakSize::MeanFlow(0.5 / 60e3);
    let whole = LeakSize::MeanFlow(1.0 / 60e3);
    let leaks = [
        (
            WindCase::Mps21,
            PerLeak { internal: half, external_a: none, external_b: none },
            [true, false, false],
        ),
        (
            WindCase::Mps13,
            PerLeak { internal: none, external_a: whole, external_b: none },
            [false, true, false],
        ),
        (
            WindCase::Mps21,
            PerLeak { internal: none, external_a: none, external_b: half },
            [false, false, true],
        ),
        (
            WindCase::Mps13,
            PerLeak { internal: none, external_a: none, external_b: whole },
            [false, false, true],
        ),
    ];
    for (wind, leaks, named) in leaks {
        let history = History::of(&Wind::BuiltIn(wind)).expect("is built in");
        let scenario = Scenario {
            rig: rig(),
            reference: Emulation::paper().reference(&history, rig().cylinder.stroke_m).expect("fits"),
            leaks,
            onset_s: ONSET_S,
            effects: EffectSet::default(),
            start_s: 40.0,
            warm_up_s: 5.0,
            duration_s: ONSET_S + 20.0,
            sample_rate_hz: 100.0,
        };
        let truths = scenario.collect(scenario.leak_coefficients().expect("within reach")).expect("runs");
        for seed in 0..3 {
            let mut sensing = Sensing::new(rig().sensors(), Biases::default(), seed);
            let mut replay = Replay::new(&rig()).expect("a rig");
            for (index, truth) in truths.iter().enumerate() {
                let dt_s = if index == 0 { 0.0 } else { 0.01 };
                let sample = sensing.read(&truth.sample);
                let record = Record { t_s: truth.t_s, dt_s, sample, ..Record::default() };
                replay.push(&record);
                let active = replay.point(&record).active;
                let active = [active.internal, active.external_a, active.external_b];
                for (alarm, own) in active.iter().zip(named) {
                    let at = format!("{wind:?}, {named:?}, seed {seed}, {} s", truth.t_s);
                    assert!(!alarm || own && truth.t_s >= ONSET_S, "wrong alarm: {at}");
                    assert!(*alarm || !own || truth.t_s < ONSET_S + 10.0, "no alarm: {at}");
                }
            }
        }
    }
}
