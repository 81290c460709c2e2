//! A fleet as text: counts, the worst first, and on a terminal bars and courses.

#![allow(clippy::unwrap_used)]

use jiff::Timestamp;
use pitchleak::core::{Leak, PerLeak};
use pitchleak::fleet::{FleetReport, FleetRig, FleetRow, FleetTrace, judge_all};
use pitchleak::report::Status;
use pitchleak_testkit::Motion;
use pitchleak_testkit::rig::PAPER;
use pitchleak_testkit::trace_text::file;
use pitchleak_view::text::fleet_terminal;
use pitchleak_view::{Palette, Text};
use std::fs;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

/// Two cylinders of one farm, each with a rig and two days; one file of the second is no trace.
fn farm() -> TempDir {
    let farm = TempDir::new().unwrap();
    for (blade, internal) in [("B1", 1.2e-11), ("B2", 0.0)] {
        let folder = farm.path().join("T7").join(blade);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("rig.toml"), PAPER).unwrap();
        let motion = Motion::sines(PerLeak { internal, external_a: 0.0, external_b: 0.0 });
        fs::write(folder.join("2026-05-01.csv"), file(&motion.rows(3000))).unwrap();
        fs::write(folder.join("2026-05-02.csv"), file(&motion.rows(1500))).unwrap();
    }
    fs::write(farm.path().join("T7/B2/2026-05-02.csv"), "no trace\n1\n").unwrap();
    farm
}

fn pattern(farm: &TempDir, pattern: &str) -> Vec<String> {
    vec![farm.path().join(pattern).display().to_string()]
}

fn rows(farm: &TempDir, glob: &str) -> Vec<FleetRow> {
    let traces = FleetTrace::find(&pattern(farm, glob), &FleetRig::Beside).unwrap();
    judge_all(&traces, |_| (), &AtomicBool::new(false)).unwrap()
}

#[test]
fn the_text_has_the_worst_first() {
    let farm = farm();
    let rows = rows(&farm, "**/*.csv");
    let text = FleetReport::of(&rows).to_text(&Palette::PLAIN);
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(lines[0], "2 cylinders: 1 leak, 1 sound, 0 doubtful, 0 not sure (4 traces, 1 not judged)");
    assert!(lines[2].starts_with("LEAK") && lines[2].contains("/T7/B1  internal 1."), "{text}");
    assert!(lines[2].ends_with(" L/min, since 2026-05-01 or before"), "{text}");
    assert!(lines[4].starts_with("ERROR") && lines.len() == 5, "{text}");
}

#[test]
fn a_leaking_cylinder_is_one_line_that_says_since_when_and_what_its_latest_trace_says() {
    let farm = farm();
    let mut rows = rows(&farm, "**/*.csv");
    for row in &mut rows {
        row.cylinder = "T7/B1".to_owned();
    }
    let doubtful = FleetRow { status: Some(Status::Doubtful), ..rows[1].clone() };
    let days = [
        FleetRow { begins: day(1), ..rows[2].clone() },
        FleetRow { begins: day(2), ..rows[0].clone() },
        FleetRow { begins: day(3), ..doubtful },
    ];
    let text = FleetReport::of(&days).to_text(&Palette::PLAIN);
    let line = text.lines().nth(2).unwrap();
    assert!(line.starts_with("LEAK      T7/B1  internal 1."), "{text}");
    assert!(line.ends_with(" L/min, since 2026-05-02, its latest trace is doubtful"), "{text}");
    assert_eq!(text.lines().count(), 3, "{text}");
    let reasons = vec!["undecided".to_owned()];
    let unsure = [FleetRow { status: Some(Status::NotSure), reasons, begins: day(1), ..rows[0].clone() }];
    let text = FleetReport::of(&unsure).to_text(&Palette::PLAIN);
    assert!(
        text.contains("NOT SURE  T7/B1  internal 1.") && text.contains(" L/min in doubt, undecided"),
        "{text}"
    );
    let mut both = FleetRow { begins: day(4), ..rows[0].clone() };
    both.faults.push(Leak::ExternalB);
    let text = FleetReport::of(&[&days[..], &[both]].concat()).to_text(&Palette::PLAIN);
    let line = text.lines().nth(2).unwrap();
    assert!(
        line.contains(" L/min since 2026-05-02, external B ") && line.ends_with("since 2026-05-04"),
        "{text}"
    );
}

#[test]
fn a_blade_that_leaks_more_than_its_siblings_has_a_line() {
    let farm = farm();
    let rows = rows(&farm, "T7/B2/2026-05-01.csv");
    let mut days = Vec::new();
    for (number, flow) in [(1, 0.01), (2, 0.012), (3, 0.011), (4, 0.012)] {
        for (blade, more) in [("B1", 0.0), ("B2", 0.05), ("B3", 0.0)] {
            let mut row =
                FleetRow { begins: day(number), cylinder: format!("T7/{blade}"), ..rows[0].clone() };
            let leak = &mut row.leaks.as_mut().unwrap().internal;
            (leak.mean_lpm, leak.std_lpm) = (flow + more, Some(0.001));
            days.push(row);
        }
    }
    let text = FleetReport::of(&days).to_text(&Palette::PLAIN);
    let differs: Vec<_> = text.lines().filter(|line| line.starts_with("DIFFERS")).collect();
    assert!(
        matches!(differs[..], [line] if line.starts_with("DIFFERS   T7/B2  internal 0.050")
            && line.ends_with(" L/min more than its 2 siblings")),
        "{text}"
    );
}

fn day(number: i8) -> Option<Timestamp> {
    format!("2026-05-{number:02}T00:00:00Z").parse().ok()
}

#[test]
fn a_terminal_sees_each_line_beside_its_alarm_level() {
    let farm = farm();
    let rows = rows(&farm, "**/*.csv");
    let report = FleetReport::of(&rows);
    let [plain, shown] = [report.to_text(&Palette::PLAIN), fleet_terminal(&report, &Palette::PLAIN)];
    assert!(!plain.contains(['●', '┊']));
    let lines: Vec<_> = shown.lines().collect();
    assert!(lines[2].trim_start().starts_with("0.00 to 1.") && lines[2].ends_with("alarm level"), "{shown}");
    let bar: String = lines[3].chars().skip(10).take(20).collect();
    assert!(lines[3].starts_with("LEAK      │┊    ") && bar.trim_end().ends_with(['●', '━']), "{shown}");
    assert!(lines[5].starts_with("ERROR     "), "{shown}");
    let sound: Vec<_> = rows.into_iter().filter(|row| row.error.is_none() && row.faults.is_empty()).collect();
    let report = FleetReport::of(&sound);
    assert_eq!(fleet_terminal(&report, &Palette::PLAIN), report.to_text(&Palette::PLAIN));
}

#[test]
fn a_terminal_sees_the_course_of_a_leak_that_grows_from_day_to_day() {
    let farm = TempDir::new().unwrap();
    for day in 1..=5 {
        let internal = 0.8e-12 + 0.5e-12 * f64::from(day);
        let motion = Motion::sines(PerLeak { internal, external_a: 0.0, external_b: 0.0 });
        fs::write(farm.path().join(format!("2026-05-0{day}.csv")), file(&motion.rows(2000))).unwrap();
    }
    fs::write(farm.path().join("rig.toml"), PAPER).unwrap();
    let rows = rows(&farm, "*.csv");
    let shown = fleet_terminal(&FleetReport::of(&rows), &Palette::PLAIN);
    let line = shown.lines().find(|line| line.starts_with("GROWS")).unwrap();
    let course: String = line.chars().skip(10).take_while(|mark| *mark != ' ').collect();
    assert!(course.chars().count() == 5 && course.ends_with("▇█"), "{shown}");
}
