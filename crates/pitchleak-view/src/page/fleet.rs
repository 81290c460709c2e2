//! The page of a fleet: who asks for somebody, which leaks grow, and every trace in a row.

use super::chart::{Chart, Charts, Limit, Line};
use super::history::ink;
use super::machine::{facts, short};
use super::{Card, Head, Page, Section, Tone};
use crate::envelope::Range;
use jiff::Timestamp;
use maud::{Markup, html};
use pitchleak::core::Leak;
use pitchleak::fleet::{Counts, FleetLeak, FleetReport, FleetRow, LongTrend, count};
use pitchleak::report::{Status, advice, capital, with_interval};
use pitchleak::units::S_PER_DAY;
use std::collections::BTreeMap;

/// Rows that a page shows of each table: beyond, the table that `--out` writes is the place to look.
const MOST_ROWS: usize = 1000;
/// Traces named on the first screen.
const MOST_NAMED: usize = 8;
/// Growing leaks that are drawn.
const MOST_DRAWN: usize = 8;

impl Page {
    /// The report of a fleet.
    pub fn of_fleet(report: &FleetReport<'_>) -> Self {
        let mut charts = Charts::default();
        let worst = report.worst();
        let growing = report.growing();
        let sections = vec![
            Section {
                id: "worst",
                title: "Who asks for somebody",
                body: table(&worst, "Nobody: every trace is sound."),
            },
            Section { id: "growing", title: "Leaks that grow", body: trends(report, &growing, &mut charts) },
            Section {
                id: "all",
                title: "Every trace",
                body: table(&report.rows.iter().collect::<Vec<_>>(), "There is none."),
            },
            Section { id: "made", title: "How this was made", body: made(report) },
        ];
        let subject = count(report.traces, "trace");
        Self { kind: "fleet", subject, head: head(report, &worst, &growing), sections, charts }
    }
}

fn head(report: &FleetReport<'_>, worst: &[&FleetRow], growing: &[Growing<'_>]) -> Head {
    let Counts { leak, sound, doubtful, not_sure, error } = report.counts;
    let unsure = doubtful + not_sure + error;
    let (word, tone) = match (leak, unsure) {
        (0, 0) => ("ALL SOUND".to_owned(), Tone::Sound),
        (0, _) => (format!("{unsure} TO CHECK"), Tone::Caution),
        (1, _) => ("1 LEAK".to_owned(), Tone::Leak),
        _ => (format!("{leak} LEAKS"), Tone::Leak),
    };
    let mut sentence = format!(
        "{}: {leak} with a leak, {sound} sound, {doubtful} doubtful, {not_sure} not sure",
        count(report.traces, "trace")
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
    let named =
        |status: &'static [Option<Status>]| worst.iter().filter(move |row| status.contains(&row.status));
    let leaks = named(&[Some(Status::Leak)]);
    let open = named(&[Some(Status::Doubtful), Some(Status::NotSure), None]);
    Head {
        word,
        tone,
        sentence,
        data: count(report.cylinders, "cylinder"),
        cards: vec![
            Card {
                title: "What to do first",
                body: html! {
                    @if leak == 0 { p { "No trace shows a leak." } }
                    ol { @for row in leaks.clone().take(MOST_NAMED) {
                        li { strong { bdi { (row.cylinder) } } ": " (found(row)) @if let Some(leak) = row.faults.first() { "; " (advice(*leak)) } "." }
                    } }
                    @if leak > MOST_NAMED { p { "… and " (leak - MOST_NAMED) " more, below." } }
                },
            },
            Card {
                title: "What these traces do not tell",
                body: html! {
                    @if unsure == 0 { p { "Nothing is open: every trace is judged, and every verdict is sure." } }
                    ul { @for row in open.take(MOST_NAMED) { li { strong { bdi { (row.cylinder) } } ": " (found(row)) "." } } }
                    @if unsure > MOST_NAMED { p { "… and " (unsure - MOST_NAMED) " more, below." } }
                },
            },
            Card {
                title: "Leaks that grow fastest",
                body: html! {
                    @if growing.is_empty() { p { "None beyond doubt; it takes three dated traces of a cylinder." } }
                    ul { @for (cylinder, leak, long) in growing.iter().take(MOST_NAMED) { li { strong { bdi { (cylinder) } } ", " (leak.label()) ": " (long.rate()) "." } } }
                },
            },
        ],
    }
}

/// What a row's verdict rests on.
fn found(row: &FleetRow) -> String {
    if let Some(error) = &row.error {
        return error.clone();
    }
    if row.status != Some(Status::Leak) {
        return row.reasons.iter().map(|id| id.replace('_', " ")).collect::<Vec<_>>().join(", ");
    }
    let flow = |leak: &Leak| Some(format!("{} {} L/min", leak.label(), interval(&row.leaks?[*leak])));
    row.faults.iter().filter_map(flow).collect::<Vec<_>>().join(", ")
}

fn interval(leak: &FleetLeak) -> String {
    with_interval(leak.mean_lpm, leak.std_lpm)
}

fn table(rows: &[&FleetRow], none: &str) -> Markup {
    if rows.is_empty() {
        return html! { p { (none) } };
    }
    html! {
        div .wide { table {
            thead { tr {
                th scope="col" { "cylinder" } th scope="col" { "verdict" }
                @for leak in Leak::ALL { th .number scope="col" { (leak.label()) ", L/min" } }
                th scope="col" { "begins" } th .number scope="col" { "minutes" } th scope="col" { "trace" } th scope="col" { "because" }
            } }
            tbody { @for row in rows.iter().take(MOST_ROWS) { (line(row)) } }
        } }
        @if rows.len() > MOST_ROWS { p { "… and " (rows.len() - MOST_ROWS) " more: the table that " code { "--out" } " writes has all." } }
    }
}

fn line(row: &FleetRow) -> Markup {
    let tone = row.status.map_or(Tone::Caution, Tone::from);
    html! {
        tr {
            th scope="row" { bdi { (row.cylinder) } }
            td class=(tone.class()) { (row.word()) }
            @for leak in Leak::ALL {
                td .number { @match row.leaks.map(|leaks| leaks[leak]) {
                    Some(leak) if leak.identifiable => (interval(&leak)),
                    _ => "–",
                } }
            }
            td { (row.begins.map_or_else(|| "–".to_owned(), day)) }
            td .number { (row.duration_s.map_or_else(|| "–".to_owned(), |s| short(s / 60.0))) }
            td { bdi { (row.path) } }
            td { @if row.status != Some(Status::Leak) && row.status != Some(Status::Sound) { (found(row)) } }
        }
    }
}

fn day(at: Timestamp) -> String {
    at.strftime("%Y-%m-%d %H:%M").to_string()
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
            ul { @for (cylinder, leak, long) in growing.iter().skip(MOST_DRAWN).take(MOST_ROWS) { li { bdi { (cylinder) } ", " (leak.label()) ": " (long.rate()) } } }
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
        x_label: format!("days since {}", day(first)),
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
