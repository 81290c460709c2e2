//! Alarms of a stream against its posterior: what it rules out is held back, and nothing else.

#![allow(clippy::unwrap_used)]

use pitchleak::core::{AlarmState, Leak};
use pitchleak::live::{Event, LineFormat, LiveConfig, Watch};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::trace::TraceReader;
use pitchleak_testkit::judge::Case;
use pitchleak_testkit::judge::worlds::{WORLDS, World};
use std::io::Cursor;

fn world(name: &str) -> &'static World {
    WORLDS.iter().find(|world| world.name == name).unwrap()
}

/// Leaks whose flow went beyond its threshold, and those that a stream raised an alarm of.
fn raised(case: &Case) -> [Vec<Leak>; 2] {
    let (trace, rig) = (case.record().0, case.rig());
    let mut reader = TraceReader::from_stream("t", Box::new(Cursor::new(trace.clone())), &rig).unwrap();
    let report = replay(&mut reader, &rig, |_, _, _| Ok::<(), ReplayError>(())).unwrap();
    let beyond = report.alarms.into_iter().filter(|alarm| alarm.state == AlarmState::Raised);
    let (mut watch, mut events) = (Watch::new(LiveConfig::of(rig), Some(LineFormat::Csv)), Vec::new());
    trace.split(|byte| *byte == b'\n').for_each(|line| watch.take(line, &mut events));
    watch.finish(&mut events);
    let told = events.into_iter().filter_map(|event| match event {
        Event::Alarm(alarm) if alarm.state == AlarmState::Raised => Some(alarm.fault),
        _ => None,
    });
    [beyond.map(|alarm| alarm.fault).collect(), told.collect()]
}

/// Meters that lag by 50 ms add up to a leak of thousandths of L/min, again and again, until it is beyond the estimator's own noise.
#[test]
fn meters_that_are_late_raise_no_alarm() {
    let cases = (12..18).map(|number| Case::draw_sound(world("lag 50 ms"), number, "late meters", 300.0, 30));
    let [beyond, told] = cases.fold([0, 0], |sum, case| {
        let own = raised(&case);
        [sum[0] + own[0].len(), sum[1] + own[1].len()]
    });
    assert!(beyond > 0, "no flow is beyond its threshold");
    assert_eq!(told, 0);
}

#[test]
fn leaks_that_set_in_or_grow_raise_theirs() {
    let (mut all, mut held_back) = (0, Vec::new());
    for (name, number) in ["step", "ramp"].into_iter().flat_map(|name| (0..8).map(move |n| (name, n))) {
        let case = Case::draw(world(name), number, "true alarms", None, 60.0);
        let [beyond, told] = raised(&case);
        for leak in beyond.into_iter().filter(|leak| case.leaks_lpm[*leak] > 0.0) {
            all += 1;
            if !told.contains(&leak) {
                held_back.push((case.key(), leak));
            }
        }
    }
    assert!(all > 8, "{all} alarms");
    assert!(held_back.is_empty(), "of {all} {held_back:?}");
}
