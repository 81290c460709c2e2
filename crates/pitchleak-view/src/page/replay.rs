//! The page of a replay.

use super::chart::{Chart, Charts, Limit, Span};
use super::drawing::Drawing;
use super::history::{Drawn, ink};
use super::machine::{alarms, facts, prose, short, table, trace};
use super::{Card, Head, History, Page, Section};
use crate::text::{
    Bar, ESTIMATES, data_line, gpa, hold_line, known, missing_rig, per_bar, scale, thresholds_lpm, unknown,
    valve_line,
};
use maud::{Markup, html};
use pitchleak::core::{AlarmState, Leak, PerLeak};
use pitchleak::report::{
    EstimateEntry, Reason, ReasonId, ReplayReport, Status, TraceSummary, advice, capital, interval,
    with_interval,
};
use pitchleak::rig::Rig;
use pitchleak::units::duration;

impl Page {
    /// The report of a replay of `rig`, with what was gathered on the way.
    pub fn of_replay(report: &ReplayReport, rig: &Rig, history: &History) -> Self {
        let drawn = history.drawn();
        let mut charts = drawn.charts().by(report.trace.begins.as_ref());
        let sections = vec![
            Section { id: "leaks", title: "Leaks", body: leaks(report, rig, &drawn, &mut charts) },
            Section { id: "signals", title: "Signals", body: signals(&drawn, &mut charts) },
            Section { id: "residuals", title: "Residuals", body: residuals(report, &drawn, &mut charts) },
            Section { id: "channels", title: "Channels and wiring", body: wiring(report) },
            Section { id: "rig", title: "Rig", body: super::machine::rig(rig) },
            Section { id: "made", title: "How this was made", body: made(report, rig) },
        ];
        Self { kind: "replay", subject: report.trace.path.clone(), head: head(report, rig), sections, charts }
    }
}

fn head(report: &ReplayReport, rig: &Rig) -> Head {
    let verdict = &report.verdict;
    Head {
        word: verdict.status.word().to_owned(),
        tone: verdict.status.into(),
        sentence: verdict.text.clone(),
        data: data_line(&report.trace),
        cards: vec![
            Card { title: "What to do", body: to_do(report) },
            Card { title: "Leaks at the end, L/min (95 %)", body: brief(report, rig) },
            Card { title: "What explains the trace", body: explanations(report) },
            Card { title: "What this trace does not tell", body: open(report) },
        ],
    }
}

fn to_do(report: &ReplayReport) -> Markup {
    let verdict = &report.verdict;
    match verdict.status {
        Status::Sound => html! { p { "Nothing: no leak reaches its alarm level." } },
        Status::Leak => {
            html! { ol { @for leak in &verdict.faults { li { strong { (capital(leak.label())) " leak: " } (advice(*leak)) "." } } } }
        }
        Status::Doubtful | Status::NotSure => {
            html! { ol {
                @for reason in &verdict.reasons { (what(reason)) }
                @if let Some(missing) = missing_rig(report) { li { (prose(&capital(missing))) "." } }
            } }
        }
    }
}

fn what(reason: &Reason) -> Markup {
    html! {
        li {
            (prose(&capital(&reason.text))) "."
            @if let Some(suggestion) = &reason.suggestion { " " strong { (prose(&capital(suggestion))) "." } }
        }
    }
}

/// What could not be identified, and why.
fn open(report: &ReplayReport) -> Markup {
    let estimates = &report.estimates;
    let leaks = estimates.leaks();
    let entries = Leak::ALL.into_iter().map(|leak| leaks[leak]).chain([&estimates.bulk_modulus]);
    let open: Vec<_> = ESTIMATES.into_iter().zip(entries).filter(|(_, entry)| !entry.identifiable).collect();
    html! {
        @if report.verdict.status == Status::Doubtful {
            p { "Anything, before what stands under “What to do” is settled: until then no figure on this page is to be believed." }
        }
        @if open.is_empty() && report.verdict.status != Status::Doubtful {
            p { "Nothing is open: all three leaks and the bulk modulus of the oil are identified." }
        } @else {
            ul {
                @for (name, entry) in &open {
                    li { strong { (capital(name)) } ": " (unknown(entry)) "." }
                }
            }
        }
    }
}

/// Explanations that are shown, best first.
const MOST_EXPLANATIONS: usize = 5;

/// Their probabilities as bars.
fn explanations(report: &ReplayReport) -> Markup {
    let all = &report.verdict.explanations;
    let shown = &all[..all.len().min(MOST_EXPLANATIONS)];
    let rest = 1.0 - shown.iter().map(|one| one.probability).sum::<f64>();
    html! {
        @if shown.is_empty() {
            p { "Nothing was weighed: " (unweighed(report)) "." }
        } @else {
            table .weighed {
                tbody {
                    @for one in shown {
                        tr {
                            td .number { (percent(one.probability)) }
                            td {
                                (probability_bar(one.probability))
                                (capital(&one.text))
                            }
                        }
                    }
                    @if rest >= 0.005 {
                        tr { td .number { (percent(rest)) } td { (probability_bar(rest)) "Anything else" } }
                    }
                }
            }
        }
    }
}

fn unweighed(report: &ReplayReport) -> &'static str {
    if report.hold.is_some() || report.valve.is_some() {
        "explanations are of traces with flow meters"
    } else if report.estimator.name() == "rls" {
        "the trace is too short, or nothing explains it at all"
    } else {
        "the paper's law knows no uncertainty"
    }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn probability_bar(share: f64) -> Markup {
    html! {
        svg .probability viewBox="0 0 100 4" preserveAspectRatio="none" aria-hidden="true" {
            rect .whole width="100" height="4" {}
            rect .share width=(format!("{:.1}", 100.0 * share)) height="4" {}
        }
    }
}

/// The leaks as bars on a common scale.
fn brief(report: &ReplayReport, rig: &Rig) -> Markup {
    let levels = thresholds_lpm(rig);
    let bars = PerLeak::from_fn(|leak| {
        let known = report.estimates.leaks()[leak].identifiable;
        known.then(|| Bar::of(&report.leakage[leak], levels[leak]))
    });
    let ends = scale(bars.iter().filter_map(|(_, bar)| bar.as_ref())).unwrap_or_default();
    html! {
        (Drawing::of(report, rig).svg())
        table {
            tbody {
                @for (leak, known) in bars.iter() {
                    tr {
                        th scope="row" { (leak.label()) }
                        @if let Some(known) = known {
                            td .number { (interval(&report.leakage[leak])) }
                            td { (bar(known, ends)) }
                        } @else {
                            td .number { "not identified" }
                            td {}
                        }
                    }
                }
            }
        }
        p .note { "Dashed: alarm level, " (alarms(rig)) "." }
    }
}

const BAR_WIDTH: f64 = 176.0;

fn bar(&Bar { interval: [low, high], value: (value, _), limit }: &Bar, [from, to]: [f64; 2]) -> Markup {
    let at = |value: f64| 4.0 + (BAR_WIDTH - 8.0) * ((value - from) / (to - from).max(1e-9)).clamp(0.0, 1.0);
    let tenths = |value: f64| format!("{value:.1}");
    html! {
        svg .bar viewBox="0 0 176 18" aria-hidden="true" {
            line .axis x1=(tenths(at(0.0))) x2=(tenths(at(0.0))) y1="1" y2="17" {}
            line .limit x1=(tenths(at(limit))) x2=(tenths(at(limit))) y1="1" y2="17" {}
            rect .interval x=(tenths(at(low))) y="5" width=(tenths((at(high) - at(low)).max(1.0))) height="8" {}
            circle .value cx=(tenths(at(value))) cy="9" r="3" {}
        }
    }
}

fn leaks(report: &ReplayReport, rig: &Rig, drawn: &Drawn, charts: &mut Charts) -> Markup {
    let mut limits: Vec<Limit> = Vec::new();
    for (leak, &value) in thresholds_lpm(rig).iter() {
        match limits.iter_mut().find(|limit| (limit.value - value).abs() < 1e-9) {
            Some(limit) => limit.label = "alarm level".to_owned(),
            None => limits.push(Limit { value, label: format!("alarm level, {}", leak.label()) }),
        }
    }
    let spans = report.episodes.iter().map(|episode| Span {
        from: episode.from_s,
        to: episode.to_s,
        ink: ink(episode.fault),
    });
    let chart = Chart {
        title: "Leak flows".to_owned(),
        unit: "L/min",
        note: "Shaded about a line: 95 % interval; shaded in full height: the time in which an alarm stood.",
        lines: drawn.leaks(),
        limits,
        spans: spans.collect(),
        settles: true,
        ..Chart::default()
    };
    html! {
        @if let Some(hold) = &report.hold {
            p { "Hold test: " (hold_line(hold)) "." }
        } @else if let Some(valve) = &report.valve {
            p { "No flow meters, the valve's flows: " (valve_line(valve)) "." }
        } @else {
            (charts.place(chart))
            h3 { "At the end of the trace" }
        }
        (at_the_end(report))
        (episodes(report))
        (scores(report))
    }
}

fn at_the_end(report: &ReplayReport) -> Markup {
    let bulk = &report.estimates.bulk_modulus;
    html! {
        (table(&["leak", "#L/min, 95 %", "#L/min/bar, 95 %", "trend", ""], html! {
            @for (leak, entry) in report.estimates.leaks().iter() {
                tr {
                    th scope="row" { (leak.label()) }
                    td .number { (known(entry, || interval(&report.leakage[leak]))) }
                    td .number { (known(entry, || per_bar(entry.value, entry.std))) }
                    td { (trend(report, leak)) }
                    td { (doubt(entry)) }
                }
            }
            tr {
                th scope="row" { "bulk modulus" }
                td .number colspan="2" { (known(bulk, || gpa(bulk))) }
                td {}
                td { (doubt(bulk)) }
            }
        }))
        @if let Some(offsets) = &report.flow_meter_offsets {
            p { "Zeros of the flow meters, as found: A " (with_interval(offsets.a.offset_lpm, Some(offsets.a.std_lpm))) ", B "
                (with_interval(offsets.b.offset_lpm, Some(offsets.b.std_lpm))) " L/min." }
        }
    }
}

fn doubt(entry: &EstimateEntry) -> String {
    if entry.identifiable { String::new() } else { format!("not identified: {}", unknown(entry)) }
}

fn trend(report: &ReplayReport, leak: Leak) -> String {
    let Some(trend) = &report.trend[leak] else { return "not known".to_owned() };
    format!("{} L/min per hour", with_interval(trend.slope_lpm_per_h, Some(trend.std)))
}

/// Rows of a table of episodes at most: a page stays small however often a leak comes and goes.
const MOST_EPISODES: usize = 500;

fn episodes(report: &ReplayReport) -> Markup {
    let trace = &report.trace;
    let number = |lpm: f64| format!("{lpm:.3}");
    html! {
        h3 { "Leaks through the trace" }
        @if let Some(clock) = &trace.begins { p .note { "The trace begins " (clock.start_text()) "." } }
        @if report.spells.is_empty() {
            p { "No alarm stood at any time." }
        } @else {
            (table(&["leak", "from", "to", "#times", "#stood for", "#mean, L/min", "#most, L/min"], html! {
                @for spell in &report.spells {
                    tr {
                        th scope="row" { (spell.fault.label()) }
                        td { (trace.time(spell.from_s, 1)) }
                        td { (end(trace, spell.to_s)) }
                        td .number { (spell.times) }
                        td .number { (duration(spell.stood_s)) }
                        td .number { (number(spell.mean_lpm)) }
                        td .number { (number(spell.peak_lpm)) }
                    }
                }
            }))
        }
        @if report.episodes.len() > report.spells.len() {
            details {
                summary { "Every single one (" (report.episodes.len()) "; above, pauses shorter than a twenty-fourth of the trace are passed over)" }
                ul {
                    @for episode in report.episodes.iter().take(MOST_EPISODES) {
                        li { (episode.fault.label()) " leak, " (trace.time(episode.from_s, 1)) " to " (end(trace, episode.to_s)) ": "
                            (number(episode.mean_lpm)) " L/min on average, " (number(episode.peak_lpm)) " at most" }
                    }
                }
                @if report.episodes.len() > MOST_EPISODES { p { "… and " (report.episodes.len() - MOST_EPISODES) " more: " code { "--json" } " has all." } }
            }
        }
        @if !report.alarms.is_empty() && report.alarms.len() <= MOST_EPISODES {
            details {
                summary { "Alarms in the order of time (" (report.alarms.len()) ")" }
                ul {
                    @for alarm in &report.alarms {
                        li { (trace.time(alarm.time_s, 2)) ": " (alarm.fault.label()) " leak "
                            (if alarm.state == AlarmState::Raised { "raised" } else { "cleared" }) }
                    }
                }
            }
        }
    }
}

fn end(trace: &TraceSummary, to_s: Option<f64>) -> String {
    to_s.map_or_else(|| "stands at the end".to_owned(), |to_s| trace.time(to_s, 1))
}

fn scores(report: &ReplayReport) -> Markup {
    let Some(scores) = &report.score else { return html! {} };
    let percent = |value: f64| format!("{value:.2} %");
    html! {
        h3 { "Against the reference meters, in steady state" }
        (table(&["leak", "#leakage error, mean", "#peak", "#coefficient error, mean", "#peak", "#within 5 % after"], html! {
            @for (leak, score) in scores.iter() {
                @if let Some(score) = score {
                    tr {
                        th scope="row" { (leak.label()) }
                        td .number { (percent(score.leakage_mean_error_percent)) }
                        td .number { (percent(score.leakage_peak_error_percent)) }
                        td .number { (percent(score.coefficient_mean_error_percent)) }
                        td .number { (percent(score.coefficient_peak_error_percent)) }
                        td .number { @match score.convergence_time_s { Some(time_s) => (format!("{time_s:.2} s")), None => "never for good" } }
                    }
                }
            }
        }))
    }
}

fn signals(drawn: &Drawn, charts: &mut Charts) -> Markup {
    html! {
        p .note { "As read. Of a long trace each point stands for a stretch of time: the line is the median, shaded from the least to \
            the greatest reading, so that no spike is lost. Lines break where the trace pauses." }
        (drawn.signals(charts))
    }
}

fn residuals(report: &ReplayReport, drawn: &Drawn, charts: &mut Charts) -> Markup {
    html! {
        p .note { "What each moment brought that the estimates before it did not foretell. A residual that stays outside its lines, \
            or follows a signal above, means that model or sensors are not as declared: " code { "pitchleak diagnose" }
            " looks for the effect that is missing." }
        (drawn.residuals(charts))
        @if let Some([balance, position]) = report.normalised_innovation {
            p { "Over the whole trace, mean square over its variance (1 where all is as declared): flow balance " (short(balance))
                ", position " (short(position)) "." }
        }
    }
}

/// Reasons of the verdict that are about sensors and wires.
fn wiring(report: &ReplayReport) -> Markup {
    let is_wire = |reason: &&Reason| matches!(reason.id, ReasonId::Channel(_) | ReasonId::Wiring);
    let found: Vec<_> = report.verdict.reasons.iter().filter(is_wire).collect();
    html! {
        @if found.is_empty() {
            p { "No channel is dead, stuck, clipped or held, and no mistake of wiring, sign or unit shows. " code { "pitchleak check" }
                " tells more of the recording." }
        } @else {
            ul { @for reason in found { (what(reason)) } }
        }
    }
}

fn made(report: &ReplayReport, rig: &Rig) -> Markup {
    html! {
        (trace(&report.trace))
        (facts(&[
            ("Program", super::generator()),
            ("Estimator", report.estimator.name().to_owned()),
            ("Alarm levels", alarms(rig)),
            ("Form of the data", report.schema.to_owned()),
        ]))
    }
}
