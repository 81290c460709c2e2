//! A diagnosis as lines of text: the verdict, the effects, the error before and after, the residual, the leaks.

use super::Text;
use super::replay::per_bar;
use crate::Palette;
use crate::bar::level;
use crate::envelope::extremes;
use crate::residuals::{name, people, people_unit, quantity, symbol};
use pitchleak::core::{Estimate, Leak};
use pitchleak::diagnose::{
    BinnedResidual, Diagnosis, Equation, EquationResidual, FoundEffect, LeakEstimate, LeakEstimates, Samples,
    Verdict,
};
use pitchleak::units::LPM_PER_M3S as LPM;
use pitchleak::wiring::Wiring;
use std::fmt::Write;

/// Where less of the traces than this was fitted, they were fitted in pieces: ends that fill no mean aside.
const PIECES_SHARE: f64 = 0.9;

/// Changes of leaks that are listed.
const MOST_CHANGES: usize = 20;

/// Variables named per equation.
const MOST_NAMED: usize = 3;

impl Text for Diagnosis {
    /// A few lines for people; a terminal gets no more.
    fn to_text(&self, _: &Palette) -> String {
        DiagnosisText { diagnosis: self }.text()
    }
}

/// What a verdict says, in a sentence.
pub fn sentence(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Explained => "explained: with the effects below, the residual is sensor noise",
        Verdict::PartlyExplained => {
            "partly explained: the effects below mend much, but not all of it is explained for sure"
        }
        Verdict::NoMissingEffect => "no missing effect: the residual of the declared model is sensor noise",
        Verdict::Unexplained => "unexplained: something is missing, and no known effect fits",
        Verdict::InsufficientExcitation => {
            "insufficient excitation: too little happens in these traces to tell"
        }
    }
}

struct DiagnosisText<'a> {
    diagnosis: &'a Diagnosis,
}

impl DiagnosisText<'_> {
    fn text(&self) -> String {
        let mut out = String::new();
        match &self.diagnosis.wiring {
            Some(wiring) => write_wiring(&mut out, wiring),
            None => out = format!("{}\n", sentence(self.diagnosis.verdict)),
        }
        self.diagnosis.effects.iter().for_each(|effect| write_effect(&mut out, effect));
        if let Some(next) = &self.diagnosis.next_measurement {
            let [one, other] = next.between;
            let _ = writeln!(out, "\nMeasure next, to tell {one} from {other}: {}", next.measurement);
        }
        if self.diagnosis.verdict != Verdict::InsufficientExcitation {
            self.write_errors(&mut out);
            self.write_residuals(&mut out);
            self.write_bins(&mut out);
            self.write_leaks(&mut out);
            self.write_leak_changes(&mut out);
            self.write_holds(&mut out);
        }
        let Samples { read, fitted } = self.diagnosis.samples;
        if (fitted as f64) < PIECES_SHARE * read as f64 {
            let _ = writeln!(out, "note: fitted {fitted} of {read} samples: pieces, evenly over the traces");
        }
        for note in &self.diagnosis.notes {
            let _ = writeln!(out, "note: {note}");
        }
        out
    }

    fn write_errors(&self, out: &mut String) {
        out.push_str("\nerror on held-out samples   before      after\n");
        for (equation, before) in self.diagnosis.before.quality.rmse.iter() {
            let (factor, unit) = people_unit(equation);
            if let (Some(before), Some(after)) = (before, self.diagnosis.after.quality.rmse[equation]) {
                let (name, before, after) = (name(equation), before * factor, after * factor);
                let _ = writeln!(out, "  {name:<22} {before:>10.4} {after:>10.4} {unit}");
            }
        }
    }

    fn write_holds(&self, out: &mut String) {
        let Some(holds) = self.diagnosis.holds else { return };
        for (name, held) in [("A", holds.chamber_a), ("B", holds.chamber_b)] {
            let Some(held) = held else { continue };
            let flow = |value: f64, std: f64| {
                format!("{:.3} ± {:.3}", value * LPM, Estimate { value, std }.half_width95() * LPM)
            };
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
        for ((name, before), after) in
            names.iter().zip(rows(&self.diagnosis.before.leaks)).zip(rows(&self.diagnosis.after.leaks))
        {
            let text = |leak: LeakEstimate| {
                let mark = if leak.physical { "" } else { " (impossible)" };
                per_bar(leak.value, Some(leak.std)) + mark
            };
            let _ = writeln!(out, "  {name:<22} {:>24} {:>22}", text(before), text(after));
        }
    }

    /// Where leaks change, in order of time.
    fn write_leak_changes(&self, out: &mut String) {
        let changes = &self.diagnosis.leak_changes;
        if changes.is_empty() {
            return;
        }
        out.push_str("\nleaks that change, L/min/bar            before                  after\n");
        for change in changes.iter().take(MOST_CHANGES) {
            let text = |level: &Estimate<f64>| per_bar(level.value, Some(level.std));
            let leak = Leak::ALL.into_iter().find(|leak| leak.id() == change.fault).map_or("", Leak::label);
            let at = format!("{leak} at {:.1} s", change.time_s);
            let trace =
                if change.trace == 0 { String::new() } else { format!(", trace {}", change.trace + 1) };
            let (before, after) = (text(&change.before), text(&change.after));
            let _ = writeln!(out, "  {:<22} {before:>24} {after:>22}", at + &trace);
        }
        if let Some(more) = changes.len().checked_sub(MOST_CHANGES).filter(|more| *more > 0) {
            let _ = writeln!(out, "  and {more} more");
        }
    }

    /// Size against the sensors' noise, whiteness, normality, and what the residual goes with.
    fn write_residuals(&self, out: &mut String) {
        out.push_str("\nresidual                     of noise    white p   normal p   goes with\n");
        let sides =
            [("before", &self.diagnosis.before.residuals), ("after", &self.diagnosis.after.residuals)];
        let shown = if self.diagnosis.effects.is_empty() { &sides[..1] } else { &sides[..] };
        for equation in Equation::ALL {
            for (side, residuals) in shown {
                let Some(residual) = &residuals[equation] else { continue };
                let p = |p: Option<f64>| p.map_or_else(|| "-".into(), probability);
                let _ = writeln!(
                    out,
                    "  {:<12} {side:<10} {:>10.2} {:>10} {:>10}   {}",
                    name(equation),
                    residual.noise_ratio,
                    p(residual.whiteness_p),
                    p(residual.normality_p),
                    companions(residual)
                );
            }
        }
    }

    /// The residual against the variables that it follows most, for each equation that is not explained.
    fn write_bins(&self, out: &mut String) {
        for (equation, residual) in self.diagnosis.after.residuals.iter() {
            let Some(residual) = residual else { continue };
            if residual.noise_ratio <= 1.0 && residual.beyond_chance().is_empty() {
                continue;
            }
            let bins = self.diagnosis.after.binned_residuals.iter();
            let mut bins: Vec<&BinnedResidual> =
                bins.filter(|one| one.equation == equation && one.varies()).collect();
            bins.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
            for one in bins.into_iter().take(MOST_NAMED) {
                let _ = writeln!(out, "{}", line(one));
            }
        }
    }
}

/// The variables that a residual goes with, in words.
pub(crate) fn companions(residual: &EquationResidual) -> String {
    let found = residual.beyond_chance().into_iter().take(MOST_NAMED);
    let words: Vec<String> =
        found.map(|(variable, c)| format!("{} ({:+.0} sigma)", symbol(variable), c.sigma)).collect();
    if words.is_empty() { "nothing".into() } else { words.join(", ") }
}

fn line(binned: &BinnedResidual) -> String {
    let (factor, unit) = people_unit(binned.equation);
    let [low, high] = extremes(binned.mean.iter().copied());
    let bars: String = binned.mean.iter().map(|mean| level((mean - low) / (high - low))).collect();
    let [from, to] = extremes(binned.at.iter().copied());
    let (scale, scale_unit) = people(binned.against);
    let space = if scale_unit.is_empty() { "" } else { " " };
    format!(
        "  {:<10} residual {} to {} {unit} against {} from {} to {}{space}{scale_unit}: {bars}",
        name(binned.equation),
        short(low * factor),
        short(high * factor),
        symbol(binned.against),
        short(from * scale),
        short(to * scale)
    )
}

fn probability(p: f64) -> String {
    if p < 1e-3 { "<0.001".into() } else { format!("{p:.3}") }
}

/// Three significant digits.
fn short(value: f64) -> String {
    let decimals = (2.0 - value.abs().max(1e-3).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{value:.decimals$}")
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
    if let Some(doubt) = effect.doubts_in_words() {
        let _ = writeln!(out, "  Doubtful: {doubt}.");
    }
}
