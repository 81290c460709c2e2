//! The page of a fleet: what to do first, the cylinders with their traces, which leaks grow.

use super::chart::{Chart, Charts, Limit, Line};
use super::history::ink;
use super::machine::{facts, prose};
use super::{Card, Head, Page, Section, Tone, cylinders};
use crate::envelope::Range;
use jiff::Timestamp;
use maud::{Markup, html};
use pitchleak::core::Leak;
use pitchleak::fleet::{Counts, FleetLeak, FleetReport, LongTrend, count};
use pitchleak::report::{Status, advice, capital};
use pitchleak::units::S_PER_DAY;
use std::collections::BTreeMap;

/// Lines of a list: beyond, JSON is the place to look.
const MOST_LINES: usize = 1000;
/// Cylinders named on the first screen.
const MOST_NAMED: usize = 8;
/// Growing leaks that are drawn.
const MOST_DRAWN: usize = 8;

impl Page {
    /// The report of a fleet.
    pub fn of_fleet(report: &FleetReport<'_>) -> Self {
        let mut charts = Charts::default();
        let growing = report.growing();
        let sections = vec![
            Section { id: "cylinders", title: "Cylinders, worst first", body: cylinders::cards(report) },
            Section { id: "growing", title: "Leaks that grow", body: trends(report, &growing, &mut charts) },
            Section { id: "made", title: "How this was made", body: made(report) },
        ];
        let subject = count(report.cylinders, "cylinder");
        Self { kind: "fleet", subject, head: head(report, &growing), sections, charts }
    }
}

fn head(report: &FleetReport<'_>, growing: &[Growing<'_>]) -> Head {
    let Counts { leak, sound, doubtful, not_sure, error } = report.cylinder_counts;
    let unsure = doubtful + not_sure + error;
    let (word, tone) = match (leak, unsure) {
        (0, 0) => ("ALL SOUND".to_owned(), Tone::Sound),
        (0, _) => (format!("{unsure} TO CHECK"), Tone::Caution),
        (1, _) => ("1 LEAK".to_owned(), Tone::Leak),
        _ => (format!("{leak} LEAKS"), Tone::Leak),
    };
    let mut sentence = format!(
        "{}: {leak} with a leak, {sound} sound, {doubtful} doubtful, {not_sure} not sure",
        count(report.cylinders, "cylinder")
    );
    if error > 0 {
        sentence += &format!(", and {error} could not be judged");
    }
    sentence += match growing.len() {
        0 => ".".to_owned(),
        1 => ". One leak grows from trace to trace beyond doubt.".to_owned(),
        count => format!(". {count} leaks grow from trace to trace beyond doubt."),
    }
    .as_str();
    Head {
        word,
        tone,
        sentence,
        data: count(report.traces, "trace"),
        cards: vec![to_do(report), open(report), early(report, growing)],
    }
}

fn to_do(report: &FleetReport<'_>) -> Card {
    let leak = report.cylinder_counts.leak;
    let leaks = report.worst().filter(|cylinder| cylinder.status == Some(Status::Leak));
    Card {
        title: "What to do first",
        body: html! {
            @if leak == 0 { p { "No cylinder leaks." } }
            ol { @for cylinder in leaks.take(MOST_NAMED) {
                li { strong { bdi { (cylinder.cylinder) } } ": " (cylinders::found(cylinder, report)) @if let Some(leak) = cylinder.faults.first() { "; " (advice(*leak)) } "." }
            } }
            @if leak > MOST_NAMED { p { "… and " (leak - MOST_NAMED) " more, below." } }
        },
    }
}

fn open(report: &FleetReport<'_>) -> Card {
    let Counts { doubtful, not_sure, .. } = report.cylinder_counts;
    let (unsure, failed) = (doubtful + not_sure, report.counts.error);
    let is_open = |status: Option<Status>| matches!(status, Some(Status::Doubtful | Status::NotSure));
    let cylinders = report.worst().filter(|cylinder| is_open(cylinder.status));
    let errors = report.failed().filter_map(|row| Some((&row.cylinder, row.error.as_ref()?)));
    Card {
        title: "What these traces do not tell",
        body: html! {
            @if unsure + failed == 0 { p { "Nothing is open: every trace is judged, and every cylinder's verdict is sure." } }
            ul {
                @for cylinder in cylinders.take(MOST_NAMED) { li { strong { bdi { (cylinder.cylinder) } } ": " (cylinders::found(cylinder, report)) "." } }
                @for (cylinder, error) in errors.take(MOST_NAMED) { li { strong { bdi { (cylinder) } } ": " (prose(error)) "." } }
            }
            @if unsure > MOST_NAMED { p { "… and " (unsure - MOST_NAMED) " more, below." } }
            @if failed > 0 { p { (count(failed, "trace")) " could not be judged." } }
        },
    }
}

fn early(report: &FleetReport<'_>, growing: &[Growing<'_>]) -> Card {
    let differing = report.differing();
    Card {
        title: "Leaks that grow, or differ from the siblings'",
        body: html! {
            @if growing.is_empty() { p { "None grows beyond doubt; it takes three dated traces of a cylinder." } }
            ul { @for (cylinder, leak, long) in growing.iter().take(MOST_NAMED) { li { strong { bdi { (cylinder) } } ", " (leak.label()) ": " (long.rate()) "." } } }
            @if differing.is_empty() { p { "None below its alarm level is more than its siblings' by more than chance; it takes a second trace of a turbine." } }
            ul { @for (cylinder, leak, beside) in differing.iter().take(MOST_NAMED) {
                li { strong { bdi { (cylinder.cylinder) } } ", " (leak.label()) ": " (beside.text()) "." }
            } }
        },
    }
}

/// Cylinder, leak and trend of one that grows beyond doubt.
type Growing<'a> = (&'a str, Leak, &'a LongTrend);

fn trends(report: &FleetReport<'_>, growing: &[Growing<'_>], charts: &mut Charts) -> Markup {
    let mut body = html! {
        @if growing.is_empty() {
            p { "No leak grows from trace to trace beyond doubt. It takes three traces of a cylinder that have dates and are not doubtful." }
        }
    };
    for one in growing.iter().copied().take(MOST_DRAWN) {
        body = html! { (body) (charts.place(course(report, one))) };
    }
    html! {
        div .pair { (body) }
        @if growing.len() > MOST_DRAWN {
            ul { @for (cylinder, leak, long) in growing.iter().skip(MOST_DRAWN).take(MOST_LINES) { li { bdi { (cylinder) } ", " (leak.label()) ": " (long.rate()) } } }
        }
    }
}

/// The flows of one leak, trace by trace.
fn course(report: &FleetReport<'_>, (cylinder, leak, _): Growing<'_>) -> Chart {
    let mut flows = BTreeMap::new();
    for row in
        report.rows.iter().filter(|row| row.cylinder == cylinder && row.status != Some(Status::Doubtful))
    {
        if let (Some(at), Some(leaks)) = (row.begins, row.leaks) {
            flows.insert(at, leaks[leak]);
        }
    }
    let first = flows.keys().next().copied().unwrap_or_default();
    let days = |at: &Timestamp| at.duration_since(first).as_secs_f64() / S_PER_DAY;
    let range = |leak: &FleetLeak| {
        let [low, high] = leak.ci95.unwrap_or([leak.mean_lpm; 2]);
        leak.identifiable.then_some(Range { low, median: leak.mean_lpm, high })
    };
    let ranges: Vec<_> = flows.values().map(range).collect();
    let x = flows.keys().map(|at| Some(days(at))).collect();
    let threshold = flows
        .values()
        .next()
        .map(|leak| Limit { value: leak.threshold_lpm, label: "alarm level".to_owned() });
    Chart {
        title: format!("{}: {} leak", cylinder, leak.label()),
        unit: "L/min",
        x_label: format!("days since {}", cylinders::moment(first)),
        lines: vec![Line {
            x: Some(x),
            dots: true,
            ..Line::over_time(capital(leak.label()), ink(leak), &ranges)
        }],
        limits: threshold.into_iter().collect(),
        ..Chart::default()
    }
}

fn made(report: &FleetReport<'_>) -> Markup {
    facts(&[
        ("Program", super::generator()),
        ("Traces", report.traces.to_string()),
        ("Cylinders", report.cylinders.to_string()),
        ("Form of the data", report.schema.to_owned()),
    ])
}
