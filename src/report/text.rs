//! The report as lines of text: verdict first, then what backs it.

use super::reason::MISFIT;
use super::sketch::{write_bars, write_courses};
use super::statement::{interval, with_interval};
use super::{EstimateEntry, ReplayReport, Status, TraceSummary, Verdict};
use crate::replay::Sketch;
use crate::rig::Rig;
use crate::units::{LPM_PER_BAR, duration};
use pitchleak_core::AlarmState;
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

    /// How a verdict's word is set.
    pub(crate) fn verdict(&self, status: Status) -> (&'static str, &'static str) {
        let colour = match status {
            Status::Leak => self.fault,
            Status::Sound => self.sound,
            Status::Doubtful | Status::NotSure => self.caution,
        };
        (colour, self.reset)
    }

    pub(super) fn fault(&self) -> (&'static str, &'static str) {
        (self.fault, self.reset)
    }

    pub(crate) fn faint(&self) -> (&'static str, &'static str) {
        (self.faint, self.reset)
    }

    pub(crate) fn caution(&self) -> (&'static str, &'static str) {
        (self.caution, self.reset)
    }
}

/// One line on the data: how much, how regular, what was lost.
pub fn data_line(trace: &TraceSummary) -> String {
    let mut line = format!("{} samples over {:.1} s", trace.samples, trace.duration_s);
    if trace.is_long() {
        let _ = write!(line, " ({})", duration(trace.duration_s));
    }
    if let Some(rate) = trace.sample_rate_hz {
        let _ = write!(line, " at {} Hz", (rate * 100.0).round() / 100.0);
    }
    let plural = |count: u64| if count == 1 { "" } else { "s" };
    let TraceSummary { skipped, gaps, .. } = *trace;
    let _ = write!(line, ", {skipped} row{} skipped, {gaps} gap{}", plural(skipped), plural(gaps));
    line
}

/// Says so where the residuals are larger than the declared noise can make them.
pub(crate) fn misfit(normalised_innovation: [f64; 2]) -> Option<String> {
    let worst = normalised_innovation.into_iter().fold(0.0, f64::max);
    (worst > MISFIT).then(|| {
        format!(
            "Model and declared noise do not explain this trace: its residuals are {:.1} times the noise of \
             [sensors]. Either the sensors are worse than declared, or the model lacks an effect (see `pitchleak \
             diagnose`).",
            worst.sqrt()
        )
    })
}

/// What a doubt may come from where nobody said whose trace it is.
const NO_RIG: &str = "no rig file was given: areas, stroke and sensors are those of the paper's cylinder (wu2011); say yours in \
                      rig.toml beside the trace or by --rig";

/// Which rig a report rests on.
pub(crate) fn rig_line(rig: &str) -> String {
    if rig == Rig::PAPER_NAME {
        "wu2011, built in (no rig.toml beside the trace; --rig FILE for your own)".to_owned()
    } else {
        rig.to_owned()
    }
}

/// More alarms than these are told as spells alone.
const MOST_ALARMS: usize = 12;

impl ReplayReport {
    /// Says so where a verdict in doubt rests on no rig file.
    pub(crate) fn missing_rig(&self) -> Option<&'static str> {
        (self.rig == Rig::PAPER_NAME && !self.verdict.status.is_sure()).then_some(NO_RIG)
    }

    /// The report for people, in the colours of `palette`.
    pub fn to_text(&self, palette: &Palette) -> String {
        self.text(palette, None)
    }

    /// The same for a terminal that knows Unicode: with a bar of each leak's interval, and its course over the trace.
    pub fn to_terminal(&self, palette: &Palette, sketch: &Sketch) -> String {
        self.text(palette, Some(sketch))
    }

    fn text(&self, palette: &Palette, sketch: Option<&Sketch>) -> String {
        let mut out = String::new();
        self.write_verdict(&mut out, palette);
        self.write_reasons(&mut out, palette);
        self.write_leaks(&mut out, palette);
        if let Some(sketch) = sketch {
            write_bars(&mut out, self, sketch, palette);
            write_courses(&mut out, self, sketch, palette);
        }
        self.write_spells(&mut out, palette);
        self.write_alarms(&mut out);
        self.write_scores(&mut out);
        let _ = writeln!(out, "\ntrace      {}: {}", self.trace.path, data_line(&self.trace));
        let _ = writeln!(out, "rig        {}", rig_line(&self.rig));
        let _ = writeln!(out, "estimator  {}", self.estimator.name());
        out
    }

    fn write_verdict(&self, out: &mut String, palette: &Palette) {
        let Verdict { status, text, .. } = &self.verdict;
        let (colour, reset) = palette.verdict(*status);
        let _ = writeln!(out, "{colour}{}{reset}  {text}", status.word());
    }

    /// Reasons beyond the one that the verdict names.
    fn write_reasons(&self, out: &mut String, palette: &Palette) {
        let Palette { caution, reset, .. } = palette;
        let reasons = self.verdict.reasons.iter().skip(1).map(|reason| {
            let suggestion = reason.suggestion.as_ref().map(|text| format!("; {text}")).unwrap_or_default();
            format!("{}{suggestion}", reason.text)
        });
        for (at, reason) in reasons.chain(self.missing_rig().map(str::to_owned)).enumerate() {
            let before = if at == 0 { "\n" } else { "" };
            let _ = writeln!(out, "{before}{caution}also{reset}  {reason}");
        }
        out.push('\n');
    }

    fn write_leaks(&self, out: &mut String, palette: &Palette) {
        let Palette { faint, reset, caution, .. } = palette;
        let _ = writeln!(out, "{faint}{:<12}{:<24}L/min/bar, 95 %{reset}", "leak", "L/min, 95 %");
        for (leak, entry) in self.estimates.leaks() {
            let flow = interval(&self.leakage[leak]);
            let scaled = entry.std.map(|std| std * LPM_PER_BAR);
            let coefficient = with_interval(entry.value * LPM_PER_BAR, scaled);
            let figures =
                [flow, coefficient].map(|text| if entry.identifiable { text } else { "–".to_owned() });
            let [flow, coefficient] = figures;
            let line = format!("{:<12}{flow:<24}{coefficient:<24}", leak.label());
            write_row(out, &line, entry, caution, reset);
        }
        let bulk = &self.estimates.bulk_modulus;
        let gpa = with_interval(bulk.value / 1e9, bulk.std.map(|std| std / 1e9));
        let text =
            if bulk.identifiable { format!("bulk modulus {gpa} GPa") } else { "bulk modulus –".to_owned() };
        write_row(out, &format!("{:<12}{text:<48}", "oil"), bulk, caution, reset);
    }

    /// What a long trace showed from its beginning on, also where its end shows nothing of it.
    fn write_spells(&self, out: &mut String, palette: &Palette) {
        if !self.trace.is_long() && self.alarms.len() <= MOST_ALARMS {
            return;
        }
        let (faint, reset) = palette.faint();
        let begins = self.trace.begins.as_ref();
        let since = begins.map_or_else(String::new, |clock| format!(", which begins {}", clock.start_text()));
        let _ = writeln!(out, "\n{faint}leaks through the trace{since}{reset}");
        if self.spells.is_empty() {
            out.push_str("no alarm at any time\n");
        }
        for spell in &self.spells {
            let when = spell.when(&self.trace);
            let _ = writeln!(out, "{:<12}{when:<32}{}", spell.fault.label(), spell.size());
        }
    }

    fn write_alarms(&self, out: &mut String) {
        if self.alarms.is_empty() || self.alarms.len() > MOST_ALARMS {
            return;
        }
        out.push('\n');
        for alarm in &self.alarms {
            let state = match alarm.state {
                AlarmState::Raised => "raised",
                AlarmState::Cleared => "cleared",
            };
            let at = self.trace.time(alarm.time_s, 2);
            let _ = writeln!(out, "alarm {state} at {at}: {} leak", alarm.fault.label());
        }
    }

    fn write_scores(&self, out: &mut String) {
        let Some(scores) = &self.score else { return };
        if scores.iter().all(|(_, score)| score.is_none()) {
            return;
        }
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
