//! A diagnosis as text for people.

use super::labels::{name, people_unit, quantity};
use crate::diagnose::outcome::{Diagnosis, FoundEffect, LeakEstimate, LeakEstimates, Samples, Verdict};
use crate::diagnose::thresholds::CI95_SIGMA;
use crate::report::with_interval;
use crate::units::{LPM_PER_BAR, LPM_PER_M3S as LPM};
use crate::wiring::Wiring;
use std::fmt::Write;

/// Where less of the traces than this was fitted, they were fitted in pieces: ends that fill no mean aside.
const PIECES_SHARE: f64 = 0.9;

impl Verdict {
    /// What it says, in a sentence.
    pub fn sentence(self) -> &'static str {
        match self {
            Self::Explained => "explained: with the effects below, what is left is sensor noise",
            Self::PartlyExplained => "partly explained: the effects below mend much, but not all",
            Self::NoMissingEffect => "no missing effect: what the declared model leaves over is sensor noise",
            Self::Unexplained => "unexplained: something is missing, and no known effect fits",
            Self::InsufficientExcitation => {
                "insufficient excitation: too little happens in these traces to tell"
            }
        }
    }
}

impl Diagnosis {
    /// A few lines for people.
    pub fn to_text(&self) -> String {
        let mut out = String::new();
        match &self.wiring {
            Some(wiring) => write_wiring(&mut out, wiring),
            None => out = format!("{}\n", self.verdict.sentence()),
        }
        self.effects.iter().for_each(|effect| write_effect(&mut out, effect));
        if self.verdict != Verdict::InsufficientExcitation {
            self.write_errors(&mut out);
            self.write_residuals(&mut out);
            self.write_bins(&mut out);
            self.write_leaks(&mut out);
            self.write_holds(&mut out);
        }
        let Samples { read, fitted } = self.samples;
        if (fitted as f64) < PIECES_SHARE * read as f64 {
            let _ = writeln!(out, "note: fitted {fitted} of {read} samples: pieces, evenly over the traces");
        }
        for note in &self.notes {
            let _ = writeln!(out, "note: {note}");
        }
        out
    }

    fn write_errors(&self, out: &mut String) {
        out.push_str("\nerror on held-out samples   before      after\n");
        for (equation, before) in self.before.quality.rmse.iter() {
            let (factor, unit) = people_unit(equation);
            if let (Some(before), Some(after)) = (before, self.after.quality.rmse[equation]) {
                let (name, before, after) = (name(equation), before * factor, after * factor);
                let _ = writeln!(out, "  {name:<22} {before:>10.4} {after:>10.4} {unit}");
            }
        }
    }

    fn write_holds(&self, out: &mut String) {
        let Some(holds) = self.holds else { return };
        for (name, held) in [("A", holds.chamber_a), ("B", holds.chamber_b)] {
            let Some(held) = held else { continue };
            let flow = |value: f64, std: f64| format!("{:.3} ± {:.3}", value * LPM, CI95_SIGMA * std * LPM);
            let [before, after] = held.apart_sigma();
            let _ = writeln!(
                out,
                "\nat rest under {:.0} bar ({} holds of 1 s) {} L/min leave chamber {name}; what moves predicts {} before \
                 ({before:.1} sigma apart), {} after ({after:.1} sigma apart)",
                held.mean_pressure_pa / 1e5,
                held.count,
                flow(held.leak_m3s, held.std_m3s),
                flow(held.predicted_before_m3s, held.predicted_before_std_m3s),
                flow(held.predicted_after_m3s, held.predicted_after_std_m3s)
            );
        }
    }

    fn write_leaks(&self, out: &mut String) {
        let _ = writeln!(out, "\n{:<24} {:>24} {:>22}", "leak, L/min/bar, 95 %", "before", "after");
        let rows = |leaks: &LeakEstimates| {
            [
                leaks.internal_leak_coefficient,
                leaks.external_leak_a_coefficient,
                leaks.external_leak_b_coefficient,
            ]
        };
        let names = ["internal", "external A", "external B"];
        for ((name, before), after) in names.iter().zip(rows(&self.before.leaks)).zip(rows(&self.after.leaks))
        {
            let text = |leak: LeakEstimate| {
                let mark = if leak.physical { "" } else { " (impossible)" };
                with_interval(leak.value * LPM_PER_BAR, Some(leak.std * LPM_PER_BAR)) + mark
            };
            let _ = writeln!(out, "  {name:<22} {:>24} {:>22}", text(before), text(after));
        }
    }
}

/// Wiring comes before any verdict: what the channels say is wrong.
fn write_wiring(out: &mut String, wiring: &Wiring) {
    let _ = writeln!(out, "wiring: {}", wiring.suggestion);
    if wiring.columns.is_empty() {
        out.push_str("Mend the recording; until then no effect is worth looking for.\n");
        return;
    }
    out.push_str("If so, mend it in the rig file and diagnose again:\n\n  [columns]\n");
    wiring.columns.iter().for_each(|line| _ = writeln!(out, "  {line}"));
}

fn write_effect(out: &mut String, effect: &FoundEffect) {
    let _ =
        writeln!(out, "\n{}: {} (95 %)", effect.id, quantity(effect.value, Some(effect.std), effect.unit));
    let _ = writeln!(out, "  {}", effect.cause);
    let _ = writeln!(out, "  To do: {}", effect.remedy);
    if let Some(doubt) = &effect.doubt {
        let _ = writeln!(out, "  Doubtful: {doubt}.");
    }
    if let Some(separation) = &effect.separated_by {
        let rivals = effect.confusable_with.join(", ");
        let _ = writeln!(out, "  These traces cannot tell it from: {rivals}. Would tell: {separation}");
    }
}
