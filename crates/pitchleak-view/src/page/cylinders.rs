//! A fleet's cylinders: those of a turbine beside each other, each with its course and its traces.

use super::Tone;
use super::course::Scale;
use super::history::ink;
use super::machine::{prose, short};
use crate::text;
use jiff::Timestamp;
use maud::{Markup, html};
use pitchleak::core::Leak;
use pitchleak::fleet::{Counts, FleetCylinder, FleetLeak, FleetReport, FleetRow, count};
use pitchleak::report::{capital, with_interval};
use std::collections::HashMap;

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
    html! {
        div .wide { table {
            thead { tr {
                th scope="col" { "begins" } th scope="col" { "verdict" }
                @for leak in Leak::ALL { th .number scope="col" { (leak.label()) ", L/min" } }
                th .number scope="col" { "minutes" } th scope="col" { "trace" }
            } }
            tbody { @for row in rows.take(shown) { (line(row)) } }
        } }
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
                    Some(leak) if leak.identifiable => (interval(&leak)),
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

fn interval(leak: &FleetLeak) -> String {
    with_interval(leak.mean_lpm, leak.std_lpm)
}
