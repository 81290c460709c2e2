//! What the model lacks, each effect with its remedy, doubt and rivals.

use super::super::machine::{facts, prose};
use super::spoken;
use crate::labels::quantity;
use maud::{Markup, html};
use pitchleak::diagnose::{Diagnosis, FoundEffect};
use pitchleak::report::capital;

pub(super) fn body(diagnosis: &Diagnosis) -> Markup {
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

pub(super) fn size(effect: &FoundEffect) -> String {
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
