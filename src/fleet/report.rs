//! A fleet as JSON, and in short for people.

use super::sketch::{Bars, CELLS};
use super::{CylinderTrend, FleetRow, LongTrend};
use crate::report::{Palette, Status};
use pitchleak_core::Leak;
use serde::Serialize;
use std::collections::HashSet;
use std::fmt::Write;

/// What was found of a fleet, as `fleet --json` prints it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FleetReport<'a> {
    /// `pitchleak.fleet/1`.
    pub schema: &'static str,
    /// Traces.
    pub traces: usize,
    /// Cylinders.
    pub cylinders: usize,
    /// Traces by what was found.
    pub counts: Counts,
    /// How leaks change over the traces of a cylinder, where there are three or more with dates.
    pub trends: Vec<CylinderTrend>,
    /// A row per cylinder and trace.
    pub rows: &'a [FleetRow],
}

/// Traces by what was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Oil leaks.
    pub leak: usize,
    /// Nothing leaks.
    pub sound: usize,
    /// Something contradicts the model or the sensors.
    pub doubtful: usize,
    /// The trace says too little.
    pub not_sure: usize,
    /// The trace could not be judged.
    pub error: usize,
}

/// Lines of single traces in the text.
const LINES: usize = 20;

impl<'a> FleetReport<'a> {
    /// Name and version of the JSON form.
    pub const SCHEMA: &'static str = "pitchleak.fleet/1";

    /// The report on `rows`.
    pub fn of(rows: &'a [FleetRow]) -> Self {
        let mut counts = Counts::default();
        for row in rows {
            *match row.status {
                Some(Status::Leak) => &mut counts.leak,
                Some(Status::Sound) => &mut counts.sound,
                Some(Status::Doubtful) => &mut counts.doubtful,
                Some(Status::NotSure) => &mut counts.not_sure,
                None => &mut counts.error,
            } += 1;
        }
        let cylinders = rows.iter().map(|row| row.cylinder.as_str()).collect::<HashSet<_>>().len();
        Self {
            schema: Self::SCHEMA,
            traces: rows.len(),
            cylinders,
            counts,
            trends: CylinderTrend::all(rows),
            rows,
        }
    }

    /// JSON.
    ///
    /// # Errors
    /// None in practice: every field has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }

    /// How many of which verdict, and a line for each trace that asks for somebody, the worst first.
    pub fn to_text(&self, palette: &Palette) -> String {
        self.text(palette, false)
    }

    /// The same for a terminal that knows Unicode: with a bar of the largest leak in each line, and the course of each leak
    /// that grows.
    pub fn to_terminal(&self, palette: &Palette) -> String {
        self.text(palette, true)
    }

    fn text(&self, palette: &Palette, draws: bool) -> String {
        let Counts { leak, sound, doubtful, not_sure, error } = self.counts;
        let mut text = format!(
            "{} of {}: {leak} leak, {sound} sound, {doubtful} doubtful, {not_sure} not sure",
            count(self.traces, "trace"),
            count(self.cylinders, "cylinder")
        );
        if error > 0 {
            let _ = write!(text, ", {error} not judged");
        }
        text.push('\n');
        self.write_worst(&mut text, palette, draws);
        self.write_trends(&mut text, draws);
        text
    }

    fn write_worst(&self, text: &mut String, palette: &Palette, draws: bool) {
        let worst = self.worst();
        let (shown, more) = worst.split_at(worst.len().min(LINES));
        let bars = Bars::of(shown).filter(|_| draws);
        if !shown.is_empty() {
            text.push('\n');
        }
        text.push_str(&bars.as_ref().map_or_else(String::new, |bars| bars.legend(palette)));
        for row in shown {
            let bar = bars.as_ref().map_or_else(String::new, |bars| bars.text(row));
            text.push_str(&line(row, &bar, palette));
        }
        if !more.is_empty() {
            let _ = writeln!(text, "… and {} more", more.len());
        }
    }

    /// The traces that ask for somebody, the worst first.
    pub(crate) fn worst(&self) -> Vec<&'a FleetRow> {
        let urgency = |row: &FleetRow| match row.status {
            Some(Status::Leak) => 0,
            Some(Status::Doubtful) => 1,
            Some(Status::NotSure) => 2,
            None => 3,
            Some(Status::Sound) => 4,
        };
        let mut worst: Vec<_> = self.rows.iter().filter(|row| row.status != Some(Status::Sound)).collect();
        worst.sort_by(|a, b| urgency(a).cmp(&urgency(b)).then(b.worst_lpm().total_cmp(&a.worst_lpm())));
        worst
    }

    /// The leaks that grow from trace to trace beyond doubt, the fastest first, with their cylinders.
    pub(crate) fn growing(&self) -> Vec<(&str, Leak, &LongTrend)> {
        let mut growing = Vec::new();
        for CylinderTrend { cylinder, leaks } in &self.trends {
            let known = leaks.iter().filter_map(|(leak, long)| Some((leak, long.as_ref()?)));
            let grows = known.filter(|(_, long)| long.grows());
            growing.extend(grows.map(|(leak, long)| (cylinder.as_str(), leak, long)));
        }
        growing.sort_by(|(_, _, a), (_, _, b)| b.trend.slope_lpm_per_h.total_cmp(&a.trend.slope_lpm_per_h));
        growing
    }

    fn write_trends(&self, text: &mut String, draws: bool) {
        let growing = self.growing();
        if !growing.is_empty() {
            text.push('\n');
        }
        for (cylinder, leak, long) in growing.iter().take(LINES) {
            let course =
                if draws { format!("{:<CELLS$}  ", self.course(cylinder, *leak)) } else { String::new() };
            let _ = writeln!(text, "GROWS     {course}{cylinder}  {} by {}", leak.label(), long.rate());
        }
        if growing.len() > LINES {
            let _ = writeln!(text, "… and {} more", growing.len() - LINES);
        }
    }
}

/// With an `s` behind many.
pub(crate) fn count(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
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
