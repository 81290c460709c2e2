//! The page of a diagnosis: from the residual to the effect that explains it, and how sure that is.

mod residuals;

use super::chart::Charts;
use super::machine::{channels, facts, prose, rig, short, table};
use super::{Card, Head, Page, Section, Tone};
use crate::residuals::{estimates, holds, name, quantity, rms_errors};
use crate::text::ESTIMATES;
use maud::{Markup, html};
use pitchleak::diagnose::{Diagnosis, FoundEffect, HoldLeak, LeakEstimate, Verdict};
use pitchleak::report::{capital, with_interval};
use pitchleak::rig::Rig;
use pitchleak::units::LPM_PER_M3S;

impl Page {
    /// The report of a diagnosis of `traces` of `machine`.
    pub fn of_diagnosis(diagnosis: &Diagnosis, machine: &Rig, traces: &[String]) -> Self {
        let rows = residuals::over_time(diagnosis);
        let mut charts = Charts::over(rows.rows().iter().map(|row| row.t_s));
        let mut sections = vec![
            Section { id: "effects", title: "What the model lacks", body: effects(diagnosis) },
            Section {
                id: "residuals",
                title: "From residual to effect",
                body: residuals::body(diagnosis, &rows, &mut charts),
            },
            Section { id: "leaks", title: "Leaks before and after", body: leaks(diagnosis) },
            Section { id: "sure", title: "What it would take to be sure", body: sure(diagnosis) },
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
        Self { kind: "diagnose", subject, head: head(diagnosis), sections, charts }
    }
}

// The first screen: verdict, what to do, what stays open, and the error before and after.

fn head(diagnosis: &Diagnosis) -> Head {
    let (word, tone) = match diagnosis.verdict {
        _ if diagnosis.wiring.is_some() => ("CHECK THE WIRING", Tone::Caution),
        Verdict::Explained => ("EXPLAINED", Tone::Sound),
        Verdict::PartlyExplained => ("PARTLY EXPLAINED", Tone::Caution),
        Verdict::NoMissingEffect => ("NO MISSING EFFECT", Tone::Sound),
        Verdict::Unexplained => ("UNEXPLAINED", Tone::Caution),
        Verdict::InsufficientExcitation => ("TOO LITTLE HAPPENS", Tone::Caution),
    };
    let samples = diagnosis.samples;
    let cards = vec![
        Card { title: "What to do", body: to_do(diagnosis) },
        Card { title: "What these traces do not tell", body: open(diagnosis) },
        Card { title: "Error on samples that were not fitted (rms)", body: errors(diagnosis) },
    ];
    Head {
        word: word.to_owned(),
        tone,
        sentence: sentence(diagnosis),
        data: format!("{} samples, {} of them fitted", samples.read, samples.fitted),
        cards,
    }
}

fn sentence(diagnosis: &Diagnosis) -> String {
    if let Some(wiring) = &diagnosis.wiring {
        return format!("{}.", capital(&wiring.suggestion));
    }
    let (_, says) = crate::text::sentence(diagnosis.verdict).split_once(": ").unwrap_or_default();
    let named: Vec<_> =
        diagnosis.effects.iter().map(|effect| format!("{} of {}", spoken(effect.id), size(effect))).collect();
    let named = if named.is_empty() { String::new() } else { format!(": {}", named.join(", ")) };
    let changes = match diagnosis.leak_changes.len() {
        0 => String::new(),
        1 => " A leak changes once.".to_owned(),
        count => format!(" Leaks change {count} times."),
    };
    format!("{}{named}.{changes}", capital(says))
}

fn to_do(diagnosis: &Diagnosis) -> Markup {
    if diagnosis.wiring.is_some() {
        return html! { p { "Mend the wiring or the rig file, as below, and diagnose again: beside such a mistake no effect is worth a word." } };
    }
    match diagnosis.verdict {
        Verdict::NoMissingEffect => {
            html! { p { "Nothing: " code { "pitchleak replay" } " can be believed with this rig file." } }
        }
        Verdict::InsufficientExcitation => {
            html! { p { "Record longer, with the piston moving, both pressures changing, and all that is \
            normal for this machine in it." } }
        }
        _ if diagnosis.effects.is_empty() => {
            html! { p { "Look below with which variable the residual goes: that is where the missing \
            effect acts." } }
        }
        _ => html! {
            ol {
                @for effect in &diagnosis.effects {
                    li {
                        strong { (capital(&spoken(effect.id))) ": " }
                        @if effect.confident { (prose(effect.remedy)) } @else { "not sure yet; see what would settle it. If so: " (prose(effect.remedy)) }
                    }
                }
                @if let Some(next) = &diagnosis.next_measurement {
                    @let [one, other] = next.between.map(spoken);
                    li { strong { "To tell " (one) " from " (other) ": " } (next.measurement) }
                }
                li { code { "pitchleak diagnose --save-rig corrected.toml" } " writes what was found into a rig file, which "
                    code { "pitchleak replay" } " then corrects for." }
            }
        },
    }
}

fn open(diagnosis: &Diagnosis) -> Markup {
    let after = ESTIMATES.into_iter().zip(estimates(&diagnosis.after.leaks));
    let unknown: Vec<_> = after.filter(|(_, entry)| !entry.identifiable).map(|(name, _)| name).collect();
    let doubtful: Vec<_> = diagnosis.effects.iter().filter(|effect| !effect.confident).collect();
    html! {
        @if unknown.is_empty() && doubtful.is_empty() {
            p { "Nothing is open: what is named stands by itself, and leaks and bulk modulus are identified." }
        } @else {
            ul {
                @for effect in doubtful {
                    li { strong { (capital(&spoken(effect.id))) } @if let Some(doubt) = effect.doubts_in_words() { ": " (doubt) } "." }
                }
                @for name in unknown { li { strong { (capital(name)) } ": these traces tell no more than the rig file does." } }
            }
        }
    }
}

fn errors(diagnosis: &Diagnosis) -> Markup {
    let found = !diagnosis.effects.is_empty();
    html! {
        table {
            thead { tr {
                td {} th .number scope="col" { "before" }
                @if found { th .number scope="col" { "after" } th .number scope="col" { "less by" } }
            } }
            tbody {
                @for (equation, [before, after], unit) in rms_errors(diagnosis) {
                    tr {
                        th scope="row" { (name(equation)) ", " (unit) }
                        td .number { (short(before)) }
                        @if found {
                            td .number { (short(after)) }
                            td .number { (percent(1.0 - after / before)) }
                        }
                    }
                }
            }
        }
    }
}

/// No zero is negative.
fn percent(share: f64) -> String {
    format!("{:.0} %", (100.0 * share).round() + 0.0)
}

// The sections below it.

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

/// Rivals and the measurements that part them, what speaks for and against, what would not have shown.
fn sure(diagnosis: &Diagnosis) -> Markup {
    let separating: Vec<_> =
        diagnosis.effects.iter().filter(|effect| effect.separated_by.is_some()).collect();
    html! {
        @if separating.is_empty() {
            p { "No rival explains these traces as well; a second recording on another day, given with " code { "--test" } ", would confirm it." }
        } @else {
            p { "Measurements that tell the rivals apart:" }
            ul { @for effect in separating { li { strong { (capital(&spoken(effect.id))) } ": " (effect.separated_by.as_deref().unwrap_or_default()) } } }
        }
        @if !diagnosis.interactions.is_empty() {
            h3 { "Effects that act on each other" }
            ul { @for one in &diagnosis.interactions {
                li { (one.effects.map(spoken).join(" and ")) ": " (format!("{:.0} σ, would mend {:.1} %", one.sigma, one.mended_percent)) }
            } }
        }
        @if !diagnosis.notes.is_empty() {
            h3 { "What speaks for the verdict, and against it" }
            ul { @for note in &diagnosis.notes { li { (prose(&capital(note))) } } }
        }
        @if !diagnosis.not_detectable_below.is_empty() {
            details {
                summary { "What would not have shown: the smallest size of each further effect that these traces would have told (5 σ)" }
                (facts(&diagnosis.not_detectable_below.iter().map(|(id, size)| (*id, quantity(size.value, None, size.unit))).collect::<Vec<_>>()))
            }
        }
    }
}

/// What the model lacks, each effect with its remedy, doubt and rivals.
fn effects(diagnosis: &Diagnosis) -> Markup {
    html! {
        @if diagnosis.effects.is_empty() { p { "No effect is named." } }
        @for effect in &diagnosis.effects {
            h3 { (capital(&spoken(effect.id))) ": " (size(effect)) " "
                @if effect.confident { span .tag .is-sound { "sure of the name" } } @else { span .tag .is-caution { "doubtful" } } }
            p { (prose(effect.cause)) " " strong { (prose(effect.remedy)) } }
            @if let Some(doubt) = effect.doubts_in_words() { p { "Doubtful: " (doubt) "." } }
            (rivals(effect))
            p .note { "With it the error on samples that were not fitted falls by " (format!("{:.1}", effect.rmse_reduction_percent)) " % in the balance it \
                mends most; chance would show as much with a probability of " (chance(effect.p_value)) "."
                @for (constant, value) in &effect.constants { " " (spoken(constant)) ": " (format!("{value:.4e}")) "." } }
        }
        @if !diagnosis.calibration.is_empty() {
            h3 { "Sensors, within what the rig file allows" }
            (facts(&diagnosis.calibration.iter().map(|one| (one.id, quantity(one.value, Some(one.std), one.unit))).collect::<Vec<_>>()))
        }
    }
}

fn size(effect: &FoundEffect) -> String {
    quantity(effect.value, Some(effect.std), effect.unit)
}

fn rivals(effect: &FoundEffect) -> Markup {
    html! {
        @if !effect.confusable_with.is_empty() {
            p { "Rivals that these traces cannot tell from it: " (effect.confusable_with.iter().map(|id| spoken(id)).collect::<Vec<_>>().join(", ")) "."
                @if let Some(separated_by) = &effect.separated_by { " What would tell: " strong { (separated_by) } } }
        }
    }
}

fn chance(p: f64) -> String {
    if p < 1e-6 { "less than one in a million".to_owned() } else { format!("{p:.1e}") }
}

/// Leaks before and after, in motion and at rest.
fn leaks(diagnosis: &Diagnosis) -> Markup {
    let [before, after] = [&diagnosis.before, &diagnosis.after].map(|fit| estimates(&fit.leaks));
    let text = |entry: LeakEstimate| {
        if entry.unit == "Pa" {
            format!("{} GPa", with_interval(entry.value * 1e-9, Some(entry.std * 1e-9)))
        } else {
            quantity(entry.value, Some(entry.std), entry.unit)
        }
    };
    let mark = |entry: LeakEstimate| match entry {
        LeakEstimate { physical: false, .. } => " (impossible)",
        LeakEstimate { identifiable: false, .. } => " (not identified)",
        _ => "",
    };
    html! {
        (table(&["", "#before, 95 %", "#after, 95 %"], html! {
            @for (name, (before, after)) in ESTIMATES.into_iter().zip(before.into_iter().zip(after)) {
                tr {
                    th scope="row" { (capital(name)) }
                    td .number { (text(before)) (mark(before)) }
                    td .number { (text(after)) (mark(after)) }
                }
            }
        }))
        @if diagnosis.holds.is_some() {
            h3 { "At rest against in motion" }
            p .note { "Flow that leaves a chamber while the piston stands, measured, beside what the model fitted to motion foretells." }
            @for (chamber, hold) in holds(diagnosis) { (held(chamber, &hold)) }
        }
    }
}

fn held(chamber: &str, hold: &HoldLeak) -> Markup {
    let flow = |value: f64, std: f64| with_interval(value * LPM_PER_M3S, Some(std * LPM_PER_M3S));
    let [before, after] = hold.apart_sigma();
    html! {
        p { "Chamber " (chamber) ", " (hold.count) " holds of 1 s at " (format!("{:.0} bar", hold.mean_pressure_pa / 1e5)) ": "
            strong { (flow(hold.leak_m3s, hold.std_m3s)) " L/min" } " measured; foretold " (flow(hold.predicted_before_m3s, hold.predicted_before_std_m3s))
            " before (" (format!("{before:.1}")) " σ apart), " (flow(hold.predicted_after_m3s, hold.predicted_after_std_m3s)) " after ("
            (format!("{after:.1}")) " σ apart)." }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn no_zero_is_negative() {
        assert_eq!([-1e-4, 1e-4, -0.6].map(super::percent), ["0 %", "0 %", "-60 %"]);
    }
}
