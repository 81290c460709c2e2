//! A fleet in short for people: how many of which verdict, the traces that ask for somebody, the leaks that grow.

use super::Text;
use super::fleet_sketch::{Bars, CELLS, course_of};
use crate::Palette;
use pitchleak::core::Leak;
use pitchleak::fleet::{Counts, FleetReport, FleetRow, count};
use pitchleak::report::Status;
use std::fmt::Write;

/// Lines of single traces in the text.
const LINES: usize = 20;

impl Text for FleetReport<'_> {
    /// How many of which verdict, and a line for each trace that asks for somebody, the worst first.
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
        let Counts { leak, sound, doubtful, not_sure, error } = self.report.counts;
        let mut text = format!(
            "{} of {}: {leak} leak, {sound} sound, {doubtful} doubtful, {not_sure} not sure",
            count(self.report.traces, "trace"),
            count(self.report.cylinders, "cylinder")
        );
        if error > 0 {
            let _ = write!(text, ", {error} not judged");
        }
        text.push('\n');
        self.write_worst(&mut text);
        self.write_trends(&mut text);
        text
    }

    fn write_worst(&self, text: &mut String) {
        let worst = self.report.worst();
        let (shown, more) = worst.split_at(worst.len().min(LINES));
        let bars = Bars::of(shown).filter(|_| self.draws);
        if !shown.is_empty() {
            text.push('\n');
        }
        text.push_str(&bars.as_ref().map_or_else(String::new, |bars| bars.legend(self.palette)));
        for row in shown {
            let bar = bars.as_ref().map_or_else(String::new, |bars| bars.text(row));
            text.push_str(&line(row, &bar, self.palette));
        }
        if !more.is_empty() {
            let _ = writeln!(text, "… and {} more", more.len());
        }
    }

    fn write_trends(&self, text: &mut String) {
        let growing = self.report.growing();
        if !growing.is_empty() {
            text.push('\n');
        }
        for (cylinder, leak, long) in growing.iter().take(LINES) {
            let course = if self.draws {
                format!("{:<CELLS$}  ", course_of(self.report, cylinder, *leak))
            } else {
                String::new()
            };
            let _ = writeln!(text, "GROWS     {course}{cylinder}  {} by {}", leak.label(), long.rate());
        }
        if growing.len() > LINES {
            let _ = writeln!(text, "… and {} more", growing.len() - LINES);
        }
    }
}

fn line(row: &FleetRow, bar: &str, palette: &Palette) -> String {
    let word = row.word();
    let (colour, reset) = row.status.map_or(palette.caution(), |status| palette.verdict(status));
    let found = match (&row.error, row.status) {
        (Some(error), _) => error.clone(),
        (None, Some(Status::Leak)) => leaks(row),
        (None, _) => row.reasons.join(", "),
    };
    let place = match &row.error {
        // Names the file by itself.
        Some(_) => String::new(),
        None if row.path.starts_with(&row.cylinder) => format!("{}  ", row.path),
        None => format!("{}  {}  ", row.cylinder, row.path),
    };
    format!("{colour}{word:<8}{reset}  {bar}{place}{found}\n")
}

fn leaks(row: &FleetRow) -> String {
    let flow = |leak: &Leak| {
        let of = row.leaks.map(|leaks| leaks[*leak])?;
        let spread = of.ci95.map_or_else(String::new, |[low, high]| format!(" ± {:.3}", (high - low) / 2.0));
        Some(format!("{} {:.3}{spread} L/min", leak.label(), of.mean_lpm))
    };
    row.faults.iter().filter_map(flow).collect::<Vec<_>>().join(", ")
}
