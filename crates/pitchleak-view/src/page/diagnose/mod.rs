//! The page of a diagnosis: from the residual to the effect that explains it, and how sure that is.

mod effects;
mod first_screen;
mod leaks;
mod residuals;
mod sure;

use super::chart::Charts;
use super::machine::{channels, facts, rig};
use super::{Page, Section};
use maud::{Markup, html};
use pitchleak::diagnose::Diagnosis;
use pitchleak::rig::Rig;

impl Page {
    /// The report of a diagnosis of `traces` of `machine`.
    pub fn of_diagnosis(diagnosis: &Diagnosis, machine: &Rig, traces: &[String]) -> Self {
        let rows = residuals::over_time(diagnosis);
        let mut charts = Charts::over(rows.rows().iter().map(|row| row.t_s));
        let mut sections = vec![
            Section { id: "effects", title: "What the model lacks", body: effects::body(diagnosis) },
            Section {
                id: "residuals",
                title: "From residual to effect",
                body: residuals::body(diagnosis, &rows, &mut charts),
            },
            Section { id: "leaks", title: "Leaks before and after", body: leaks::body(diagnosis) },
            Section { id: "sure", title: "What it would take to be sure", body: sure::body(diagnosis) },
            Section { id: "rig", title: "Rig", body: rig(machine) },
            Section { id: "made", title: "How this was made", body: made(diagnosis, traces) },
        ];
        if diagnosis.wiring.is_some() {
            let body = channels(&[], diagnosis.wiring.as_ref());
            sections.insert(0, Section { id: "channels", title: "Wiring", body });
        }
        let subject = match traces {
            [first, _, ..] => format!("{first} and {} more", traces.len() - 1),
            _ => traces.concat(),
        };
        Self { kind: "diagnose", subject, head: first_screen::head(diagnosis), sections, charts }
    }
}

/// An effect's id as words.
fn spoken(id: &str) -> String {
    id.replace('_', " ")
}

fn made(diagnosis: &Diagnosis, traces: &[String]) -> Markup {
    html! {
        ul { @for trace in traces { li { bdi { (trace) } } } }
        (facts(&[
            ("Program", super::generator()),
            ("Samples read", diagnosis.samples.read.to_string()),
            ("Samples fitted", diagnosis.samples.fitted.to_string()),
            ("Form of the data", "pitchleak.diagnose/1".to_owned()),
        ]))
    }
}
