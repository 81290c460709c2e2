//! The page of a check.

use super::machine::{channels, made, prose, rig, rough, short, table};
use super::{Card, Head, History, Page, Section, Tone};
use crate::text::{ESTIMATES, data_line, misfit};
use maud::{Markup, html};
use pitchleak::check::{CheckReport, Reach, Reading};
use pitchleak::report::capital;
use pitchleak::rig::Rig;
use pitchleak::units::LPM_PER_M3S;

impl Page {
    /// The report of a check of a trace of `machine`, with what was gathered on the way.
    pub fn of_check(report: &CheckReport, machine: &Rig, history: &History) -> Self {
        let drawn = history.drawn();
        let mut charts = drawn.charts().by(report.trace.begins.as_ref());
        let wiring = channels(&report.channels, report.wiring.as_ref());
        let sections = vec![
            Section { id: "channels", title: "Channels and wiring", body: wiring },
            Section { id: "reach", title: "What this trace can tell", body: reach(report) },
            Section {
                id: "signals",
                title: "Signals",
                body: html! { (readings(&report.readings)) (drawn.signals(&mut charts)) },
            },
            Section { id: "residuals", title: "Residuals", body: drawn.residuals(&mut charts) },
            Section { id: "rig", title: "Rig", body: rig(machine) },
            Section { id: "made", title: "How this was made", body: made(&report.trace, report.schema) },
        ];
        Self { kind: "check", subject: report.trace.path.clone(), head: head(report), sections, charts }
    }
}

/// What a check finds, in the order in which it matters.
enum Finding {
    Broken,
    Part,
    Usable,
}

fn finding(report: &CheckReport) -> Finding {
    let misfits = misfit(&report.verdict).is_some();
    if !report.channels.is_empty() || report.wiring.is_some() || misfits {
        Finding::Broken
    } else if open(report).next().is_some() {
        Finding::Part
    } else {
        Finding::Usable
    }
}

/// All that the trace may tell: by name, with factor and unit for people.
fn all(report: &CheckReport) -> impl Iterator<Item = (&'static str, &Reach, f64, &'static str)> {
    let leaks = report.leaks.iter().map(|(_, reach)| (reach, 1.0, "L/min"));
    let all = leaks.chain([(&report.bulk_modulus, 1e-9, "GPa")]);
    ESTIMATES.into_iter().zip(all).map(|(name, (reach, factor, unit))| (name, reach, factor, unit))
}

fn open(report: &CheckReport) -> impl Iterator<Item = (&'static str, &Reach)> {
    all(report).filter(|(_, reach, ..)| !reach.identifiable).map(|(name, reach, ..)| (name, reach))
}

fn head(report: &CheckReport) -> Head {
    let (word, tone, sentence) = match finding(report) {
        Finding::Broken => ("CHECK FIRST", Tone::Caution, why(report)),
        Finding::Part => {
            let names: Vec<_> = open(report).map(|(name, _)| name).collect();
            let text = format!(
                "Data, wiring and model agree, but this trace does not tell the {}.",
                names.join(", the ")
            );
            ("TELLS A PART", Tone::Caution, text)
        }
        Finding::Usable => (
            "USABLE",
            Tone::Sound,
            format!("Data, wiring and model agree. This trace shows {}.", sizes(report)),
        ),
    };
    Head {
        word: word.to_owned(),
        tone,
        sentence,
        data: data_line(&report.trace),
        cards: vec![
            Card { title: "What to do", body: to_do(report) },
            Card { title: "What this trace does not tell", body: not_told(report) },
            Card { title: "Leaks it would show, L/min (95 %)", body: resolutions(report) },
        ],
    }
}

/// The first of what contradicts the declared rig.
fn why(report: &CheckReport) -> String {
    let channel = report.channels.first().map(|fault| format!("{}.", capital(&fault.text)));
    let wiring = report.wiring.as_ref().map(|wiring| format!("{}.", capital(&wiring.suggestion)));
    let misfit = misfit(&report.verdict);
    channel.or(wiring).or(misfit).unwrap_or_default()
}

fn sizes(report: &CheckReport) -> String {
    let size = |reach: &Reach| reach.resolution.map(rough).unwrap_or_default();
    let leaks: Vec<_> = report
        .leaks
        .iter()
        .map(|(leak, reach)| format!("{} leaks to ± {}", leak.label(), size(reach)))
        .collect();
    format!("{} L/min", leaks.join(", "))
}

fn to_do(report: &CheckReport) -> Markup {
    html! {
        @match finding(report) {
            Finding::Usable => p { "Replay it: " code { "pitchleak replay" } " says what leaks." },
            Finding::Part => p { "Record longer, with the piston moving and both pressures changing, or take what it tells: "
                code { "pitchleak replay" } "." },
            Finding::Broken => ol {
                @for fault in &report.channels { li { (capital(&fault.text)) ". " strong { (capital(fault.suggestion)) "." } } }
                @if let Some(wiring) = &report.wiring {
                    li { (capital(&wiring.suggestion)) ". " strong { @if let Some((table, lines)) = wiring.mending() {
                        "Where that is so, mend it in the rig file: " code { "[" (table) "] " (lines.join("; ")) }
                    } @else {
                        "Check how the columns are wired and recorded."
                    } } }
                }
                @if let Some(text) = misfit(&report.verdict) { li { (prose(&text)) } }
            },
        }
    }
}

fn not_told(report: &CheckReport) -> Markup {
    html! {
        @if open(report).next().is_none() {
            p { "Nothing is open: all three leaks and the bulk modulus of the oil can be identified." }
        } @else {
            ul { @for (name, reach) in open(report) {
                li { strong { (capital(name)) } ": " (reach.reason.as_deref().unwrap_or("too little excitation")) "." }
            } }
        }
    }
}

fn resolutions(report: &CheckReport) -> Markup {
    html! {
        table { tbody { @for (leak, reach) in report.leaks.iter() {
            tr { th scope="row" { (leak.label()) } td .number { (resolution(reach, 1.0, "")) } td {} }
        } } }
    }
}

fn resolution(reach: &Reach, factor: f64, unit: &str) -> String {
    let known = reach.resolution.filter(|resolution| resolution.is_finite());
    known.map_or_else(|| "–".to_owned(), |resolution| format!("± {} {unit}", rough(resolution * factor)))
}

fn reach(report: &CheckReport) -> Markup {
    html! {
        (table(&["", "#known to (95 %)", ""], html! {
            @for (name, reach, factor, unit) in all(report) {
                tr {
                    th scope="row" { (name) }
                    td .number { (resolution(reach, factor, unit)) }
                    td { @if !reach.identifiable { "not identified: " (reach.reason.as_deref().unwrap_or("too little excitation")) } }
                }
            }
        }))
        @if report.normalised_innovation.is_some() {
            p { (prose(&misfit(&report.verdict).unwrap_or_else(|| "Model and declared noise explain this trace.".to_owned()))) }
        }
    }
}

/// Ranges of the signals in people's units.
fn readings(readings: &[Reading]) -> Markup {
    let people = |reading: &Reading| match reading.unit {
        "m" => (1e3, "mm"),
        "Pa" => (1e-5, "bar"),
        "m^3/s" | "m3/s" => (LPM_PER_M3S, "L/min"),
        "N" => (1e-3, "kN"),
        other => (1.0, other),
    };
    html! {
        (table(&["signal", "#from", "#to", "#rows that have it"], html! {
            @for reading in readings {
                @let (factor, unit) = people(reading);
                tr {
                    th scope="row" { (reading.signal) ", " (unit) }
                    td .number { (short(reading.least * factor)) }
                    td .number { (short(reading.most * factor)) }
                    td .number { (format!("{:.1} %", reading.present_percent)) }
                }
            }
        }))
    }
}
