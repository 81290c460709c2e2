//! The verdict on traces whose sensors lie: is each kind of reason given where it should be, and none where nothing is
//! wrong?

use pitchleak::Rig;
use pitchleak::core::{Leak, PerLeak};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::{ReplayReport, Status};
use pitchleak::rig::Odds;
use pitchleak::simulate::{LeakCourse, LeakSize, Scenario, Truth};
use pitchleak::trace::TraceReader;
use pitchleak::units::LPM_PER_M3S;
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use pitchleak_testkit::lies::judge::{self, Judgement, Said, judge, recorded};
use pitchleak_testkit::lies::{Family, LEAKING, Lie, leak_name, rig, truths};
use pitchleak_testkit::trace_text::{file, row};
use pitchleak_testkit::{Motion, Multisine, noisy, seeded};
use rayon::prelude::*;
use std::io::Cursor;

fn lie(faults: &'static [&'static str]) -> Lie {
    Lie { family: Family::Mistake, name: "", faults, every: 1, named: None }
}

/// The report on what sensors show of it, and the truth as far as it was recorded.
fn replayed<'a>(truths: &'a [Truth], lie: &Lie, accuracy: f64, seed: u64) -> (ReplayReport, &'a [Truth]) {
    let (trace, shown) = recorded(truths, lie, accuracy, seed);
    (judge::replayed(trace, accuracy).unwrap_or_else(|e| panic!("{e}")), shown)
}

/// The kinds of reasons that a minute of wind can give; the others are tested beside the code.
#[test]
fn each_mistake_gives_its_reason() {
    let internal = Some(Leak::Internal);
    let cases = [
        ("channel_dead", WindCase::Mps13, None, &["qa dead"][..]),
        ("channel_dead", WindCase::Mps5, internal, &["qa dead"]),
        ("channel_stuck", WindCase::Mps13, internal, &["pa stuck 30 s.."]),
        ("channel_clipped", WindCase::Mps13, internal, &["qa clipped 1 L/min"]),
        ("channel_held", WindCase::Mps13, None, &["x held 500 ms"]),
        ("wiring", WindCase::Mps13, None, &["swap qa qb"]),
        ("wiring", WindCase::Mps13, Some(Leak::ExternalA), &["qb reversed"]),
        ("wiring", WindCase::Mps5, internal, &["qa in m3/h", "qb in m3/h"]),
    ];
    for (id, wind, leaking, faults) in cases {
        let (report, _) = replayed(&truths(wind, leaking), &lie(faults), 3e-3, 1);
        let ids: Vec<_> = report.verdict.reasons.iter().map(|reason| reason.id.name()).collect();
        assert!(ids.contains(&id), "{faults:?}: {id} is not among {ids:?}: {}", report.verdict.text);
        assert!(!report.verdict.status.is_sure() && !report.verdict.text.is_empty());
    }
}

/// A fifth of the leak passes an orifice: sensors of 0.1 % see that it isn't C P, and by which law it is. Where a meter is
/// off besides, nothing wrong is sure.
#[test]
fn a_leak_through_an_orifice_is_sure_and_its_law_is_named() {
    let internal = Some(Leak::Internal);
    [WindCase::Mps13, WindCase::Mps30].par_iter().for_each(|wind| {
        let truths = truths(*wind, internal);
        let judged = |faults: &'static [&'static str], seed| {
            let (report, shown) = replayed(&truths, &lie(faults), 1e-3, seed);
            if faults.is_empty() {
                // At mean pressures, whichever the law.
                let net_lpm = shown.iter().map(|truth| truth.leaks_m3s.internal).sum::<f64>() * 60e3
                    / shown.len() as f64;
                let told_lpm = report.leakage.internal.net_mean_lpm.expect("a net flow");
                assert!((told_lpm - net_lpm).abs() < 0.1 * net_lpm.abs(), "{wind:?}: {told_lpm}, {net_lpm}");
            }
            let text = report.verdict.text.clone();
            (judge(&report.into(), internal, shown), text)
        };
        for seed in 1..=2 {
            let (judgement, text) = judged(&[], seed);
            assert_eq!(judgement, Judgement::Right, "{wind:?}: {text}");
            assert!(text.contains("as through an orifice, by the root of the pressure"), "{wind:?}: {text}");
            let (judgement, text) = judged(&["qa gain 20 %"], seed);
            assert_ne!(judgement, Judgement::ConfidentlyWrong, "{wind:?}: {text}");
        }
    });
}

/// Zeros of both meters that are off by other amounts each are told with their sizes, and spoil no verdict.
#[test]
fn zeros_of_both_meters_are_told_with_their_sizes() {
    let sound = [WindCase::Mps13, WindCase::Mps21, WindCase::Mps30].map(|wind| (wind, None));
    for (wind, leaking) in sound.into_iter().chain([(WindCase::Mps13, Some(Leak::ExternalA))]) {
        let lie = lie(&["qa offset 0.3 L/min", "qb offset -0.2 L/min"]);
        let truths = truths(wind, leaking);
        let (report, shown) = replayed(&truths, &lie, 3e-3, 3);
        let text = report.verdict.text.clone();
        let size = |chamber: &str| -> Option<f64> {
            let (before, _) = text.split_once(&format!(" L/min ({chamber})"))?;
            before.rsplit_once(" ± ")?.0.rsplit_once(' ')?.1.parse().ok()
        };
        let (a, b) = size("A").zip(size("B")).unwrap_or_else(|| panic!("{wind:?} {leaking:?}: {text}"));
        assert!((a - 0.3).abs() < 0.1 && (b + 0.2).abs() < 0.1, "{wind:?} {leaking:?}: {text}");
        assert_ne!(judge(&report.into(), leaking, shown), Judgement::ConfidentlyWrong, "{wind:?}: {text}");
    }
}

/// A leak that grows and then stays goes in no straight line: no zero of a meter makes that up.
#[test]
fn a_leak_that_grew_and_stays_is_a_leak_and_no_zero() {
    let truths = grown(WindCase::Mps5, "0 -> 0.6 L/min @ 30 s..120 s", 240.0);
    let (trace, shown) = recorded(&truths, &lie(&[]), 1e-2, 1);
    // Who leaves zeros undeclared may have them wherever a data sheet does.
    let mut declared = rig(1e-2);
    (declared.instruments.flow_a.bias, declared.instruments.flow_b.bias) = (1e-4, 1e-4);
    let mut reader =
        TraceReader::from_stream("trace", Box::new(Cursor::new(trace)), &declared).expect("opens");
    let report = replay(&mut reader, &declared, |_, _, _| Ok::<_, ReplayError>(())).expect("is read");
    assert_eq!(report.verdict.status, Status::Leak, "{}", report.verdict.text);
    let last = shown.last().expect("has rows");
    let truth = last.leaks_m3s.external_a / last.signals.pa_pa;
    let found = report.estimates.external_leak_a_coefficient.value;
    let [low, high] = report.estimates.external_leak_a_coefficient.ci95.expect("is known");
    let text = &report.verdict.text;
    assert!(
        (found / truth - 1.0).abs() < 0.1 && (low..high).contains(&truth),
        "{found} of {truth} m³/(s·Pa): {text}"
    );
    assert!(report.verdict.explanations[0].cause.is_empty(), "{:?}", report.verdict.explanations);
}

/// What happened where the external leak of A took this course.
fn grown(wind: WindCase, course: &str, duration_s: f64) -> Vec<Truth> {
    let leaks = PerLeak { external_a: course.parse().expect("a course"), ..PerLeak::default() };
    windy(wind, leaks, 0.0, duration_s)
}

fn windy(wind: WindCase, leaks: PerLeak<LeakCourse>, start_s: f64, duration_s: f64) -> Vec<Truth> {
    let history = History::of(&Wind::BuiltIn(wind)).expect("is built in");
    let reference = Emulation::paper().reference(&history, 0.2).expect("fits the rig");
    let scenario = Scenario { leaks, start_s, duration_s, ..Scenario::new(rig(1e-2), reference) };
    scenario.collect(scenario.leak_coefficients().expect("within reach")).expect("runs")
}

/// That two leaks at once are rare is no finding of a trace, so it rules none out: meters' zeros that explain the trace as well leave
/// the leaks open.
#[test]
fn two_external_leaks_are_not_ruled_out_for_being_rare() {
    let size = |lpm: f64| LeakCourse::from(LeakSize::MeanFlow(lpm / LPM_PER_M3S));
    let leaks = PerLeak { internal: size(0.0), external_a: size(0.2), external_b: size(0.2) };
    [WindCase::Mps13, WindCase::Mps21].par_iter().for_each(|wind| {
        let truths = windy(*wind, leaks, 20.0, 60.0);
        for seed in 1..=12 {
            let (report, _) = replayed(&truths, &lie(&[]), 1e-2, seed);
            assert_ne!(report.verdict.status, Status::Sound, "{wind:?} {seed}: {}", report.verdict.text);
        }
    });
}

/// A pressure sensor's gain is undone in the leak's flow, too: the pressure that drives it is not as read.
#[test]
fn a_leak_beside_a_pressures_gain_has_its_true_size() {
    let internal = LeakCourse::from(LeakSize::MeanFlow(0.5 / LPM_PER_M3S));
    let leaks = PerLeak { internal, ..PerLeak::default() };
    let truths = windy(WindCase::Mps21, leaks, 20.0, 120.0);
    for fault in [&["pa gain 10 %"][..], &["pa gain -10 %"]] {
        for seed in 1..=3 {
            let (report, shown) = replayed(&truths, &lie(fault), 1e-2, seed);
            let text = report.verdict.text.clone();
            let judged = judge(&report.into(), Some(Leak::Internal), shown);
            assert_ne!(judged, Judgement::ConfidentlyWrong, "{fault:?} {seed}: {text}");
        }
    }
}

/// In calm wind a leak keeps its flow from ever being negative: that is no lost sign, also where the position is noisier than declared.
#[test]
fn a_leak_in_calm_wind_has_lost_no_sign() {
    for leak in [Leak::ExternalA, Leak::ExternalB] {
        let mut leaks = PerLeak::default();
        leaks[leak] = LeakCourse::from(LeakSize::MeanFlow(0.5 / LPM_PER_M3S));
        let truths = windy(WindCase::Mps5, leaks, 0.0, 300.0);
        (1..=4).into_par_iter().for_each(|seed| {
            let (trace, _) = recorded(&truths, &lie(&[]), 1.5e-2, seed);
            let report = judge::replayed(trace, 1e-2).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(report.verdict.status, Status::Leak, "{leak:?} {seed}: {}", report.verdict.text);
        });
    }
}

/// Right columns, honest sensors: sure, and right.
#[test]
fn honest_traces_stay_sure() {
    let cylinders: Vec<_> =
        WindCase::ALL.into_iter().flat_map(|wind| LEAKING.map(|leaking| (wind, leaking))).collect();
    let honest = lie(&[]);
    cylinders.par_iter().for_each(|(wind, leaking)| {
        let truths = truths(*wind, *leaking);
        for accuracy in [3e-3, 1e-2] {
            let (report, shown) = replayed(&truths, &honest, accuracy, 2);
            let name = format!("{} at {} m/s, {accuracy}", leak_name(*leaking), wind.mean_mps());
            let judged = judge(&Said::from(report.clone()), *leaking, shown);
            assert_eq!(judged, Judgement::Right, "{name}: {:?}", report.verdict);
            let status = if leaking.is_some() { Status::Leak } else { Status::Sound };
            assert_eq!((report.verdict.status, report.verdict.reasons.len()), (status, 0), "{name}");
        }
    });
}

/// How much better than their data sheets sensors are says nothing of their gains and lags.
#[test]
fn sensors_much_better_than_their_sheets_are_believed() {
    for start_s in [10.0, 130.0, 250.0] {
        let leaks = PerLeak { internal: "0.2 L/min".parse().expect("a course"), ..PerLeak::default() };
        let truths = windy(WindCase::Mps21, leaks, start_s, 80.0);
        for (times, seed) in [(10.0, 1), (33.0, 2)] {
            let (trace, _) = recorded(&truths, &lie(&[]), 1e-2 / times, seed);
            let verdict = judge::replayed(trace, 1e-2).unwrap_or_else(|e| panic!("{e}")).verdict;
            assert_eq!((verdict.status, verdict.faults), (Status::Leak, vec![Leak::Internal]), "{times}");
        }
    }
}

/// A plant whose meters' zeros are off in one of two recordings says so: among sizes that the trace leaves open, the zero
/// gains as much as its prior odds do.
#[test]
fn odds_of_the_rig_file_move_the_posterior_by_as_much() {
    let truths = truths(WindCase::Mps13, None);
    let (trace, _) = recorded(&truths, &lie(&[]), 3e-3, 1);
    let of = |odds: Odds| {
        let mut rig = rig(3e-3);
        rig.decision.odds = odds;
        let stream = Box::new(Cursor::new(trace.clone()));
        let mut reader = TraceReader::from_stream("trace", stream, &rig).unwrap();
        let report = replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(())).unwrap();
        let explanations = report.verdict.explanations;
        let at = |id: &str| explanations.iter().find(|one| one.id == id).map_or(0.0, |one| one.probability);
        at("flow_zeros") / at("sound")
    };
    let (usual, given) = (of(Odds::default()), of(Odds::new([("flow_zeros", 0.5)])));
    // The table has 20 % against 80 %.
    assert!((given / usual / 4.0 - 1.0).abs() < 0.05, "{usual} {given}");
}

/// What nothing explains may be as much of a leak: a flow that swings by what no explanation knows hides a small leak, and leaves a
/// large one sure.
#[test]
fn what_nothing_explains_is_weighed_by_its_size() {
    let rig = rig(1e-3);
    let judged = |internal: f64, swing_m3s: f64| {
        let motion = Motion::wind_like(PerLeak { internal, ..PerLeak::default() });
        let mut random = seeded(5);
        let read = |k: u32| {
            let t_s = 0.01 * f64::from(k);
            let mut sample = noisy(&motion.sample(t_s), &rig.sensors(), &mut random);
            sample.qa_m3s = sample.qa_m3s.map(|flow| flow + swing_m3s * (4.0 * t_s).sin());
            row(t_s, motion.position_m.slope(t_s), &sample)
        };
        let rows: Vec<_> = (0..6000).map(read).collect();
        report_on(&rows, &rig)
    };
    let small = judged(0.0, 2.3e-5).verdict;
    assert_eq!(small.status, Status::NotSure, "{}", small.text);
    let large = judged(4e-11, 3e-5).verdict;
    assert_eq!((large.status, large.faults), (Status::Leak, vec![Leak::Internal]), "{}", large.text);
    assert!(large.text.contains("What remains unexplained is 5."), "{}", large.text);
    let larger_swing = judged(5e-11, 5e-5).verdict;
    assert_eq!(larger_swing.status, Status::Doubtful, "{}", larger_swing.text);
}

/// A turbine or gear wheel that was calibrated one way reads more one way than the other, and what it reads too much goes with the
/// way that the piston made.
#[test]
fn a_meter_that_reads_more_one_way_is_told_and_is_no_leak() {
    let rig = rig(1e-3);
    let motion = Motion::wind_like(PerLeak::default());
    for (share, of_b) in [(0.02, false), (-0.02, false), (0.015, true), (0.003, false)] {
        let mut random = seeded(5);
        let read = |k: u32| {
            let t_s = 0.01 * f64::from(k);
            let mut sample = noisy(&motion.sample(t_s), &rig.sensors(), &mut random);
            let flow = if of_b { &mut sample.qb_m3s } else { &mut sample.qa_m3s };
            *flow = flow.map(|q| q + share * q.abs());
            row(t_s, motion.position_m.slope(t_s), &sample)
        };
        let rows: Vec<_> = (0..6000).map(read).collect();
        let verdict = report_on(&rows, &rig).verdict;
        assert_eq!(verdict.status, Status::Sound, "{share}: {}", verdict.text);
        let id = if of_b { "flow_direction_b" } else { "flow_direction_a" };
        let named = verdict.explanations.iter().filter(|one| one.id.split('+').any(|part| part == id));
        let probability: f64 = named.map(|one| one.probability).sum();
        assert!(probability > 0.9, "{share}: {probability} {}", verdict.text);
        // No meter is better than that.
        assert_eq!(verdict.text.contains("one way than the other"), share.abs() > 0.01, "{}", verdict.text);
    }
}

fn report_on(rows: &[String], rig: &Rig) -> ReplayReport {
    let text = Box::new(Cursor::new(file(rows).into_bytes()));
    let mut reader = TraceReader::from_stream("trace", text, rig).expect("a trace");
    replay(&mut reader, rig, |_, _, _| Ok::<_, ReplayError>(())).expect("a report")
}

/// One pressure of quiet sensors passes a filter of 50 ms, which the table does not have: what comes nearest takes a dead volume of
/// litres and leaks to the outside.
#[test]
fn sizes_that_nothing_has_explain_nothing() {
    let internal = LeakCourse::from(LeakSize::MeanFlow(0.3 / LPM_PER_M3S));
    let leaks = PerLeak { internal, ..PerLeak::default() };
    let (truths, rig) = (windy(WindCase::Mps5, leaks, 0.0, 60.0), rig(1e-3));
    for seed in 10..14 {
        let mut random = seeded(seed);
        let mut filtered: Option<f64> = None;
        let rows = truths.iter().map(|truth| {
            let mut sample = noisy(&truth.sample, &rig.sensors(), &mut random);
            let last = filtered.unwrap_or(sample.pb_pa);
            sample.pb_pa = last + (sample.pb_pa - last) / 6.0;
            filtered = Some(sample.pb_pa);
            row(truth.t_s, truth.signals.v_mps, &sample)
        });
        let verdict = report_on(&rows.collect::<Vec<_>>(), &rig).verdict;
        let names_outside = verdict.faults.iter().any(|leak| *leak != Leak::Internal);
        assert!(verdict.status != Status::Leak || !names_outside, "{seed}: {}", verdict.text);
    }
}

/// Where the load is steady, a leak past the piston and zeros of both meters that are equal and opposite are alike, but for what the
/// pressures show: and one of their sensors hangs.
#[test]
fn a_pressure_sensor_that_hangs_makes_no_zeros_of_a_leak() {
    let rig = rig(1e-3);
    let status = |internal: f64, play_pa: f64, seed: u64| {
        let common = [(4e5, 0.11, 0.4), (2e5, 0.31, 2.2), (1e5, 0.73, 0.7)];
        let wind_like = Motion::wind_like(PerLeak { internal, ..PerLeak::default() });
        let pressure_a_pa = Multisine { mean: 8e6, lines: common.to_vec() };
        let pressure_b_pa = Multisine { mean: 6e6, lines: common.to_vec() };
        let motion = Motion { pressure_a_pa, pressure_b_pa, ..wind_like };
        let (mut random, mut hanging_pa) = (seeded(seed), 6e6_f64);
        let rows = (0..6000).map(|k| {
            let t_s = 0.01 * f64::from(k);
            let mut sample = motion.sample(t_s);
            hanging_pa = hanging_pa.clamp(sample.pb_pa - 0.5 * play_pa, sample.pb_pa + 0.5 * play_pa);
            sample.pb_pa = hanging_pa;
            row(t_s, motion.position_m.slope(t_s), &noisy(&sample, &rig.sensors(), &mut random))
        });
        report_on(&rows.collect::<Vec<_>>(), &rig).verdict
    };
    let large = status(1.5 / LPM_PER_M3S / 2e6, 4e5, 1);
    assert_eq!((large.status, large.faults), (Status::Leak, vec![Leak::Internal]), "{}", large.text);
    assert!(large.text.contains("look whether one of their sensors hangs"), "{}", large.text);
    for (seed, lpm) in (0..8).zip([0.16, 0.2, 0.24, 0.28].into_iter().cycle()) {
        for play_pa in [1e5, 2e5, 4e5] {
            let verdict = status(lpm / LPM_PER_M3S / 2e6, play_pa, seed);
            assert_ne!(verdict.status, Status::Sound, "{lpm} L/min, {play_pa} Pa, {seed}: {}", verdict.text);
            let sound = status(0.0, play_pa, seed);
            assert_eq!(sound.status, Status::Sound, "{play_pa} Pa, {seed}: {}", sound.text);
        }
    }
}
