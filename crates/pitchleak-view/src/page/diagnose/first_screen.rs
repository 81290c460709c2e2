//! The first screen: verdict, what to do, what stays open, and the error before and after.

use super::super::machine::{prose, short};
use super::super::{Card, Head, Tone};
use super::{entries, size, spoken};
use crate::residuals::{name, people_unit};
use maud::{Markup, html};
use pitchleak::diagnose::{Diagnosis, Verdict};
use pitchleak::report::capital;

pub(super) fn head(diagnosis: &Diagnosis) -> Head {
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
    let after = &diagnosis.after.leaks;
    let unknown: Vec<_> =
        entries(after).into_iter().filter(|(_, entry)| !entry.identifiable).map(|(name, _)| name).collect();
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
                @for (equation, before) in diagnosis.before.quality.rmse.iter() {
                    @let (factor, unit) = people_unit(equation);
                    @if let (Some(before), Some(after)) = (before, diagnosis.after.quality.rmse[equation]) {
                        tr {
                            th scope="row" { (name(equation)) ", " (unit) }
                            td .number { (short(before * factor)) }
                            @if found {
                                td .number { (short(after * factor)) }
                                td .number { (percent(1.0 - after / before)) }
                            }
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

#[cfg(test)]
mod tests {
    #[test]
    fn no_zero_is_negative() {
        assert_eq!([-1e-4, 1e-4, -0.6].map(super::percent), ["0 %", "0 %", "-60 %"]);
    }
}
