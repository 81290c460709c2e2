//! A calibrated valve in a stream: a cylinder without flow meters is watched by its valve.

use pitchleak::Rig;
use pitchleak::core::{AlarmState, Leak};
use pitchleak::live::{Event, LineFormat, LiveConfig, Watch};
use pitchleak::replay::Stream;
use pitchleak::report::Status;
use pitchleak::trace::{BadRows, TraceReader};
use pitchleak::valve::{Calibrator, LeaksThen};
use pitchleak_testkit::rig::with_valve;
use pitchleak_testkit::valve::ValveCylinder;
use pitchleak_testkit::white_noise;
use rayon::prelude::*;
use std::io::Cursor;
use tempfile::TempDir;

const SECONDS: f64 = 240.0;
const LEAKS_FROM_S: f64 = 103.0;

fn rig(valve: &str) -> Rig {
    Rig::parse(&with_valve(valve), "valve").expect("a rig")
}

/// A rig of a cylinder that was calibrated when nothing leaked, and the folder of its calibration.
fn calibrated(cylinder: &ValveCylinder) -> (Rig, TempDir) {
    let sheet = rig("");
    let sound = ValveCylinder { leaks_lpm: [0.0; 3], ..*cylinder };
    let text = sound.trace(300.0, 100.0, 3e-3);
    let mut calibrator = Calibrator::new(&sheet, LeaksThen::Zero).expect("a valve");
    let mut reader = TraceReader::from_stream("then", Box::new(Cursor::new(text)), &sheet).expect("a trace");
    calibrator.read(&mut reader).expect("rows");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("valve.toml");
    let found = calibrator.finish().expect("calibrated");
    std::fs::write(&file, found.to_toml().expect("a file")).expect("written");
    (rig(&format!("calibration = {:?}", file.display().to_string())), folder)
}

/// Another stretch of the same cylinder, its leaks from a time on.
fn later(cylinder: &ValveCylinder) -> ValveCylinder {
    ValveCylinder { seed: cylinder.seed + 50_000, leaks_from_s: LEAKS_FROM_S, ..*cylinder }
}

fn events(rig: &Rig, text: &str) -> Vec<Event> {
    let mut watch = Watch::new(LiveConfig::of(rig.clone()), Some(LineFormat::Csv));
    let mut events = Vec::new();
    text.lines().for_each(|line| watch.take(line.as_bytes(), &mut events));
    watch.finish(&mut events);
    events
}

#[test]
fn a_leak_that_sets_in_raises_its_alarm_and_no_other() {
    for (index, leak) in [(0, Leak::Internal), (1, Leak::ExternalA), (2, Leak::ExternalB)] {
        for seed in 0..2 {
            // At 50 bar; P_L is a fifth of that.
            let lpm = if leak == Leak::Internal { 2.0 } else { 0.6 };
            let cylinder = ValveCylinder::drawn(20_000 + seed).leaking(index, lpm);
            let (rig, _folder) = calibrated(&cylinder);
            let events = events(&rig, &later(&cylinder).trace(SECONDS, 100.0, 3e-3));
            let alarms: Vec<_> = events
                .iter()
                .filter_map(|event| if let Event::Alarm(alarm) = event { Some(alarm) } else { None })
                .collect();
            let [alarm] = alarms[..] else { panic!("{leak:?} {seed}: {alarms:?}") };
            assert_eq!((alarm.fault, alarm.state), (leak, AlarmState::Raised), "{alarm:?}");
            println!("{leak:?} {seed}: alarm {:.0} s after it set in", alarm.t_s - LEAKS_FROM_S);
            assert!((0.0..=40.0).contains(&(alarm.t_s - LEAKS_FROM_S)), "{alarm:?}");
            let last = events.iter().rev().find_map(|event| match event {
                Event::Estimate(estimate) => Some(estimate),
                _ => None,
            });
            let last = last.expect("estimates");
            assert_eq!((last.status, &last.faults[..]), (Status::Leak, &[leak][..]), "{:?}", last.reasons);
        }
    }
}

#[test]
fn a_sound_cylinder_is_sound_window_for_window() {
    let (mut sound, mut all) = (0, 0);
    for seed in 0..2 {
        let cylinder = ValveCylinder::drawn(21_000 + seed);
        let (rig, _folder) = calibrated(&cylinder);
        for event in events(&rig, &later(&cylinder).trace(SECONDS, 100.0, 3e-3)) {
            match event {
                Event::Estimate(estimate) if estimate.t_s > 35.0 => {
                    all += 1;
                    sound += usize::from(estimate.status == Status::Sound);
                    assert!(estimate.faults.is_empty(), "{estimate:?}");
                }
                Event::Alarm(alarm) => panic!("{alarm:?}"),
                _ => {}
            }
        }
    }
    println!("{sound} of {all} SOUND");
    assert!(sound * 100 >= all * 95, "{sound} of {all}");
}

/// What begins after the calibration and is no leak.
#[test]
fn what_befalls_a_valve_later_raises_no_alarm() {
    type Flaw = fn(&mut ValveCylinder);
    let flaws: [(&str, Flaw); 5] = [
        ("null drift of 0.5 %", |one| one.valve.null_drift = 0.005),
        ("hysteresis of 1 %", |one| one.valve.hysteresis = 0.01),
        ("supply droops by 3 bar", |one| one.valve.droop_pa = 3e5),
        ("pressure A 10 ms late", |one| one.pressure_lag_s = 0.01),
        ("accumulator at A", |one| one.accumulator_m3pa = 2e-13),
    ];
    for (name, flaw) in flaws {
        for seed in 0..1 {
            let cylinder = ValveCylinder::drawn(25_000 + seed);
            let (rig, _folder) = calibrated(&cylinder);
            let mut flawed = later(&cylinder);
            flaw(&mut flawed);
            let (mut counts, mut alarms) = ([0; 4], Vec::new());
            for event in events(&rig, &flawed.trace(SECONDS, 100.0, 3e-3)) {
                match event {
                    Event::Estimate(estimate) => counts[estimate.status as usize] += 1,
                    Event::Alarm(alarm) => alarms.push((alarm.fault, alarm.t_s, alarm.leakage.mean_lpm)),
                    _ => {}
                }
            }
            println!("{name} {seed}: leak, sound, doubtful, not sure {counts:?} {alarms:?}");
            assert!(alarms.is_empty() && counts[0] == 0, "{name} {seed}: {counts:?} {alarms:?}");
        }
    }
}

/// Rows with their times later by so much.
fn shifted(text: &str, by_s: f64) -> String {
    let rows = text.lines().skip(1).filter_map(|row| row.split_once(','));
    rows.map(|(t_s, rest)| format!("{:.3},{rest}\n", t_s.parse::<f64>().unwrap_or_default() + by_s)).collect()
}

/// Ten minutes, or `PITCHLEAK_HOURS` of each of four cylinders whose valve walks by what `drift` declares for a day.
#[test]
fn a_valve_that_drifts_as_declared_raises_no_alarm() {
    let hours =
        std::env::var("PITCHLEAK_HOURS").ok().and_then(|hours| hours.parse().ok()).unwrap_or(1.0 / 6.0);
    let parts = (6.0 * hours) as u64;
    let one = |seed: u64| {
        let mut cylinder = ValveCylinder::drawn(23_000 + seed);
        let (rig, _folder) = calibrated(&cylinder);
        let mut watch = Watch::new(LiveConfig::of(rig), Some(LineFormat::Csv));
        let mut normal = white_noise(24_000 + seed);
        let mut walk = |std_per_day: f64| std_per_day / 12.0 * normal.next().unwrap_or_default();
        let (mut events, mut estimates, mut unsure) = (Vec::new(), 0, 0);
        for part in 0..parts {
            for edge in 0..4 {
                cylinder.valve.gains[edge] *= 1.0 + walk(0.03);
                cylinder.valve.laps[edge] += walk(0.001);
                let clearance_lpm = &mut cylinder.valve.clearances_lpm[edge];
                *clearance_lpm = (*clearance_lpm + walk(0.1 * 0.057)).max(0.0);
            }
            cylinder.seed = 30_000 + 1_000 * seed + part;
            let text = cylinder.trace(600.0, 100.0, 3e-3);
            if part == 0 {
                watch.take(text.lines().next().unwrap_or_default().as_bytes(), &mut events);
            }
            for row in shifted(&text, 700.0 * part as f64).lines() {
                watch.take(row.as_bytes(), &mut events);
            }
            for event in events.drain(..) {
                match event {
                    Event::Estimate(estimate) => {
                        estimates += 1;
                        unsure += usize::from(estimate.status != Status::Sound);
                        assert!(estimate.faults.is_empty(), "{estimate:?}");
                    }
                    Event::Alarm(alarm) => panic!("{alarm:?}"),
                    _ => {}
                }
            }
        }
        (estimates, unsure)
    };
    let of = (0..4).into_par_iter().map(one).collect::<Vec<_>>();
    println!("{:.1} h: estimates, and those not SOUND: {of:?}", 4.0 * parts as f64 / 6.0);
    assert!(of.iter().all(|(estimates, unsure)| unsure * 20 <= *estimates), "{of:?}");
}

#[test]
fn a_stream_that_is_saved_amid_a_window_goes_on_with_it() {
    let cylinder = ValveCylinder::drawn(22_000).leaking(1, 0.3);
    let (rig, _folder) = calibrated(&cylinder);
    let text = ValveCylinder { leaks_from_s: 0.0, ..later(&cylinder) }.trace(45.0, 100.0, 3e-3);
    let (header, rows) = text.split_once('\n').expect("a header");
    let rows: Vec<&str> = rows.lines().collect();
    let feed = |stream: &mut Stream, rows: &[&str]| {
        let part = Box::new(Cursor::new(format!("{header}\n{}\n", rows.join("\n")).into_bytes()));
        stream.extend(TraceReader::from_stream("valve", part, &rig).expect("a part")).expect("good rows");
    };
    let mut whole = Stream::new(&rig, BadRows::Skip).expect("a rig");
    feed(&mut whole, &rows);
    let mut first = Stream::new(&rig, BadRows::Skip).expect("a rig");
    feed(&mut first, &rows[..1234]);
    let saved = first.save().expect("saved");
    println!("{} bytes", saved.len());
    let mut second = Stream::restore(&saved).expect("restored");
    feed(&mut second, &rows[1234..]);
    let [expected, report] = [&whole, &second].map(|stream| stream.report("valve").expect("a report"));
    assert_eq!(report, expected);
    assert_eq!(report.verdict.faults, [Leak::ExternalA], "{}", report.verdict.text);
    assert_eq!(second.save().expect("saved"), whole.save().expect("saved"));
}

#[test]
fn a_valve_that_is_not_calibrated_is_not_watched_by_and_says_so() {
    let text = ValveCylinder::drawn(1).trace(20.0, 100.0, 3e-3);
    let events = events(&rig(""), &text);
    let last = events.iter().rev().find_map(|event| match event {
        Event::Estimate(estimate) => Some(estimate),
        _ => None,
    });
    let reasons = &last.expect("an estimate").reasons;
    let advice = reasons.iter().find_map(|reason| reason.suggestion.clone()).expect("advice");
    assert!(advice.contains("`pitchleak calibrate`"), "{advice}");
    let missing = rig("calibration = \"nowhere.toml\"");
    let error = Stream::new(&missing, BadRows::Skip).err().expect("no such file").to_string();
    assert!(error.contains("nowhere.toml"), "{error}");
}
