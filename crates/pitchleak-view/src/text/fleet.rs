//! A fleet in short for people: how many cylinders are how, those that ask for somebody, the leaks that differ or grow.

use super::Text;
use crate::Palette;
use crate::envelope::{Envelopes, Spot};
use crate::text::{Bar, INTERVAL, LIMIT, VALUE, course, scale, scale_text};
use pitchleak::core::Leak;
use pitchleak::fleet::{Counts, CylinderLeak, FleetCylinder, FleetReport, Point, count};
use pitchleak::report::Status;
use std::fmt::Write;

/// Lines of a kind in the text.
const LINES: usize = 20;

impl Text for FleetReport<'_> {
    /// How many cylinders are how, and a line for each that asks for somebody, the worst first.
    fn to_text(&self, palette: &Palette) -> String {
        FleetText { report: self, palette, draws: false }.text()
    }
}

/// As [`Text::to_text`], for a terminal that knows Unicode: with a bar of the largest leak in each line, and the course of each
/// leak that grows.
pub fn fleet_terminal(report: &FleetReport<'_>, palette: &Palette) -> String {
    FleetText { report, palette, draws: true }.text()
}

struct FleetText<'a> {
    report: &'a FleetReport<'a>,
    palette: &'a Palette,
    draws: bool,
}

impl FleetText<'_> {
    fn text(&self) -> String {
        let Counts { leak, sound, doubtful, not_sure, error } = self.report.cylinder_counts;
        let mut text = format!(
            "{}: {leak} leak, {sound} sound, {doubtful} doubtful, {not_sure} not sure",
            count(self.report.cylinders, "cylinder")
        );
        if error > 0 {
            let _ = write!(text, ", {error} not judged");
        }
        let _ = write!(text, " ({}", count(self.report.traces, "trace"));
        if self.report.counts.error > 0 {
            let _ = write!(text, ", {} not judged", self.report.counts.error);
        }
        text.push_str(")\n");
        self.write_worst(&mut text);
        self.write_failed(&mut text);
        self.write_differing(&mut text);
        self.write_trends(&mut text);
        self.write_odds(&mut text);
        text
    }

    fn write_worst(&self, text: &mut String) {
        // A cylinder without any verdict stands below, by its traces.
        let worst: Vec<_> = self.report.worst().filter(|cylinder| cylinder.status.is_some()).collect();
        let bars: Vec<Bar> = worst.iter().take(LINES).filter_map(|cylinder| bar(cylinder)).collect();
        let ends = scale(&bars).filter(|_| self.draws);
        let (faint, reset) = self.palette.faint();
        let legend = ends.map_or_else(String::new, |ends| {
            let marks = format!("{VALUE} largest leak  {INTERVAL} 95 %  {LIMIT} alarm level");
            format!("{faint}{:<10}{:<CELLS$}  {marks}{reset}\n", "", scale_text(ends))
        });
        write_lines(text, &legend, &worst, |cylinder| {
            // Blank where the cylinder has no leak to act on.
            let drawn = ends.map_or_else(String::new, |ends| {
                let bar = bar(cylinder).map_or_else(String::new, |bar| bar.text(ends, CELLS));
                format!("{bar:<CELLS$}  ")
            });
            self.line(cylinder, &drawn)
        });
    }

    fn write_failed(&self, text: &mut String) {
        let (colour, reset) = self.palette.caution();
        let failed: Vec<_> = self.report.failed().filter_map(|row| row.error.as_ref()).collect();
        write_lines(text, "", &failed, |error| format!("{colour}ERROR{reset}     {error}"));
    }

    fn write_differing(&self, text: &mut String) {
        write_lines(text, "", &self.report.differing(), |(cylinder, leak, beside)| {
            format!("DIFFERS   {}  {} {}", cylinder.cylinder, leak.label(), beside.text())
        });
    }

    fn line(&self, cylinder: &FleetCylinder, bar: &str) -> String {
        let word = cylinder.word();
        let (colour, reset) =
            cylinder.status.map_or(self.palette.caution(), |status| self.palette.verdict(status));
        let found = found(cylinder, self.report);
        format!("{colour}{word:<8}{reset}  {bar}{}  {found}", cylinder.cylinder)
    }

    fn write_trends(&self, text: &mut String) {
        write_lines(text, "", &self.report.growing(), |(cylinder, leak, long)| {
            let course = if self.draws {
                format!("{:<CELLS$}  ", course_of(self.report, cylinder, *leak))
            } else {
                String::new()
            };
            format!("GROWS     {course}{cylinder}  {} by {}", leak.label(), long.rate())
        });
    }

    fn write_odds(&self, text: &mut String) {
        let Some(odds) = &self.report.odds else { return };
        let lines = odds.to_toml().unwrap_or_else(|| "none: no trace tells what explains it\n".to_owned());
        let _ = write!(
            text,
            "\nodds learnt from {}, for the rig files\n{lines}",
            count(odds.cylinders, "cylinder")
        );
    }
}

/// A line for each, under an empty one and `legend`; beyond so many, how many more there are.
fn write_lines<T>(text: &mut String, legend: &str, all: &[T], line: impl Fn(&T) -> String) {
    if !all.is_empty() {
        text.push('\n');
    }
    text.push_str(legend);
    for one in all.iter().take(LINES) {
        let _ = writeln!(text, "{}", line(one));
    }
    let more = all.len().saturating_sub(LINES);
    if more > 0 {
        let _ = writeln!(text, "… and {more} more");
    }
}

/// What the verdict on a cylinder rests on, since when, and whether its latest trace says otherwise.
pub(crate) fn found(cylinder: &FleetCylinder, report: &FleetReport<'_>) -> String {
    let is_leak = cylinder.status == Some(Status::Leak);
    let leaks = || cylinder.faults.iter().map(|leak| (leak, &cylinder.leaks[*leak]));
    // What a verdict in doubt says lasts as long as the doubt.
    let at_once = !is_leak || leaks().all(|(_, of)| of.since == cylinder.since);
    let doubt = if is_leak { "" } else { " in doubt" };
    let flow = |(leak, of): (&Leak, &CylinderLeak)| {
        let flow = of.flow?;
        let since =
            of.since_text().filter(|_| !at_once).map_or_else(String::new, |since| format!(" {since}"));
        Some(format!("{} {} L/min{doubt}{since}", leak.label(), flow.flow_text()))
    };
    let mut found: Vec<String> = leaks().filter_map(flow).collect();
    found.extend(cylinder.reasons.iter().filter(|_| !is_leak).cloned());
    found.extend(cylinder.since_text().filter(|_| at_once));
    let latest = cylinder.latest.and_then(|place| report.rows.get(place)).and_then(|row| row.status);
    if let Some(latest) = latest.filter(|latest| is_leak && *latest != Status::Leak) {
        found.push(format!("its latest trace is {}", latest.id()));
    }
    found.join(", ")
}

/// Cells of a bar or a course.
const CELLS: usize = 20;

/// What a terminal shows beside a line: the largest leak to act on, against its alarm level.
fn bar(cylinder: &FleetCylinder) -> Option<Bar> {
    let leaks = cylinder.faults.iter().filter_map(|leak| cylinder.leaks[*leak].flow);
    let worst = leaks.max_by(|a, b| a.mean_lpm.total_cmp(&b.mean_lpm))?;
    let value = worst.mean_lpm;
    Some(Bar {
        interval: worst.ci95.unwrap_or([value; 2]),
        value: (value, VALUE),
        limit: worst.threshold_lpm,
    })
}

/// A leak over a cylinder's traces, from none to the largest flow or the alarm level, whichever is more.
fn course_of(report: &FleetReport<'_>, cylinder: &str, leak: Leak) -> String {
    let own = report.rows.iter().filter(|row| row.cylinder == cylinder);
    let mut points: Vec<Point> = own.filter_map(|row| Point::of(row, leak)).collect();
    points.sort_by_key(|point| point.at);
    let Some(first) = points.first().map(|point| point.at) else { return String::new() };
    let top = points.iter().map(|point| point.flow.value.max(point.threshold_lpm)).fold(0.0, f64::max);
    let mut flows = Envelopes::<1>::default();
    for point in &points {
        let t_s = first.duration_until(point.at).as_secs_f64();
        flows.add(t_s, &[Some(Spot::at(point.flow.value))]);
    }
    let [flows] = flows.courses(CELLS);
    course(&flows, [0.0, top])
}
