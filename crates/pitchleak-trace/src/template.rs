//! A rig file to fill in: what a trace says of itself stands there, what only people know is a blank that says where it is
//! found.

use crate::read::ProposedLine;
use crate::rig::Rig;
use crate::signal::Signal;
use std::fmt::Write;

/// What every rig needs, as blanks. Ranges of areas: bores of 25 to 400 mm (ISO 3320).
const BLANKS: &str = include_str!("template/rig.toml");

/// Where a valve's spool stands for flow meters.
const VALVE_BLANKS: &str = include_str!("template/valve.toml");

/// What a trace needs before it says anything.
const NEEDED: [Signal; 6] =
    [Signal::Time, Signal::Position, Signal::PressureA, Signal::PressureB, Signal::FlowA, Signal::FlowB];

/// A rig file for traces whose columns `lines` of `[columns]` name; `given` are the signals that need no line, `rig` says how
/// the files are written (`[csv]`). What is not in a trace is a blank, as are the cylinder's numbers.
pub fn template(rig: &Rig, lines: &[ProposedLine], given: &[Signal]) -> String {
    let mut out = BLANKS.to_owned();
    if gives(lines, given, Signal::Spool) || gives(lines, given, Signal::Command) {
        out.push_str(VALVE_BLANKS);
    }
    let missing = NEEDED.into_iter().filter(|signal| !gives(lines, given, *signal)).collect::<Vec<_>>();
    if !lines.is_empty() || !missing.is_empty() {
        out.push_str("\n[columns]\n");
    }
    for ProposedLine { line, why } in lines {
        let _ = writeln!(out, "{line}   # {why}");
    }
    for signal in missing {
        let unit = signal.si().map_or("", |unit| unit.text);
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
