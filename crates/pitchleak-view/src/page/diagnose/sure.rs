//! Rivals and the measurements that part them.

use super::super::machine::{facts, prose};
use super::spoken;
use crate::labels::quantity;
use maud::{Markup, html};
use pitchleak::diagnose::Diagnosis;
use pitchleak::report::capital;

/// Rivals and the measurements that part them, what speaks for and against, what would not have shown.
pub(super) fn body(diagnosis: &Diagnosis) -> Markup {
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
