//! The machine and what was read of it, as tables.

use crate::text::{data_line, rig_line, significant, thresholds_lpm};
use maud::{Markup, html};
use pitchleak::channels::ChannelFault;
use pitchleak::core::Leak;
use pitchleak::report::TraceSummary;
use pitchleak::rig::{Instrument, Rig};
use pitchleak::units::LPM_PER_M3S;
use pitchleak::wiring::Wiring;

/// A text with what stands in backquotes as code.
pub fn prose(text: &str) -> Markup {
    html! {
        @for (number, piece) in text.split('`').enumerate() {
            @if number % 2 == 1 { code { (piece) } } @else { (piece) }
        }
    }
}

/// Two columns: what, and how much.
pub fn facts(facts: &[(&str, String)]) -> Markup {
    html! {
        div .wide {
            table {
                tbody { @for (name, value) in facts { tr { th scope="row" { (name) } td { bdi { (value) } } } } }
            }
        }
    }
}

/// The rig as the engine has read it.
pub fn rig(rig: &Rig) -> Markup {
    let c = &rig.cylinder;
    let cylinder = [
        ("Rig file", rig_line(&rig.name)),
        ("Areas A, B", format!("{}, {} cm²", short(c.area_a_m2 * 1e4), short(c.area_b_m2 * 1e4))),
        ("Stroke", format!("{} mm", short(c.stroke_m * 1e3))),
        ("Moving mass", format!("{} kg", short(c.moving_mass_kg))),
        (
            "Dead volumes A, B",
            format!("{}, {} ml", short(c.dead_volume_a_m3 * 1e6), short(c.dead_volume_b_m3 * 1e6)),
        ),
        (
            "Bulk modulus",
            format!(
                "{} ± {} GPa (1 σ)",
                short(rig.fluid.bulk_modulus_pa / 1e9),
                short(rig.fluid.bulk_modulus_std_pa / 1e9)
            ),
        ),
    ];
    let i = &rig.instruments;
    let sensors = [
        ("flow A", i.flow_a, LPM_PER_M3S, "L/min"),
        ("flow B", i.flow_b, LPM_PER_M3S, "L/min"),
        ("pressures", i.pressure, 1e-5, "bar"),
        ("position", i.position, 1e3, "mm"),
        ("force", i.force, 1e-3, "kN"),
    ];
    html! {
        (facts(&cylinder))
        h3 { "Sensors as declared" }
        p .note { "These decide how wide every interval is: accuracy is 3 σ of white noise; bias, gain and drift say how far zero \
            and scale may be off (1 σ)." }
        (table(&["sensor", "#full scale", "#accuracy", "#bias", "#gain", "#drift per hour"], html! {
            @for (name, instrument, factor, unit) in sensors { (sensor(name, &instrument, factor, unit)) }
        }))
        @if !rig.effects.is_empty() {
            h3 { "Effects in the rig file" }
            (facts(&rig.effects.iter().map(|(effect, size)| (effect.spec().id, short(size.value))).collect::<Vec<_>>()))
        }
        details { summary { "As a rig file" } pre { (rig.to_toml()) } }
    }
}

fn sensor(name: &str, instrument: &Instrument, factor: f64, unit: &str) -> Markup {
    let percent = |share: f64| format!("{} %", short(share * 100.0));
    let Instrument { full_scale, accuracy, bias, gain, drift } = *instrument;
    html! {
        tr {
            th scope="row" { (name) }
            td .number { (short(full_scale * factor)) " " (unit) }
            @for share in [accuracy, bias, gain, drift] { td .number { (percent(share)) } }
        }
    }
}

/// Alarm thresholds.
pub fn alarms(rig: &Rig) -> String {
    let levels = thresholds_lpm(rig);
    let [first, others @ ..] = Leak::ALL.map(|leak| levels[leak]);
    if others.iter().all(|other| (other - first).abs() < 1e-9) {
        return format!("{} L/min", short(first));
    }
    let level = |leak: Leak| format!("{} {}", leak.label(), short(levels[leak]));
    format!("{} L/min", Leak::ALL.map(level).join(", "))
}

/// Channels that are broken, and a mistake of wiring.
pub fn channels(faults: &[ChannelFault], wiring: Option<&Wiring>) -> Markup {
    html! {
        @if faults.is_empty() {
            p { "No channel is dead, stuck, clipped, held or coarse." }
        } @else {
            (table(&["channel", "from, to (s)", "seen", "check"], html! {
                @for fault in faults {
                    tr {
                        th scope="row" { (fault.channel.name()) }
                        td { (short(fault.from_s)) " to " (short(fault.to_s)) }
                        td { (fault.text) }
                        td { (fault.suggestion) }
                    }
                }
            }))
        }
        @match wiring {
            None => p { "No mistake of wiring, sign or unit shows." },
            Some(wiring) => (mistake(wiring)),
        }
    }
}

fn mistake(wiring: &Wiring) -> Markup {
    html! {
        p { strong { "Check the wiring: " } (prose(&wiring.suggestion)) "." }
        @if let Some((table, lines)) = wiring.mending() {
            p { "Where that is so, this in the rig file mends it:" }
            pre { "[" (table) "]\n" @for line in lines { (line) "\n" } }
        }
    }
}

/// A table that scrolls where it is wider than the page. A head that begins with `#` stands above numbers, an empty one is none.
pub fn table(heads: &[&str], rows: Markup) -> Markup {
    html! {
        div .wide { table {
            thead { tr { @for head in heads {
                @match head.strip_prefix('#') {
                    Some(numbers) => th .number scope="col" { (numbers) },
                    None if head.is_empty() => td {},
                    None => th scope="col" { (head) },
                }
            } } }
            tbody { (rows) }
        } }
    }
}

/// What was read, and what a reader of the results should know of it.
pub fn trace(trace: &TraceSummary) -> Markup {
    html! {
        p { bdi { (trace.path) } ": " (data_line(trace)) "." }
        @if !trace.warnings.is_empty() {
            ul { @for warning in &trace.warnings { li { (prose(warning)) } } }
        }
    }
}

/// What was read, and by what, for data of the form `schema`.
pub fn made(of: &TraceSummary, schema: &str) -> Markup {
    html! {
        (trace(of))
        (facts(&[("Program", super::generator()), ("Form of the data", schema.to_owned())]))
    }
}

/// Two significant digits: how well something is known.
pub fn rough(value: f64) -> String {
    significant(value, 2, 7)
}

/// Four significant digits at the most, without zeros at the end.
pub fn short(value: f64) -> String {
    let text = significant(value, 4, 7);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
