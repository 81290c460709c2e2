//! Leaks before and after, in motion and at rest.

use crate::labels::quantity;
use maud::{Markup, html};
use pitchleak::core::Leak;
use pitchleak::diagnose::{Diagnosis, HoldLeak, LeakEstimate, LeakEstimates};
use pitchleak::report::{capital, with_interval};
use pitchleak::units::LPM_PER_M3S;

pub(super) fn body(diagnosis: &Diagnosis) -> Markup {
    let both = entries(&diagnosis.before.leaks).into_iter().zip(entries(&diagnosis.after.leaks));
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
        div .wide { table {
            thead { tr { td {} th .number scope="col" { "before, 95 %" } th .number scope="col" { "after, 95 %" } } }
            tbody { @for ((name, before), (_, after)) in both {
                tr {
                    th scope="row" { (capital(name)) }
                    td .number { (text(before)) (mark(before)) }
                    td .number { (text(after)) (mark(after)) }
                }
            } }
        } }
        @if let Some(holds) = diagnosis.holds {
            h3 { "At rest against in motion" }
            p .note { "Flow that leaves a chamber while the piston stands, measured, beside what the model fitted to motion foretells." }
            @for (leak, hold) in [(Leak::ExternalA, holds.chamber_a), (Leak::ExternalB, holds.chamber_b)] {
                @if let Some(hold) = hold { (held(if leak == Leak::ExternalA { "A" } else { "B" }, &hold)) }
            }
        }
    }
}

pub(super) fn entries(leaks: &LeakEstimates) -> [(&'static str, LeakEstimate); 4] {
    [
        ("internal leak", leaks.internal_leak_coefficient),
        ("external A leak", leaks.external_leak_a_coefficient),
        ("external B leak", leaks.external_leak_b_coefficient),
        ("bulk modulus of the oil", leaks.bulk_modulus),
    ]
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
