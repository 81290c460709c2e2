//! A fleet as text: counts, the worst first, and on a terminal bars and courses.

#![allow(clippy::unwrap_used)]

use pitchleak::core::PerLeak;
use pitchleak::fleet::{FleetReport, FleetRig, FleetRow, FleetTrace, judge_all};
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
    assert_eq!(lines[0], "4 traces of 2 cylinders: 2 leak, 1 sound, 0 doubtful, 0 not sure, 1 not judged");
    assert!(lines[2].starts_with("LEAK") && lines[2].contains("internal 1."), "{text}");
    assert!(lines[4].starts_with("ERROR") && lines.len() == 5, "{text}");
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
    for line in &lines[3..5] {
        let bar: String = line.chars().skip(10).take(20).collect();
        assert!(line.starts_with("LEAK      │┊    ") && bar.trim_end().ends_with(['●', '━']), "{shown}");
    }
    assert!(lines[5].starts_with(&format!("ERROR{}", " ".repeat(27))), "{shown}");
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
