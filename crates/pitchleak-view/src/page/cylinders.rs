//! A fleet's cylinders: those of a turbine beside each other, each with its course and its traces.

use super::Tone;
use super::history::ink;
use super::machine::{prose, short, table};
use crate::envelope::{Envelopes, Row, Spot, extremes};
use crate::text;
use jiff::Timestamp;
use maud::{Markup, html};
use pitchleak::core::Leak;
use pitchleak::fleet::{Counts, FleetCylinder, FleetLeak, FleetReport, FleetRow, count};
use pitchleak::report::capital;
use pitchleak::units::S_PER_DAY;
use std::collections::HashMap;
use std::fmt::Write;

/// Cylinders that a page shows: beyond, JSON is the place to look.
const MOST_CARDS: usize = 300;
/// Traces that it shows of all cylinders together: beyond, the table that `--out` writes is.
const MOST_ROWS: usize = 2000;

/// What the verdict on a cylinder rests on, in words.
pub fn found(cylinder: &FleetCylinder, report: &FleetReport<'_>) -> String {
    text::found(cylinder, report).replace('_', " ")
}

/// Date and time.
pub fn moment(at: Timestamp) -> String {
    at.strftime("%Y-%m-%d %H:%M").to_string()
}

/// A card for each cylinder, those of a turbine beside each other, the turbine with the worst first.
pub fn cards(report: &FleetReport<'_>) -> Markup {
    if report.by_cylinder.is_empty() {
        return html! { p { "There is none." } };
    }
    let mut rows_left = MOST_ROWS;
    let mut turbines = Vec::new();
    for (name, cylinders) in by_turbine(report) {
        turbines.push(turbine(name, &cylinders, report, &mut rows_left));
    }
    let more = report.by_cylinder.len().saturating_sub(MOST_CARDS);
    html! {
        p .note {
            "Leaks from trace to trace with their 95 % intervals, on one scale for cylinders beside each other; dashed: alarm level; without those in doubt. "
            @for leak in Leak::ALL { span .key { span class={ "swatch " (ink(leak).class()) } {} " " (leak.label()) } " " }
        }
        @for turbine in turbines { (turbine) }
        @if more > 0 { p { "… and " (more) " more: " code { "--json" } " has all." } }
    }
}

fn by_turbine<'a>(report: &'a FleetReport<'_>) -> Vec<(&'a str, Vec<&'a FleetCylinder>)> {
    let mut turbines: Vec<(&str, Vec<&FleetCylinder>)> = Vec::new();
    let mut known: HashMap<&str, usize> = HashMap::new();
    for cylinder in report.by_cylinder.iter().take(MOST_CARDS) {
        let name = cylinder.turbine().unwrap_or_default();
        let at = *known.entry(name).or_insert(turbines.len());
        match turbines.get_mut(at) {
            Some((_, own)) => own.push(cylinder),
            None => turbines.push((name, vec![cylinder])),
        }
    }
    // In a folder that is no turbine, the worst stands first.
    for (_, own) in turbines.iter_mut().filter(|(_, own)| own.len() <= FleetCylinder::MOST_OF_A_TURBINE) {
        own.sort_by(|a, b| a.cylinder.cmp(&b.cylinder));
    }
    turbines
}

fn turbine(
    name: &str,
    cylinders: &[&FleetCylinder],
    report: &FleetReport<'_>,
    rows_left: &mut usize,
) -> Markup {
    let scale = Scale::of(cylinders, report);
    let mut cards = Vec::new();
    for cylinder in cylinders {
        let shown = cylinder.rows.len().min(*rows_left);
        *rows_left -= shown;
        cards.push(card(cylinder, report, &scale, shown));
    }
    html! {
        @if !name.is_empty() { h3 { bdi { (name) } } }
        div .blades { @for card in cards { (card) } }
    }
}

fn card(cylinder: &FleetCylinder, report: &FleetReport<'_>, scale: &Scale, shown: usize) -> Markup {
    let tone = cylinder.status.map_or(Tone::Caution, Tone::from);
    let name = cylinder.turbine().and_then(|turbine| cylinder.cylinder.get(turbine.len() + 1..));
    html! {
        article .card {
            p .head { strong { bdi { (name.unwrap_or(&cylinder.cylinder)) } } " " strong class=(tone.class()) { (cylinder.word()) } }
            p { (capital(&found(cylinder, report))) }
            (scale.draw(cylinder, report))
            @for (leak, of) in cylinder.leaks.iter() {
                @if let Some(beside) = of.differing() { p .is-caution { (capital(leak.label())) ": " (beside.text()) "." } }
                @if let Some(long) = of.trend.filter(|long| long.grows()) { p { (capital(leak.label())) " grows by " (long.rate()) "." } }
            }
            details {
                summary { (behind(cylinder)) }
                (traces(cylinder, report, shown))
            }
        }
    }
}

fn behind(cylinder: &FleetCylinder) -> String {
    let Counts { leak, sound, doubtful, not_sure, error } = cylinder.counts;
    let parts = [
        (leak, "leak"),
        (sound, "sound"),
        (doubtful, "doubtful"),
        (not_sure, "not sure"),
        (error, "not judged"),
    ];
    let parts = parts.iter().filter(|(number, _)| *number > 0);
    let parts: Vec<_> = parts.map(|(number, what)| format!("{number} {what}")).collect();
    format!("{}: {}", count(cylinder.traces, "trace"), parts.join(", "))
}

/// The latest first.
fn traces(cylinder: &FleetCylinder, report: &FleetReport<'_>, shown: usize) -> Markup {
    let rows = cylinder.rows.iter().rev().filter_map(|place| report.rows.get(*place));
    let more = cylinder.rows.len() - shown;
    let leaks = Leak::ALL.map(|leak| format!("#{}, L/min", leak.label()));
    html! {
        (table(&["begins", "verdict", &leaks[0], &leaks[1], &leaks[2], "#minutes", "trace"], html! {
            @for row in rows.take(shown) { (line(row)) }
        }))
        @if more > 0 { p { "… and " (more) " more: the table that " code { "--out" } " writes has all." } }
    }
}

fn line(row: &FleetRow) -> Markup {
    let tone = row.status.map_or(Tone::Caution, Tone::from);
    html! {
        tr {
            th scope="row" { (row.begins.map_or_else(|| "–".to_owned(), moment)) }
            td class=(tone.class()) { (row.word()) }
            @for leak in Leak::ALL {
                td .number { @match row.leaks.map(|leaks| leaks[leak]) {
                    Some(leak) if leak.identifiable => (leak.flow_text()),
                    _ => "–",
                } }
            }
            td .number { (row.duration_s.map_or_else(|| "–".to_owned(), |s| short(s / 60.0))) }
            td { (said(row)) }
        }
    }
}

/// Which file it is, and why its verdict is in doubt, or there is none.
fn said(row: &FleetRow) -> Markup {
    let reasons = row.reasons.iter().map(|id| id.replace('_', " ")).collect::<Vec<_>>().join(", ");
    match &row.error {
        Some(error) if error.contains(&row.path) => prose(error),
        Some(error) => html! { bdi { (row.path) } ": " (prose(error)) },
        None if reasons.is_empty() => html! { bdi { (row.path) } },
        None => html! { bdi { (row.path) } ": " (reasons) },
    }
}

/// Size of a course of leaks, small enough to stand in a row.
const WIDTH: f64 = 240.0;
const HEIGHT: f64 = 64.0;
const MARGIN: f64 = 4.0;
/// Points of a line: about one for each of its dots' widths.
const MOST_POINTS: usize = 64;

/// One scale for cylinders that stand beside each other.
struct Scale {
    /// The earliest trace; none where not all have dates: then they stand in their order.
    from_s: Option<f64>,
    length: f64,
    top_lpm: f64,
    thresholds_lpm: Vec<f64>,
}

impl Scale {
    /// Over all traces of some cylinders, from no leak to the largest flow or alarm level.
    fn of(cylinders: &[&FleetCylinder], report: &FleetReport<'_>) -> Self {
        let rows: Vec<_> = cylinders.iter().flat_map(|cylinder| judged(cylinder, report)).collect();
        let times: Option<Vec<f64>> = rows.iter().map(|row| begin_s(row)).collect();
        let ends = times.map(extremes);
        let most = cylinders.iter().map(|cylinder| judged(cylinder, report).count()).max().unwrap_or(0);
        let flows =
            || rows.iter().filter_map(|row| row.leaks).flat_map(|leaks| Leak::ALL.map(|leak| leaks[leak]));
        let seen = flows().filter(|flow| flow.identifiable).map(|flow| flow.mean_lpm);
        let mut thresholds_lpm: Vec<f64> = flows().map(|flow| flow.threshold_lpm).collect();
        thresholds_lpm.sort_by(f64::total_cmp);
        thresholds_lpm.dedup();
        Self {
            from_s: ends.map(|[from, _]| from),
            length: ends.map_or(most.saturating_sub(1) as f64, |[from, to]| to - from),
            top_lpm: seen.chain(thresholds_lpm.iter().copied()).fold(0.0, f64::max),
            thresholds_lpm,
        }
    }

    fn x(&self, t: f64) -> f64 {
        let share = if self.length > 0.0 { t / self.length } else { 0.5 };
        MARGIN + (WIDTH - 2.0 * MARGIN) * share
    }

    fn y(&self, lpm: f64) -> f64 {
        let share = (lpm / self.top_lpm.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        HEIGHT - MARGIN - (HEIGHT - 2.0 * MARGIN) * share
    }

    /// Dots with their 95 % intervals, a colour for each leak, the alarm levels dashed.
    fn draw(&self, cylinder: &FleetCylinder, report: &FleetReport<'_>) -> Markup {
        let rows = self.rows(cylinder, report);
        let level = |lpm: &f64| format!("M0 {y:.1}H{WIDTH}", y = self.y(*lpm));
        html! {
            svg .course viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(self.label(cylinder)) {
                path .axis d=(format!("M0 {y:.1}H{WIDTH}", y = self.y(0.0))) {}
                path .limit d=(self.thresholds_lpm.iter().map(level).collect::<String>()) {}
                @for leak in Leak::ALL { (self.line(leak, &rows)) }
            }
        }
    }

    fn rows(&self, cylinder: &FleetCylinder, report: &FleetReport<'_>) -> Vec<Row<3>> {
        let mut points = Envelopes::<3>::of_at_most(MOST_POINTS);
        for (number, row) in judged(cylinder, report).enumerate() {
            let t = self.from_s.zip(begin_s(row)).map_or(number as f64, |(from, begin)| begin - from);
            points.add(t, &Leak::ALL.map(|leak| row.pinned(leak).map(spot)));
        }
        points.rows()
    }

    fn line(&self, leak: Leak, rows: &[Row<3>]) -> Markup {
        let (mut line, mut dots, mut intervals) = (String::new(), String::new(), String::new());
        for row in rows {
            let Some(range) = row.ranges.get(leak as usize).copied().flatten() else { continue };
            let [x, y, low, high] =
                [self.x(row.t_s), self.y(range.median), self.y(range.low), self.y(range.high)];
            let _ = write!(line, "{}{x:.1} {y:.1}", if line.is_empty() { 'M' } else { 'L' });
            let _ = write!(dots, "M{x:.1} {y:.1}h0");
            let _ = write!(intervals, "M{x:.1} {low:.1}V{high:.1}");
        }
        html! {
            g class=(ink(leak).class()) { path .interval d=(intervals) {} path .line d=(line) {} path .dots d=(dots) {} }
        }
    }

    fn label(&self, cylinder: &FleetCylinder) -> String {
        let span = self.from_s.map_or_else(
            || format!("{} traces", cylinder.traces),
            |_| format!("{:.0} days", (self.length / S_PER_DAY).ceil()),
        );
        format!("Leaks over {span}, from 0 to {:.2} L/min", self.top_lpm)
    }
}

fn spot(found: FleetLeak) -> Spot {
    let [low, high] = found.ci95.unwrap_or([found.mean_lpm; 2]);
    Spot { low, value: found.mean_lpm, high }
}

/// Those that could be judged.
fn judged<'a>(cylinder: &'a FleetCylinder, report: &FleetReport<'a>) -> impl Iterator<Item = &'a FleetRow> {
    let rows = report.rows;
    cylinder.rows.iter().filter_map(|place| rows.get(*place)).filter(|row| row.error.is_none())
}

fn begin_s(row: &FleetRow) -> Option<f64> {
    row.begins.map(|begins| begins.as_millisecond() as f64 / 1e3)
}
