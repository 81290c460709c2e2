//! A diagnosis as lines of text: the verdict, the effects, the error before and after, the residual, the leaks.

use super::replay::per_bar;
use super::{Text, significant};
use crate::Palette;
use crate::envelope::extremes;
use crate::residuals::{
    before_and_after, estimates, holds, name, people, people_unit, quantity, rms_errors, symbol,
};
use crate::text::level;
use pitchleak::core::effects::EffectConstant;
use pitchleak::core::{Estimate, Leak};
use pitchleak::diagnose::{
    BinnedResidual, Diagnosis, EquationResidual, FoundEffect, LeakEstimate, Samples, Verdict,
};
use pitchleak::report::capital;
use pitchleak::units::{LPM_PER_M3S as LPM, effect_unit};
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
        let mut out = String::new();
        match &self.wiring {
            Some(wiring) => write_wiring(&mut out, wiring),
            None => out = format!("{}\n", sentence(self.verdict)),
        }
        self.effects.iter().for_each(|effect| write_effect(&mut out, effect));
        if let Some(next) = &self.next_measurement {
            let [one, other] = next.between;
            let _ = writeln!(out, "\nMeasure next, to tell {one} from {other}: {}", next.measurement);
        }
        if self.verdict != Verdict::InsufficientExcitation {
            write_errors(&mut out, self);
            write_residuals(&mut out, self);
            write_bins(&mut out, self);
            write_leaks(&mut out, self);
            write_leak_changes(&mut out, self);
            write_holds(&mut out, self);
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

fn write_errors(out: &mut String, diagnosis: &Diagnosis) {
    out.push_str("\nerror on held-out samples   before      after\n");
    for (equation, [before, after], unit) in rms_errors(diagnosis) {
        let _ = writeln!(out, "  {:<22} {before:>10.4} {after:>10.4} {unit}", name(equation));
    }
}

fn write_holds(out: &mut String, diagnosis: &Diagnosis) {
    let flow = |value: f64, std: f64| {
        format!("{:.3} ± {:.3}", value * LPM, Estimate { value, std }.half_width95() * LPM)
    };
    for (chamber, held) in holds(diagnosis) {
        let [before, after] = held.apart_sigma();
        let _ = writeln!(
            out,
            "\nat rest under {:.0} bar ({} holds of 1 s) {} L/min leave chamber {chamber}; what moves predicts {} before \
             ({before:.1} sigma apart), {} after ({after:.1} sigma apart)",
            held.mean_pressure_pa / 1e5,
            held.count,
            flow(held.leak_m3s, held.std_m3s),
            flow(held.predicted_before_m3s, held.predicted_before_std_m3s),
            flow(held.predicted_after_m3s, held.predicted_after_std_m3s)
        );
    }
}

fn write_leaks(out: &mut String, diagnosis: &Diagnosis) {
    let _ = writeln!(out, "\n{:<24} {:>24} {:>22}", "leak, L/min/bar, 95 %", "before", "after");
    let text = |leak: LeakEstimate| {
        per_bar(leak.value, Some(leak.std)) + if leak.physical { "" } else { " (impossible)" }
    };
    let [before, after] = [&diagnosis.before, &diagnosis.after].map(|fit| estimates(&fit.leaks));
    for (leak, (before, after)) in Leak::ALL.into_iter().zip(before.into_iter().zip(after)) {
        let _ = writeln!(out, "  {:<22} {:>24} {:>22}", leak.label(), text(before), text(after));
    }
}

/// Where leaks change, in order of time.
fn write_leak_changes(out: &mut String, diagnosis: &Diagnosis) {
    let changes = &diagnosis.leak_changes;
    if changes.is_empty() {
        return;
    }
    out.push_str("\nleaks that change, L/min/bar            before                  after\n");
    for change in changes.iter().take(MOST_CHANGES) {
        let text = |level: &Estimate<f64>| per_bar(level.value, Some(level.std));
        let leak = Leak::ALL.into_iter().find(|leak| leak.id() == change.fault).map_or("", Leak::label);
        let at = format!("{leak} at {:.1} s", change.time_s);
        let trace = if change.trace == 0 { String::new() } else { format!(", trace {}", change.trace + 1) };
        let (before, after) = (text(&change.before), text(&change.after));
        let _ = writeln!(out, "  {:<22} {before:>24} {after:>22}", at + &trace);
    }
    if let Some(more) = changes.len().checked_sub(MOST_CHANGES).filter(|more| *more > 0) {
        let _ = writeln!(out, "  and {more} more");
    }
}

/// Size against the sensors' noise, whiteness, normality, and what the residual goes with.
fn write_residuals(out: &mut String, diagnosis: &Diagnosis) {
    out.push_str("\nresidual                     of noise    white p   normal p   goes with\n");
    for (equation, side, residual) in before_and_after(diagnosis) {
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

/// The residual against the variables that it follows most, for each equation that is not explained.
fn write_bins(out: &mut String, diagnosis: &Diagnosis) {
    for (equation, residual) in diagnosis.after.residuals.iter() {
        let Some(residual) = residual else { continue };
        if residual.noise_ratio <= 1.0 && residual.beyond_chance().is_empty() {
            continue;
        }
        let bins = diagnosis.after.binned_residuals.iter();
        let mut bins: Vec<&BinnedResidual> =
            bins.filter(|one| one.equation == equation && one.varies()).collect();
        bins.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
        for one in bins.into_iter().take(MOST_NAMED) {
            let _ = writeln!(out, "{}", line(one));
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
    significant(value, 3, 4)
}

/// Wiring comes before any verdict: what the channels say is wrong.
fn write_wiring(out: &mut String, wiring: &Wiring) {
    let _ = writeln!(out, "wiring: {}", wiring.suggestion);
    let Some((table, lines)) = wiring.mending() else {
        out.push_str("Mend the recording; until then no effect is worth looking for.\n");
        return;
    };
    let _ = writeln!(out, "If so, mend it in the rig file and diagnose again:\n\n  [{table}]");
    lines.iter().for_each(|line| _ = writeln!(out, "  {line}"));
}

/// The constants of its law, in people's units.
pub(crate) fn constants(effect: &FoundEffect) -> impl Iterator<Item = (EffectConstant, String)> {
    EffectConstant::ALL.into_iter().filter_map(|one| {
        let spec = one.spec();
        let value = effect.constants.get(spec.id)?;
        // The exponent is no share.
        let (factor, unit) = if spec.unit == "1" { (1.0, "") } else { effect_unit(spec.unit) };
        let name = capital(&spec.id.replace('_', " "));
        Some((one, format!("{name}: {} {unit}", significant(value * factor, 3, 4)).trim_end().to_owned()))
    })
}

fn write_effect(out: &mut String, effect: &FoundEffect) {
    let _ =
        writeln!(out, "\n{}: {} (95 %)", effect.id, quantity(effect.value, Some(effect.std), effect.unit));
    let _ = writeln!(out, "  {}", effect.cause);
    let places = constants(effect).filter(|(constant, _)| constant.is_place());
    places.for_each(|(_, place)| _ = writeln!(out, "  {place}"));
    let _ = writeln!(out, "  To do: {}", effect.remedy);
    if let Some(doubt) = effect.doubts_in_words() {
        let _ = writeln!(out, "  Doubtful: {doubt}.");
    }
}
