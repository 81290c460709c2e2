//! What a terminal shows of a replay beside the text.

#![allow(clippy::unwrap_used)]

use pitchleak::core::PerLeak;
use pitchleak::replay::Replay;
use pitchleak::report::TraceSummary;
use pitchleak::rig::Rig;
use pitchleak::simulate::Normal;
use pitchleak::trace::{Record, TraceQuality};
use pitchleak_testkit::Motion;
use pitchleak_view::text::ReplaySketch;
use pitchleak_view::{Palette, Text};

/// Records at 100 Hz of a cylinder that leaks; a pause of a minute comes before the records `gaps`.
fn records(gaps: &[usize]) -> Vec<Record> {
    let leaks = PerLeak { internal: 1e-11, external_a: 0.0, external_b: 0.0 };
    let (mut t_s, mut normal) = (0.0, Normal::stream(1, 0));
    let read = |(k, mut sample): (usize, pitchleak::core::Sample<f64>)| {
        sample.qa_m3s = sample.qa_m3s.map(|flow| flow + 1e-6 * normal.draw());
        let after_gap = gaps.contains(&k);
        let dt_s = if k == 0 {
            0.0
        } else if after_gap {
            60.0
        } else {
            0.01
        };
        t_s += dt_s;
        Record { t_s, dt_s, after_gap, sample, ..Record::default() }
    };
    Motion::wind_like(leaks).samples(20).into_iter().enumerate().map(read).collect()
}

#[test]
fn a_terminal_sees_the_course_of_each_leak_and_its_pause() {
    let rig = Rig::paper();
    let (mut replay, mut sketch) = (Replay::new(&rig).expect("the paper's rig"), ReplaySketch::new(&rig));
    for record in records(&[1000]) {
        let renewed = replay.push(&record);
        sketch.add(&replay, &record, renewed);
    }
    let courses = sketch.courses_lpm(40);
    assert_eq!(courses.internal.len(), 40);
    let pause = courses.internal.iter().filter(|flow| flow.is_none()).count();
    // A minute of 80 s.
    assert!((25..35).contains(&pause), "{courses:?}");
    let usual = courses.internal.iter().flatten().filter(|flow| **flow > 0.1).count();
    assert!(usual + 2 >= 40 - pause, "{courses:?}");
    let report = replay.report(TraceSummary::new("trace", &TraceQuality::default()));
    let palette = Palette::PLAIN;
    let shown = sketch.to_text(&report, &palette);
    assert!(shown.contains("███     ") && shown.contains('●'), "{shown}");
    assert!(!report.to_text(&palette).contains(['█', '●', '┊']));
}
