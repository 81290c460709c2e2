//! Alarms seen from outside.

use pitchleak_core::{AlarmSettings, AlarmState, Estimate, LPM_PER_M3S, LeakDetector, PerLeak};

/// Between the clearing level and the threshold an alarm stays as it was, up or not.
#[test]
fn between_its_levels_an_alarm_stays_as_it_was() {
    let mut detector = LeakDetector::<f64>::new(AlarmSettings::default());
    let mut watch = |lpm: f64| {
        let flow = Estimate { value: lpm / LPM_PER_M3S, std: 0.002 / LPM_PER_M3S };
        let flows = PerLeak { internal: flow, ..PerLeak::default() };
        let changes: Vec<_> = (0..40).filter_map(|_| detector.update(0.25, &flows).internal).collect();
        (changes, detector.active().internal)
    };
    assert_eq!(watch(0.08), (vec![], false));
    assert_eq!(watch(0.3), (vec![AlarmState::Raised], true));
    assert_eq!(watch(0.08), (vec![], true));
    assert_eq!(watch(0.01), (vec![AlarmState::Cleared], false));
}
