//! A rig file to fill in: what a trace says of itself stands there, what only people know is a blank that says where it is
//! found.

use crate::read::ProposedLine;
use crate::rig::Rig;
use crate::signal::Signal;
use std::fmt::Write;

/// A key as a blank: its section, an example, where the number is found, and its usual range.
struct Blank {
    section: &'static str,
    key: &'static str,
    example: &'static str,
    note: &'static str,
}

const fn blank(section: &'static str, key: &'static str, example: &'static str, note: &'static str) -> Blank {
    Blank { section, key, example, note }
}

/// Ranges of areas: bores of 25 to 400 mm (ISO 3320).
const BLANKS: [Blank; 12] = [
    blank(
        "cylinder",
        "area_a",
        "12.6 cm^2",
        "piston side: drawing, or π/4·bore² with the bore of the type plate (100/70-1200: bore/rod-stroke, mm); 5 to 1300 cm^2",
    ),
    blank(
        "cylinder",
        "area_b",
        "9.4 cm^2",
        "rod side: drawing, or π/4·(bore² - rod²), the rod's diameter by type plate or calliper; less than area_a",
    ),
    blank("cylinder", "stroke", "200 mm", "type plate, or from end to end with a ruler; 50 to 3000 mm"),
    blank(
        "cylinder",
        "moving_mass",
        "20 kg",
        "piston, rod and what moves with them, by drawing; matters little where the trace has no force; 2 to 2000 kg",
    ),
    blank(
        "cylinder",
        "dead_volume_a",
        "0.5 L",
        "optional: oil at A beside the stroke, up to the flow meter: length of pipes and hoses times π/4·diameter²; 0 to 20 L",
    ),
    blank("cylinder", "dead_volume_b", "0.5 L", "optional: as dead_volume_a, at B"),
    blank(
        "fluid",
        "bulk_modulus",
        "0.8 GPa",
        "oil with its hoses and air: 0.6 to 1.0 GPa with hoses, up to 1.6 GPa with steel pipes (data sheet of the oil)",
    ),
    blank(
        "fluid",
        "bulk_modulus_std",
        "0.2 GPa",
        "optional: how far that may be off, 1 sigma; a quarter where it stays blank",
    ),
    blank(
        "sensors",
        "flow",
        "{ full_scale = \"20 L/min\", accuracy = \"1 %\" }",
        "data sheet or type plate of the flow meters; accuracy 0.2 to 2 % of full scale",
    ),
    blank(
        "sensors",
        "pressure",
        "{ full_scale = \"25 MPa\", accuracy = \"0.5 %\" }",
        "type plate of the pressure sensors (0 to 250 bar is 25 MPa); accuracy 0.1 to 1 %",
    ),
    blank(
        "sensors",
        "position",
        "{ full_scale = \"200 mm\", accuracy = \"0.1 %\" }",
        "data sheet of the position sensor; accuracy 0.01 to 0.5 %",
    ),
    blank(
        "sensors",
        "force",
        "{ full_scale = \"10 kN\", accuracy = \"1 %\" }",
        "only where there is a load cell",
    ),
];

/// Where a valve's spool stands for flow meters.
const VALVE_BLANKS: [Blank; 4] = [
    blank("valve", "rated_flow", "4 L/min", "data sheet of the valve: flow over one fully open edge …"),
    blank(
        "valve",
        "rated_drop",
        "35 bar",
        "… at this drop over it; often half of the drop over the whole valve",
    ),
    blank(
        "valve",
        "null_leak",
        "2 %",
        "optional: what the whole valve leaks at its middle, of rated_flow; 1 to 7 %",
    ),
    blank("valve", "supply", "100 bar", "only where no column has the supply's pressure"),
];

/// What a trace needs before it says anything.
const NEEDED: [Signal; 6] =
    [Signal::Time, Signal::Position, Signal::PressureA, Signal::PressureB, Signal::FlowA, Signal::FlowB];

/// A rig file for traces whose columns `lines` of `[columns]` name; `given` are the signals that need no line, `rig` says how
/// the files are written (`[csv]`). What is not in a trace is a blank, as are the cylinder's numbers.
pub fn template(rig: &Rig, lines: &[ProposedLine], given: &[Signal]) -> String {
    let mut out = "# Rig file of pitchleak. Where a line begins with `#` and a key, a number is to be filled in: take the `#`\n\
                       # away and write yours, with its unit. What stands behind the second `#` says where it is found.\n"
            .to_owned();
    let mut section = "";
    let has_valve = gives(lines, given, Signal::Spool) || gives(lines, given, Signal::Command);
    let valve = VALVE_BLANKS.iter().filter(|_| has_valve);
    for blank in BLANKS.iter().chain(valve) {
        if blank.section != section {
            section = blank.section;
            let _ = writeln!(out, "\n[{section}]");
        }
        let value = if blank.example.starts_with('{') {
            blank.example.to_owned()
        } else {
            format!("\"{}\"", blank.example)
        };
        let _ = writeln!(out, "# {} = {value}   # {}", blank.key, blank.note);
    }
    let missing = NEEDED.into_iter().filter(|signal| !gives(lines, given, *signal)).collect::<Vec<_>>();
    if !lines.is_empty() || !missing.is_empty() {
        out.push_str("\n[columns]\n");
    }
    for ProposedLine { line, why } in lines {
        let _ = writeln!(out, "{line}   # {why}");
    }
    for signal in missing {
        let unit =
            signal.dimension().and_then(|dimension| dimension.units().first()).map_or("", |unit| unit.text);
        let rests = matches!(signal, Signal::FlowA | Signal::FlowB);
        let note =
            if rests { "without it this chamber's equation rests" } else { "no column was recognised" };
        let _ = writeln!(out, "# {} = {{ name = \"\", unit = \"{unit}\" }}   # {note}", signal.name());
    }
    rig.write_csv(&mut out);
    out
}

/// The keys of a [`template`] that no rig can do without.
pub const NEEDED_KEYS: [&str; 5] = ["area_a", "area_b", "stroke", "moving_mass", "bulk_modulus"];

/// Whether a line or the file itself gives a signal; a timestamp is as good as a time.
fn gives(lines: &[ProposedLine], given: &[Signal], signal: Signal) -> bool {
    let names = |signal: Signal| {
        let key = format!("{} = ", signal.name());
        given.contains(&signal) || lines.iter().any(|line| line.line.starts_with(&key))
    };
    names(signal) || (signal == Signal::Time && names(Signal::Timestamp))
}
