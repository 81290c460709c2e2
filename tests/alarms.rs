//! Alarms of a stream against its posterior.

#![allow(clippy::unwrap_used)]

use pitchleak::core::AlarmState;
use pitchleak::live::{Event, LineFormat, LiveConfig, Watch};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::trace::TraceReader;
use pitchleak_testkit::judge::Case;
use pitchleak_testkit::judge::worlds::WORLDS;

/// Meters that lag by 50 ms add up to a leak of thousandths of L/min, again and again, until it is beyond the estimator's own noise.
#[test]
fn meters_that_are_late_raise_no_alarm() {
    let world = WORLDS.iter().find(|world| world.name == "lag 50 ms").unwrap();
    let (mut beyond, mut told) = (0, Vec::new());
    for number in 12..18 {
        let case = Case::draw_sound(world, number, "late meters", 300.0, 30);
        let (trace, _) = case.record();
        let rows = Box::new(std::io::Cursor::new(trace.clone()));
        let mut reader = TraceReader::from_stream("late", rows, &case.rig()).unwrap();
        let report = replay(&mut reader, &case.rig(), |_, _, _| Ok::<(), ReplayError>(())).unwrap();
        beyond += report.alarms.iter().filter(|alarm| alarm.state == AlarmState::Raised).count();
        let (mut watch, mut events) =
            (Watch::new(LiveConfig::of(case.rig()), Some(LineFormat::Csv)), Vec::new());
        trace.split(|byte| *byte == b'\n').for_each(|line| watch.take(line, &mut events));
        watch.finish(&mut events);
        told.extend(events.into_iter().filter(|event| matches!(event, Event::Alarm(_))));
    }
    assert!(beyond > 0, "no flow is beyond its threshold");
    assert!(told.is_empty(), "{told:?}");
}
