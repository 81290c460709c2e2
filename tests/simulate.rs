//! Simulated scenarios: they follow, leak and show what they were told to.

use pitchleak::Rig;
use pitchleak::core::effects::EffectConstants;
use pitchleak::core::{Effect, EffectSet, PerLeak};
use pitchleak::reference::Reference;
use pitchleak::simulate::{
    LeakCourse, LeakSize, OilTemperature, Reading, Scenario, SimulateError, TraceLayout, TraceWriter, Truth,
};
use pitchleak::trace::{Record, TraceReader};
use pitchleak::wind::{Emulation, History, Wind, WindCase};

fn lpm(flow: f64) -> f64 {
    flow / 60e3
}

fn scenario() -> Scenario {
    let history = History::of(&Wind::BuiltIn(WindCase::Mps21)).expect("is built in");
    let reference = Emulation::paper().reference(&history, 0.2).expect("fits");
    Scenario { start_s: 20.0, warm_up_s: 3.0, duration_s: 4.0, ..Scenario::new(Rig::paper(), reference) }
}

fn external_a(leak: LeakCourse) -> PerLeak<LeakCourse> {
    PerLeak { external_a: leak, ..PerLeak::default() }
}

fn run(scenario: &Scenario) -> Vec<Truth> {
    scenario.collect(scenario.leak_coefficients().expect("within reach")).expect("runs")
}

fn mean(truths: &[Truth], of: impl Fn(&Truth) -> f64) -> f64 {
    truths.iter().map(of).sum::<f64>() / truths.len() as f64
}

#[test]
fn the_rig_follows_the_wind() {
    let truths = run(&scenario());
    assert_eq!(truths.len(), 400);
    for truth in &truths {
        assert!((truth.signals.x_m - truth.position_reference_m).abs() < 1e-3, "position at {} s", truth.t_s);
        assert!((truth.signals.force_n - truth.load_reference_n).abs() < 500.0, "load at {} s", truth.t_s);
        assert_eq!(truth.leaks_m3s, PerLeak::default());
    }
}

#[test]
fn a_leak_given_by_its_flow_has_that_mean_flow() {
    let leaks = PerLeak {
        internal: LeakSize::MeanFlow(lpm(1.0)),
        external_a: LeakSize::MeanFlow(lpm(0.5)),
        external_b: LeakSize::MeanFlow(lpm(0.2)),
    }
    .map(LeakCourse::from);
    let truths = run(&Scenario { leaks, ..scenario() });
    for (found, asked) in [
        (mean(&truths, |t| t.leaks_m3s.internal.abs()), 1.0),
        (mean(&truths, |t| t.leaks_m3s.external_a), 0.5),
        (mean(&truths, |t| t.leaks_m3s.external_b), 0.2),
    ] {
        assert!((found / lpm(asked) - 1.0).abs() < 0.02, "{found} for {}", lpm(asked));
    }
}

#[test]
fn a_leak_opens_at_its_onset() {
    let leaks = external_a(LeakCourse::from_onset(LeakSize::Coefficient(2e-12), 2.5));
    let truths = run(&Scenario { leaks, ..scenario() });
    for truth in truths {
        assert_eq!(truth.leaks_m3s.external_a > 0.0, truth.t_s >= 2.5 - 1e-9, "at {} s", truth.t_s);
    }
}

#[test]
fn a_leak_grows_comes_and_goes_and_warms_as_it_was_told() {
    let coefficient = |text: &str, oil: Option<&str>| -> Vec<(f64, f64)> {
        let leaks = external_a(text.parse().expect("a leak"));
        let oil_temperature = oil.map(|text| OilTemperature::of(text, 4.0).expect("a temperature"));
        let truths = run(&Scenario { leaks, oil_temperature, ..scenario() });
        truths.iter().map(|truth| (truth.t_s, truth.leaks_m3s.external_a / truth.signals.pa_pa)).collect()
    };
    let near = |found: f64, told: f64| (found - told).abs() < 1e-9 * 2e-12;
    for (t_s, c) in coefficient("1e-12 /Pa -> 2e-12 /Pa @ 1 s..3 s", None) {
        assert!(near(c, 1e-12 * (1.0 + ((t_s - 1.0) / 2.0).clamp(0.0, 1.0))), "{c} at {t_s} s");
    }
    for (t_s, c) in coefficient("2e-12 /Pa every 2 s for 0.5 s", None) {
        let open = t_s < 0.495 || (1.995..2.495).contains(&t_s);
        assert!(near(c, if open { 2e-12 } else { 0.0 }), "{c} at {t_s} s");
    }
    let warming = coefficient("1e-12 /Pa", Some("40 °C -> 60 °C"));
    assert!(near(warming[0].1, 1e-12) && warming.is_sorted_by(|a, b| a.1 < b.1));
    assert!(warming[399].1 > 1.9e-12, "{:?}", warming[399]);
}

#[test]
fn a_leak_that_no_supply_feeds_is_an_error() {
    let leaks = external_a(LeakSize::MeanFlow(lpm(500.0)).into());
    assert_eq!(Scenario { leaks, ..scenario() }.leak_coefficients(), Err(SimulateError::LeakOutOfReach));
}

#[test]
fn lagging_meters_show_an_older_flow_and_the_rig_does_not_notice() {
    let mut effects = EffectSet::default();
    effects.set(Effect::FlowMeterLag, 0.03, EffectConstants::default()).expect("a lag");
    let (plain, lagging) = (run(&scenario()), run(&Scenario { effects, ..scenario() }));
    let error = |lag: usize| -> f64 {
        let shown = lagging.iter().skip(lag).map(|t| t.sample.qa_m3s.unwrap_or(f64::NAN));
        shown.zip(&plain).map(|(shown, truth)| (shown - truth.signals.qa_m3s).powi(2)).sum()
    };
    assert!(error(3) < 0.5 * error(0), "{} now, {} three samples ago", error(0), error(3));
    assert!(lagging.iter().zip(&plain).all(|(a, b)| a.signals == b.signals));
}

#[test]
fn a_written_trace_reads_back_with_its_leaks() {
    let leaks = PerLeak { internal: LeakSize::Coefficient(1e-11).into(), ..PerLeak::default() };
    let truths = run(&Scenario { leaks, duration_s: 1.0, ..scenario() });
    let mut writer = TraceWriter::new(Vec::new(), TraceLayout::default()).expect("writes");
    for truth in &truths {
        writer.row(&Reading::at(truth, &truth.sample, None)).expect("writes");
    }
    let bytes = std::io::Cursor::new(writer.into_inner());
    let mut reader = TraceReader::from_stream("trace", Box::new(bytes), &Rig::paper()).expect("a trace");
    let mut record = Record::default();
    for truth in &truths {
        assert!(reader.next_record(&mut record).expect("a row"));
        assert!((record.t_s - truth.t_s).abs() < 1e-9);
        assert!((record.sample.x_m - truth.sample.x_m).abs() < 1e-8);
        assert!((record.sample.pa_pa - truth.sample.pa_pa).abs() < 1.0);
        assert!((record.leak_m3s.internal.unwrap_or(f64::NAN) - truth.leaks_m3s.internal).abs() < 1e-10);
    }
    assert!(!reader.next_record(&mut record).expect("the end"));
}

#[test]
fn impossible_scenarios_are_named() {
    let bad = [
        Scenario { duration_s: f64::NAN, ..scenario() },
        Scenario { sample_rate_hz: 0.0, ..scenario() },
        Scenario { warm_up_s: -1.0, ..scenario() },
    ];
    for scenario in bad {
        assert!(matches!(scenario.run(Default::default(), |_| ()), Err(SimulateError::Range { .. })));
    }
    let far = Scenario { reference: Reference::constant(f64::NAN, f64::NAN), duration_s: 0.1, ..scenario() };
    let _ = far.collect(Default::default());
}
