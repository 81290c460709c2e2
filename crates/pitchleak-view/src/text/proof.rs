//! What a trace proves, as lines of text: the word first, then what was put in and what was found.

use super::Text;
use super::replay::{data_line, rig_line};
use crate::Palette;
use pitchleak::core::Leak;
use pitchleak::prove::{Case, Least, Proof};
use pitchleak::report::{Status, capital, with_interval};
use pitchleak::units::readable;
use std::fmt::Write;

impl Text for Proof {
    fn to_text(&self, palette: &Palette) -> String {
        let mut out = String::new();
        let colour = if self.is_proven() { Status::Sound } else { Status::Doubtful };
        let (verdict, reset) = palette.verdict(colour);
        let _ = writeln!(out, "{verdict}{}{reset}  {}", proof_word(self), sentence(self));
        let recorded = &self.verdict;
        let _ = writeln!(out, "\nAs recorded: {}. {}\n", recorded.status.word(), recorded.text);
        let (faint, reset) = palette.faint();
        let _ = writeln!(
            out,
            "A known leak put into these readings from {:.1} s on, one at a time:",
            self.onset_s
        );
        let _ = writeln!(
            out,
            "{faint}{:<12}{:>12}   {:<24}{:<14}the best possible{reset}",
            "", "put in", "found, L/min", "alarm after"
        );
        for case in &self.cases {
            let put_in = format!("{} L/min", readable(case.put_in_lpm, 3));
            let best = best_possible(case);
            let line = format!(
                "{:<12}{put_in:>12}   {:<24}{:<14}{best}",
                case.leak.label(),
                found(case),
                seconds(case.alarm_after_s)
            );
            let _ = writeln!(out, "{}", line.trim_end());
        }
        let _ = writeln!(out, "\nFound from  {}", from(self));
        let _ = writeln!(out, "\ntrace       {}: {}", self.trace.path, data_line(&self.trace));
        let _ = writeln!(out, "rig         {}", rig_line(&self.rig));
        out
    }
}

/// The word at the head.
pub(crate) fn proof_word(proof: &Proof) -> &'static str {
    match proof.cases.iter().filter(|case| case.found).count() {
        _ if proof.is_proven() => "PROVEN",
        0 => "NOT PROVEN",
        _ => "PROVEN IN PART",
    }
}

/// What it says, and what to do where it says little.
pub(crate) fn sentence(proof: &Proof) -> String {
    if proof.is_proven() {
        let clean = if proof.verdict.status == Status::Sound { ", and without it none is" } else { "" };
        return format!("Each leak that was put into this trace is found{clean}.");
    }
    let wrong = proof.cases.iter().find_map(|case| Some((case, case.wrongly_named.first()?)));
    if let Some((case, wrong)) = wrong {
        return format!(
            "An {} leak that was put in is called an {} one as well: do not act on this trace alone.",
            case.leak.label(),
            wrong.label()
        );
    }
    let mut missed: Vec<&str> =
        proof.cases.iter().filter(|case| !case.found).map(|case| case.leak.label()).collect();
    missed.dedup();
    let missed = missed.join(", ");
    let why = match &proof.verdict.reasons[..] {
        [first, ..] => format!(" {}.", capital(&first.text)),
        [] => String::new(),
    };
    let record = "Record longer, with the piston moving and both pressures changing, or with finer meters";
    format!("Not every leak that was put in is found: {missed}.{why} {record}.")
}

/// What was found of a case, L/min.
pub(crate) fn found(case: &Case) -> String {
    if case.found {
        with_interval(case.found_lpm, case.std_lpm)
    } else {
        format!("not found: {}", case.status.word())
    }
}

pub(crate) fn seconds(time_s: Option<f64>) -> String {
    time_s.map_or_else(|| "–".to_owned(), |time_s| format!("{time_s:.1} s"))
}

/// What no method with these meters is better than.
pub(crate) fn best_possible(case: &Case) -> String {
    let Some(std) = case.bound_std_lpm else { return "this trace does not tell".to_owned() };
    let half = readable(1.96 * std, 2);
    case.bound_after_s.map_or_else(|| format!("± {half}"), |after_s| format!("± {half}, {after_s:.1} s"))
}

/// From which size on each leak is found.
pub(crate) fn from(proof: &Proof) -> String {
    let of = |(leak, least): (Leak, &Least)| {
        if let Some(reason) = least.reason {
            return format!("{} cannot be put in: {reason}", leak.label());
        }
        let size = least
            .lpm
            .map_or_else(|| "no size that was tried".to_owned(), |lpm| format!("{} L/min", readable(lpm, 2)));
        let bound = least.bound_lpm.map(|lpm| format!(" (at best {})", readable(lpm, 2))).unwrap_or_default();
        format!("{} {size}{bound}", leak.label())
    };
    proof.found_from.iter().map(of).collect::<Vec<_>>().join("; ")
}
