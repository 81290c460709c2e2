//! The report as lines of text: verdict first, then what backs it.

use super::{EstimateEntry, Estimates, Leakage, ReplayReport, TraceSummary, Verdict};
use crate::rig::Rig;
use crate::units::{LPM_PER_BAR, LPM_PER_M3S};
use pitchleak_core::{AlarmState, Estimate, Leak, PerLeak};
use std::fmt::Write;

/// Escape sequences around a text, empty where the reader is no terminal.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    fault: &'static str,
    sound: &'static str,
    caution: &'static str,
    faint: &'static str,
    reset: &'static str,
}

impl Palette {
    /// No colours.
    pub const PLAIN: Self = Self { fault: "", sound: "", caution: "", faint: "", reset: "" };
    /// ANSI colours.
    pub const ANSI: Self = Self {
        fault: "\x1b[1;31m",
        sound: "\x1b[1;32m",
        caution: "\x1b[33m",
        faint: "\x1b[2m",
        reset: "\x1b[0m",
    };
}

impl Palette {
    /// What it writes between words.
    pub fn codes(&self) -> [&'static str; 5] {
        [self.fault, self.sound, self.caution, self.faint, self.reset]
    }

    pub(crate) fn faint(&self) -> (&'static str, &'static str) {
        (self.faint, self.reset)
    }

    pub(crate) fn caution(&self) -> (&'static str, &'static str) {
        (self.caution, self.reset)
    }
}

/// Where to look for a leak.
fn advice(leak: Leak) -> &'static str {
    match leak {
        Leak::Internal => "oil passes the piston seal: plan its change, check the bore for scoring",
        Leak::ExternalA => "oil leaves the piston-side chamber: check its port, hose, fittings and valve",
        Leak::ExternalB => "oil leaves the rod-side chamber: check rod seal, port, hose and valve",
    }
}

/// The verdict as a sentence or two.
pub(super) fn verdict(
    faults: &[Leak],
    leakage: &PerLeak<Leakage>,
    estimates: &Estimates,
    threshold_m3s: &PerLeak<f64>,
    trace: &TraceSummary,
) -> String {
    let identified = estimates.leaks().map(|entry| entry.identifiable);
    let (open, judged): (Vec<_>, Vec<_>) =
        Leak::ALL.into_iter().filter(|leak| !faults.contains(leak)).partition(|leak| !identified[*leak]);
    let impossible = Leak::ALL.into_iter().filter_map(|leak| impossible_sentence(leak, &leakage[leak]));
    let mut sentences: Vec<_> = mostly_bad_sentence(trace).into_iter().chain(impossible).collect();
    sentences.extend(faults.iter().map(|leak| fault_sentence(*leak, &leakage[*leak])));
    if !judged.is_empty() {
        let limit = judged.iter().map(|leak| threshold_m3s[*leak]).fold(0.0, f64::max) * LPM_PER_M3S;
        sentences.push(format!("No {} leak above {limit:.2} L/min.", join(&judged, "or")));
    }
    if !open.is_empty() {
        sentences.push(format!("This trace cannot tell about {} leaks.", join(&open, "and")));
    }
    sentences.join(" ")
}

fn fault_sentence(leak: Leak, leakage: &Leakage) -> String {
    let label = leak.label();
    let capital = label[..1].to_uppercase() + &label[1..];
    let flow = flow_text(leakage);
    format!("{capital} leak of {flow} L/min: {}.", advice(leak))
}

/// Where more rows are bad than good, what remains may not stand for the cylinder.
fn mostly_bad_sentence(trace: &TraceSummary) -> Option<String> {
    let rows = trace.samples + trace.skipped;
    (trace.skipped > trace.samples).then(|| {
        format!("{} of {rows} rows are bad and were skipped: take the figures with doubt.", trace.skipped)
    })
}

/// A leak that feeds oil in is evidence against the model, not a leak: nothing else that the model says
/// can then be trusted.
fn is_impossible(leakage: &Leakage) -> bool {
    leakage.std_lpm.is_some_and(|std| leakage.mean_lpm + 3.0 * std < 0.0)
}

fn impossible_sentence(leak: Leak, leakage: &Leakage) -> Option<String> {
    is_impossible(leakage).then(|| {
        let label = leak.label();
        format!(
            "The {label} leak comes out negative, which cannot be: the rig file misstates the rig or lacks an \
             effect (see `pitchleak diagnose`), so take the other figures with doubt."
        )
    })
}

fn join(leaks: &[Leak], word: &str) -> String {
    match leaks {
        [one] => one.label().to_owned(),
        [head @ .., last] => {
            let head: Vec<_> = head.iter().map(|leak| leak.label()).collect();
            format!("{} {word} {}", head.join(", "), last.label())
        }
        [] => String::new(),
    }
}

/// Value and half width of the 95 % interval, to two digits of the half width.
fn with_interval(value: f64, std: Option<f64>) -> String {
    let Some(half) = std.map(|std| Estimate { value, std }.half_width95()).filter(|half| half.is_finite())
    else {
        return format!("{value:.4}");
    };
    let decimals = if half > 0.0 { (1.0 - half.log10().floor()).clamp(0.0, 6.0) as usize } else { 6 };
    let text = format!("{value:.decimals$} ± {half:.decimals$}");
    // No minus before a zero.
    match text.strip_prefix('-') {
        Some(rest) if !rest.split(' ').next().is_some_and(|v| v.contains(|c| ('1'..='9').contains(&c))) => {
            rest.to_owned()
        }
        _ => text,
    }
}

fn flow_text(leakage: &Leakage) -> String {
    with_interval(leakage.mean_lpm, leakage.std_lpm)
}

/// One line on the data: how much, how regular, what was lost.
pub fn data_line(trace: &TraceSummary) -> String {
    let mut line = format!("{} samples over {:.1} s", trace.samples, trace.duration_s);
    if let Some(rate) = trace.sample_rate_hz {
        let _ = write!(line, " at {} Hz", (rate * 100.0).round() / 100.0);
    }
    let _ = write!(line, ", {} rows skipped, {} gaps", trace.skipped, trace.gaps);
    line
}

/// Innovations this many times the declared noise are no noise.
const SUSPICIOUS: f64 = 2.0;

/// Says so where the residuals are larger than the declared noise can make them.
pub(crate) fn misfit(normalised_innovation: [f64; 2]) -> Option<String> {
    let worst = normalised_innovation.into_iter().fold(0.0, f64::max);
    (worst > SUSPICIOUS).then(|| {
        format!(
            "Model and declared noise do not explain this trace: its residuals are {:.1} times the noise of \
             [sensors]. Either the sensors are worse than declared, or the model lacks an effect (see `pitchleak \
             diagnose`).",
            worst.sqrt()
        )
    })
}

/// Which rig a report rests on.
pub(crate) fn rig_line(rig: &str) -> String {
    if rig == Rig::PAPER_NAME {
        "wu2011, built in (no rig.toml beside the trace; --rig FILE for your own)".to_owned()
    } else {
        rig.to_owned()
    }
}

impl ReplayReport {
    /// The report for people, in the colours of `palette`.
    pub fn to_text(&self, palette: &Palette) -> String {
        let mut out = String::new();
        self.write_verdict(&mut out, palette);
        self.write_leaks(&mut out, palette);
        self.write_misfit(&mut out, palette);
        self.write_alarms(&mut out);
        self.write_scores(&mut out);
        let _ = writeln!(out, "\ntrace      {}: {}", self.trace.path, data_line(&self.trace));
        let _ = writeln!(out, "rig        {}", rig_line(&self.rig));
        let _ = writeln!(out, "estimator  {}", self.estimator.name());
        out
    }

    fn write_verdict(&self, out: &mut String, palette: &Palette) {
        let Verdict { faults, text } = &self.verdict;
        let impossible = self.leakage.iter().any(|(_, leakage)| is_impossible(leakage));
        let doubtful = impossible || mostly_bad_sentence(&self.trace).is_some();
        let judged = self.estimates.leaks().iter().all(|(_, entry)| entry.identifiable);
        let (word, colour) = match (doubtful, faults.is_empty(), judged) {
            (true, _, _) => ("DOUBTFUL", palette.caution),
            (false, false, _) => ("LEAK", palette.fault),
            (false, true, true) => ("SOUND", palette.sound),
            (false, true, false) => ("NOT SURE", palette.caution),
        };
        let _ = writeln!(out, "{colour}{word}{}  {text}\n", palette.reset);
    }

    fn write_leaks(&self, out: &mut String, palette: &Palette) {
        let Palette { faint, reset, caution, .. } = palette;
        let _ = writeln!(out, "{faint}{:<12}{:<24}L/min/bar, 95 %{reset}", "leak", "L/min, 95 %");
        for (leak, entry) in self.estimates.leaks() {
            let flow = flow_text(&self.leakage[leak]);
            let scaled = entry.std.map(|std| std * LPM_PER_BAR);
            let coefficient = with_interval(entry.value * LPM_PER_BAR, scaled);
            let line = format!("{:<12}{flow:<24}{coefficient:<24}", leak.label());
            write_row(out, &line, entry, caution, reset);
        }
        let bulk = &self.estimates.bulk_modulus;
        let gpa = with_interval(bulk.value / 1e9, bulk.std.map(|std| std / 1e9));
        let line = format!("{:<12}{:<48}", "oil", format!("bulk modulus {gpa} GPa"));
        write_row(out, &line, bulk, caution, reset);
    }

    fn write_misfit(&self, out: &mut String, palette: &Palette) {
        let Palette { caution, reset, .. } = palette;
        if let Some(sentence) = self.normalised_innovation.and_then(misfit) {
            let _ = writeln!(out, "\n{caution}{sentence}{reset}");
        }
    }

    fn write_alarms(&self, out: &mut String) {
        if self.alarms.is_empty() && self.changed_at_s.is_none() {
            return;
        }
        out.push('\n');
        if let Some(t_s) = self.changed_at_s {
            let _ = writeln!(out, "at {t_s:.2} s the leak changed at once: all figures are those since then");
        }
        for alarm in &self.alarms {
            let state = match alarm.state {
                AlarmState::Raised => "raised",
                AlarmState::Cleared => "cleared",
            };
            let _ = writeln!(out, "alarm {state} at {:.2} s: {} leak", alarm.time_s, alarm.fault.label());
        }
    }

    fn write_scores(&self, out: &mut String) {
        let Some(scores) = &self.score else { return };
        let _ = writeln!(out, "\nagainst the reference leak flows, in steady state");
        for (leak, score) in scores {
            let Some(score) = score else { continue };
            let converged = match score.convergence_time_s {
                Some(time_s) => format!("within 5 % after {time_s:.2} s"),
                None => "never within 5 % for good".to_owned(),
            };
            let _ = writeln!(
                out,
                "{:<12}leakage error {:.2} % mean, {:.2} % peak; coefficient {:.2} %, {:.2} %; {converged}",
                leak.label(),
                score.leakage_mean_error_percent,
                score.leakage_peak_error_percent,
                score.coefficient_mean_error_percent,
                score.coefficient_peak_error_percent,
            );
        }
    }
}

/// A row of the table, and why it is to be doubted.
fn write_row(out: &mut String, line: &str, entry: &EstimateEntry, caution: &str, reset: &str) {
    let _ = if entry.identifiable {
        writeln!(out, "{}", line.trim_end())
    } else {
        let reason = entry.reason.as_deref().unwrap_or("not enough excitation");
        writeln!(out, "{line}{caution}not identifiable: {reason}{reset}")
    };
}
