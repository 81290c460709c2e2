//! What a terminal can show beside the text: each leak's interval against its alarm level, and its course.

use super::text::Palette;
use super::{Leakage, ReplayReport};
use crate::replay::Sketch;
use crate::spark::level;
use pitchleak_core::{Estimate, Leak};
use std::fmt::Write;

/// Cells of a bar.
const BAR: usize = 32;
/// Cells of a course.
const COURSE: usize = 60;

/// What stands in a cell of a bar, later ones over earlier ones.
const ZERO: char = '│';
const INTERVAL: char = '━';
const LIMIT: char = '┊';
const VALUE: char = '●';

/// Writes the bars, on one scale for all leaks.
pub(super) fn write_bars(out: &mut String, report: &ReplayReport, sketch: &Sketch, palette: &Palette) {
    let known: Vec<_> =
        Leak::ALL.into_iter().filter(|leak| report.estimates.leaks()[*leak].identifiable).collect();
    let ends = known.iter().flat_map(|leak| {
        let [low, high] = interval(&report.leakage[*leak]);
        [low, high, sketch.threshold_lpm()[*leak]]
    });
    let ends = ends.filter(|end| end.is_finite());
    let (low, high) = ends.fold((0.0_f64, 0.0_f64), |(low, high), end| (low.min(end), high.max(end)));
    if known.is_empty() || high <= low {
        return;
    }
    let (faint, reset) = palette.faint();
    // No minus before a zero.
    let from = if low > -0.005 { 0.0 } else { low };
    let scale = format!("{from:.2} to {high:.2} L/min");
    let _ = writeln!(
        out,
        "\n{faint}{:<12}{scale:<width$}  {VALUE} now  {INTERVAL} 95 %  {LIMIT} alarm level{reset}",
        "leak",
        width = BAR
    );
    for leak in known {
        let bar = bar(&report.leakage[leak], sketch.threshold_lpm()[leak], [low, high]);
        let _ = writeln!(out, "{:<12}{}", leak.label(), bar.trim_end());
    }
}

fn interval(leakage: &Leakage) -> [f64; 2] {
    let value = leakage.mean_lpm;
    leakage.std_lpm.map_or([value; 2], |std| Estimate { value, std }.ci95())
}

fn bar(leakage: &Leakage, threshold_lpm: f64, [low, high]: [f64; 2]) -> String {
    let cell =
        |value: f64| (((value - low) / (high - low)).clamp(0.0, 1.0) * (BAR - 1) as f64).round() as usize;
    let mut cells = [' '; BAR];
    let mut put = |at: usize, mark: char| cells.iter_mut().skip(at).take(1).for_each(|cell| *cell = mark);
    put(cell(0.0), ZERO);
    let [from, to] = interval(leakage).map(cell);
    (from..=to).for_each(|at| put(at, INTERVAL));
    put(cell(threshold_lpm), LIMIT);
    put(cell(leakage.mean_lpm), VALUE);
    cells.into_iter().collect()
}

/// Writes how large each leak was over the trace; what is above the alarm level stands out.
pub(super) fn write_courses(out: &mut String, report: &ReplayReport, sketch: &Sketch, palette: &Palette) {
    let courses = sketch.courses_lpm(COURSE);
    let mut flows: Vec<f64> =
        courses.iter().flat_map(|(_, course)| course.iter().flatten().copied()).collect();
    if flows.is_empty() {
        return;
    }
    flows.sort_by(f64::total_cmp);
    // What is usual: estimates begin anywhere.
    let usual = flows.get(flows.len() * 98 / 100).or(flows.last()).copied().unwrap_or(0.0);
    let threshold_lpm = sketch.threshold_lpm();
    let top = threshold_lpm.iter().map(|(_, threshold)| *threshold).fold(usual, f64::max);
    let (faint, reset) = palette.faint();
    let _ = writeln!(out, "\n{faint}{:<12}over the trace, from 0 to {top:.2} L/min{reset}", "leak");
    for (leak, course) in courses.iter() {
        let _ = writeln!(out, "{:<12}{}", leak.label(), line(course, threshold_lpm[leak], top, palette));
    }
    let [from, to] = sketch.ends_s().map(|t_s| report.trace.time(t_s, 0));
    let width = courses.internal.len();
    let _ = writeln!(
        out,
        "{faint}{:<12}{from}{to:>rest$}{reset}",
        "",
        rest = width.saturating_sub(from.chars().count())
    );
}

fn line(course: &[Option<f64>], threshold_lpm: f64, top: f64, palette: &Palette) -> String {
    let mut text = String::new();
    let same = |a: &Option<f64>, b: &Option<f64>| is_above(a, threshold_lpm) == is_above(b, threshold_lpm);
    for run in course.chunk_by(same) {
        let above = run.first().is_some_and(|flow| is_above(flow, threshold_lpm));
        let (colour, reset) = if above { palette.fault() } else { ("", "") };
        let marks = run.iter().map(|flow| flow.map_or(' ', |flow| level(flow / top)));
        text.extend(colour.chars().chain(marks).chain(reset.chars()));
    }
    text.trim_end().to_owned()
}

fn is_above(flow: &Option<f64>, threshold_lpm: f64) -> bool {
    flow.is_some_and(|flow| flow >= threshold_lpm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_shows_value_interval_and_alarm_level() {
        let leakage = Leakage { mean_lpm: 0.5, std_lpm: Some(0.05), net_mean_lpm: None };
        assert_eq!(bar(&leakage, 0.1, [0.0, 0.62]), "│    ┊              ━━━━━●━━━━━ ");
        let unsure = Leakage { std_lpm: None, ..leakage };
        assert_eq!(bar(&unsure, 0.5, [0.0, 0.5]).trim_end(), format!("│{}●", " ".repeat(30)));
    }

    #[test]
    fn a_course_is_empty_where_the_trace_pauses_and_stands_out_above_the_alarm_level() {
        let course = [Some(0.0), Some(0.05), None, Some(0.4), Some(9.0), Some(-1.0)];
        assert_eq!(line(&course, 0.1, 0.4, &Palette::PLAIN), "▁▂ ██▁");
        assert_eq!(line(&course, 0.1, 0.4, &Palette::ANSI), "▁▂ \x1b[1;31m██\x1b[0m▁");
    }
}
