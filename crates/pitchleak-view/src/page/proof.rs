//! The page of a proof.

use super::chart::{Chart, Charts, Ink, Line};
use super::history::ink;
use super::machine::{made, prose, rig, table};
use super::{Card, Head, Page, Section, Tone};
use crate::text::data_line;
use crate::text::proof::{best_possible, found, from, proof_word, seconds, sentence};
use maud::{Markup, html};
use pitchleak::prove::{Case, Proof};
use pitchleak::report::capital;
use pitchleak::rig::Rig;
use pitchleak::units::readable;

impl Page {
    /// The report on leaks that were put into a trace of `machine`.
    pub fn of_proof(proof: &Proof, machine: &Rig) -> Self {
        let mut charts = Charts::default().by(proof.trace.begins.as_ref());
        let sections = vec![
            Section { id: "cases", title: "Put in and found", body: cases(proof, &mut charts) },
            Section { id: "recorded", title: "As it was recorded", body: recorded(proof) },
            Section { id: "rig", title: "Rig", body: rig(machine) },
            Section { id: "made", title: "How this was made", body: made(&proof.trace, proof.schema) },
        ];
        Self { kind: "prove", subject: proof.trace.path.clone(), head: head(proof), sections, charts }
    }
}

fn head(proof: &Proof) -> Head {
    Head {
        word: proof_word(proof).to_owned(),
        tone: if proof.is_proven() { Tone::Sound } else { Tone::Caution },
        sentence: sentence(proof),
        data: data_line(&proof.trace),
        cards: vec![
            Card { title: "Found from", body: html! { p { (from(proof)) "." } } },
            Card {
                title: "As it was recorded",
                body: html! { p { (proof.verdict.status.word()) ". " (prose(&proof.verdict.text)) } },
            },
        ],
    }
}

fn cases(proof: &Proof, charts: &mut Charts) -> Markup {
    html! {
        p { "A known leak was put into these readings from " (format!("{:.1}", proof.onset_s)) " s on, one at a time." }
        (table(&["leak", "#put in, L/min", "#found, L/min", "#alarm after", "the best possible"], html! {
            @for case in &proof.cases { tr {
                th scope="row" { (case.leak.label()) }
                td .number { (readable(case.put_in_lpm, 3)) }
                td .number { (found(case)) }
                td .number { (seconds(case.alarm_after_s)) }
                td { (best_possible(case)) }
            } }
        }))
        @for case in &proof.cases { (charts.place(course(proof, case))) }
    }
}

/// What was put in, and what the estimate made of it.
fn course(proof: &Proof, case: &Case) -> Chart {
    let thinned = case.course.chunks(case.course.len().div_ceil(MOST_POINTS).max(1)).filter_map(<[_]>::last);
    let (times, flows): (Vec<_>, Vec<_>) = thinned.map(|(t_s, flow)| (Some(*t_s), Some(*flow))).unzip();
    let own = proof.leakage[case.leak].mean_lpm;
    let put_in =
        |t_s: &Option<f64>| t_s.map(|t_s| own + if t_s < proof.onset_s { 0.0 } else { case.put_in_lpm });
    let line = |name: &str, ink, mid: Vec<Option<f64>>| Line {
        x: Some(times.clone()),
        mid,
        ..Line::over_time(name, ink, &[])
    };
    let truth = Line { bed: true, ..line("in the readings", Ink::Grey, times.iter().map(put_in).collect()) };
    Chart {
        title: format!("{} leak, {} L/min put in", capital(case.leak.label()), readable(case.put_in_lpm, 3)),
        unit: "L/min",
        note: "Grey: the leak that the trace had, and what was put in",
        lines: vec![truth, line("estimated", ink(case.leak), flows)],
        // Where the estimates begin anew they are wild for a moment.
        range: Some([-0.5 * case.put_in_lpm, 1.6 * (own.max(0.0) + case.put_in_lpm)]),
        ..Chart::default()
    }
}

/// Of a curve.
const MOST_POINTS: usize = 400;

fn recorded(proof: &Proof) -> Markup {
    html! {
        p { strong { (proof.verdict.status.word()) } ". " (prose(&proof.verdict.text)) }
        p { "The same samples, the same decision: only the flows of the leak were added to what the meters read. The trace keeps its \
             noise, its zeros and its lags. “The best possible” is the Cramér–Rao bound of these flows." }
    }
}
