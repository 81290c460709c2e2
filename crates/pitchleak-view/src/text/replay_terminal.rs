//! What a terminal can show beside the text: each leak's interval against its alarm level, and its course.

use super::thresholds_lpm;
use crate::Palette;
use crate::bar::{Bar, INTERVAL, LIMIT, VALUE, course, scale, scale_text};
use crate::envelope::{Envelopes, Spot};
use pitchleak::core::{Leak, PerLeak};
use pitchleak::replay::Replay;
use pitchleak::report::ReplayReport;
use pitchleak::rig::Rig;
use pitchleak::trace::Record;
use pitchleak::units::LPM_PER_M3S;
use std::fmt::Write;

/// Cells of a bar.
const BAR: usize = 32;
/// Cells of a course.
const COURSE: usize = 60;

/// Writes the bars, on one scale for all leaks.
pub(super) fn write_bars(out: &mut String, report: &ReplayReport, sketch: &ReplaySketch, palette: &Palette) {
    let known = Leak::ALL.into_iter().filter(|leak| report.estimates.leaks()[*leak].identifiable);
    let bars: Vec<(Leak, Bar)> =
        known.map(|leak| (leak, Bar::of(&report.leakage[leak], sketch.threshold_lpm[leak]))).collect();
    let Some(ends) = scale(bars.iter().map(|(_, bar)| bar)) else { return };
    let (faint, reset) = palette.faint();
    let range = scale_text(ends);
    let _ = writeln!(
        out,
        "\n{faint}{:<12}{range:<width$}  {VALUE} now  {INTERVAL} 95 %  {LIMIT} alarm level{reset}",
        "leak",
        width = BAR
    );
    for (leak, bar) in bars {
        let _ = writeln!(out, "{:<12}{}", leak.label(), bar.text(ends, BAR).trim_end());
    }
}

/// Writes how large each leak was over the trace; what is above the alarm level stands out.
pub(super) fn write_courses(
    out: &mut String,
    report: &ReplayReport,
    sketch: &ReplaySketch,
    palette: &Palette,
) {
    let courses = sketch.courses_lpm(COURSE);
    let mut flows: Vec<f64> =
        courses.iter().flat_map(|(_, course)| course.iter().flatten().copied()).collect();
    if flows.is_empty() {
        return;
    }
    flows.sort_by(f64::total_cmp);
    // What is usual: estimates begin anywhere.
    let usual = flows.get(flows.len() * 98 / 100).or(flows.last()).copied().unwrap_or(0.0);
    let threshold_lpm = sketch.threshold_lpm;
    let top = threshold_lpm.iter().map(|(_, threshold)| *threshold).fold(usual, f64::max);
    let (faint, reset) = palette.faint();
    let _ = writeln!(out, "\n{faint}{:<12}over the trace, from 0 to {top:.2} L/min{reset}", "leak");
    for (leak, course) in courses.iter() {
        let _ = writeln!(out, "{:<12}{}", leak.label(), line(course, threshold_lpm[leak], top, palette));
    }
    let [from, to] = sketch.ends_s.unwrap_or_default().map(|t_s| report.trace.time(t_s, 0));
    let width = courses.internal.len();
    let _ = writeln!(
        out,
        "{faint}{:<12}{from}{to:>rest$}{reset}",
        "",
        rest = width.saturating_sub(from.chars().count())
    );
}

fn line(flows: &[Option<f64>], threshold_lpm: f64, top: f64, palette: &Palette) -> String {
    let mut text = String::new();
    let same = |a: &Option<f64>, b: &Option<f64>| is_above(a, threshold_lpm) == is_above(b, threshold_lpm);
    for run in flows.chunk_by(same) {
        let above = run.first().is_some_and(|flow| is_above(flow, threshold_lpm));
        let (colour, reset) = if above { palette.fault() } else { ("", "") };
        text += colour;
        text += &course(run, [0.0, top]);
        text += reset;
    }
    text.trim_end().to_owned()
}

fn is_above(flow: &Option<f64>, threshold_lpm: f64) -> bool {
    flow.is_some_and(|flow| flow >= threshold_lpm)
}

/// Stretches of the trace that are kept at most.
const STRETCHES: usize = 480;

/// What a terminal shows of a replay beside its text, gathered on the way in a few kilobytes: how large each leak was over the
/// trace, beside its alarm level.
#[derive(Clone, Debug)]
pub struct ReplaySketch {
    flows_lpm: Envelopes<3>,
    threshold_lpm: PerLeak<f64>,
    ends_s: Option<[f64; 2]>,
}

impl ReplaySketch {
    /// Of a replay by `rig` that has not begun.
    pub fn new(rig: &Rig) -> Self {
        Self { flows_lpm: Envelopes::of_at_most(STRETCHES), threshold_lpm: thresholds_lpm(rig), ends_s: None }
    }

    /// Takes in a record, and the replay that has taken it in before; `renewed` where its estimates are new.
    pub fn add(&mut self, replay: &Replay, record: &Record, renewed: bool) {
        if record.after_gap {
            self.flows_lpm.pause();
        }
        let [first_s, _] = self.ends_s.unwrap_or([record.t_s; 2]);
        self.ends_s = Some([first_s, record.t_s]);
        if !renewed {
            return;
        }
        let flows = replay.watched_flows_m3s();
        let spots = Leak::ALL.map(|leak| Some(Spot::at(flows[leak].value * LPM_PER_M3S)));
        self.flows_lpm.add(record.t_s, &spots);
    }

    /// Each leak's flow over the trace in at most `columns` stretches of the same length, L/min; none where it pauses.
    pub fn courses_lpm(&self, columns: usize) -> PerLeak<Vec<Option<f64>>> {
        let courses = self.flows_lpm.courses(columns);
        PerLeak::from_fn(|leak| courses.get(leak as usize).cloned().unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_course_is_empty_where_the_trace_pauses_and_stands_out_above_the_alarm_level() {
        let course = [Some(0.0), Some(0.05), None, Some(0.4), Some(9.0), Some(-1.0)];
        assert_eq!(line(&course, 0.1, 0.4, &Palette::PLAIN), "▁▂ ██▁");
        assert_eq!(line(&course, 0.1, 0.4, &Palette::ANSI), "▁▂ \x1b[1;31m██\x1b[0m▁");
    }
}
