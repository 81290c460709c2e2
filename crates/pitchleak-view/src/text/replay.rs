//! The report as lines of text: verdict first, then what backs it.

use super::Text;
use super::replay_terminal::{ReplaySketch, write_bars, write_courses};
use super::valve::valve_line;
use crate::Palette;
use pitchleak::core::{AlarmState, Leak};
use pitchleak::hold::HoldSummary;
use pitchleak::presence::FoundLeak;
use pitchleak::report::{
    EstimateEntry, ReasonId, ReplayReport, TraceSummary, Verdict, capital, interval, with_interval,
};
use pitchleak::rig::Rig;
use pitchleak::units::{LPM_PER_BAR, duration, readable};
use std::fmt::Write;

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

/// Says so where no explanation fits the readings.
pub(crate) fn misfit(verdict: &Verdict) -> Option<String> {
    let reason = verdict.reasons.iter().find(|reason| reason.id == ReasonId::ModelDoesNotFit)?;
    Some(format!("{}.", capital(&reason.text)))
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

/// How much of a hold test counts, and from which size on it finds each leak.
pub(crate) fn hold_line(hold: &HoldSummary) -> String {
    let Some(leaks) = &hold.leaks else { return "nothing of it is usable".to_owned() };
    format!("{} s usable; {}", readable(hold.usable_s, 3), finds(leaks.iter()))
}

/// From which size on each leak is found.
pub(super) fn finds<'a>(leaks: impl Iterator<Item = (Leak, &'a FoundLeak)>) -> String {
    let smallest = |(leak, found): (Leak, &FoundLeak)| {
        format!("{} leaks from {} L/min", leak.label(), readable(found.smallest_lpm, 2))
    };
    format!("finds {} on", leaks.map(smallest).collect::<Vec<_>>().join(", "))
}

/// More alarms than these are told as spells alone.
const MOST_ALARMS: usize = 12;

impl Text for ReplayReport {
    fn to_text(&self, palette: &Palette) -> String {
        ReplayText { report: self, palette, sketch: None }.text()
    }
}

impl ReplaySketch {
    /// The report for a terminal that knows Unicode: with a bar of each leak's interval, and its course over the trace.
    pub fn to_text(&self, report: &ReplayReport, palette: &Palette) -> String {
        ReplayText { report, palette, sketch: Some(self) }.text()
    }
}

/// Says so where a verdict in doubt, or one with something that is not as declared, rests on no rig file.
pub(crate) fn missing_rig(report: &ReplayReport) -> Option<&'static str> {
    let verdict = &report.verdict;
    if verdict.reasons.iter().any(|reason| reason.id == ReasonId::NoRigFile) {
        return None;
    }
    let is_declared = verdict.explanations.first().is_none_or(|best| best.cause.is_empty());
    (report.rig == Rig::PAPER_NAME && !(verdict.status.is_sure() && is_declared)).then_some(NO_RIG)
}

/// A report, and how it is to be shown.
struct ReplayText<'a> {
    report: &'a ReplayReport,
    palette: &'a Palette,
    sketch: Option<&'a ReplaySketch>,
}

impl ReplayText<'_> {
    fn text(&self) -> String {
        let mut out = String::new();
        self.write_verdict(&mut out);
        self.write_reasons(&mut out);
        self.write_leaks(&mut out);
        if let Some(sketch) = self.sketch {
            write_bars(&mut out, self.report, sketch, self.palette);
            // What the estimator says without flows, or before a hold, is none of it.
            if self.report.hold.is_none() && self.report.valve.is_none() {
                write_courses(&mut out, self.report, sketch, self.palette);
            }
        }
        self.write_spells(&mut out);
        self.write_alarms(&mut out);
        self.write_scores(&mut out);
        let _ = writeln!(out, "\ntrace      {}: {}", self.report.trace.path, data_line(&self.report.trace));
        let _ = writeln!(out, "rig        {}", rig_line(&self.report.rig));
        let _ = match (&self.report.hold, &self.report.valve) {
            (Some(hold), _) => writeln!(out, "hold test  {}", hold_line(hold)),
            (_, Some(valve)) => writeln!(out, "valve      {}", valve_line(valve)),
            _ => writeln!(out, "estimator  {}", self.report.estimator.name()),
        };
        out
    }

    fn write_verdict(&self, out: &mut String) {
        let Verdict { status, text, .. } = &self.report.verdict;
        let (colour, reset) = self.palette.verdict(*status);
        let _ = writeln!(out, "{colour}{}{reset}  {text}", status.word());
    }

    /// Reasons beyond the one that the verdict names.
    fn write_reasons(&self, out: &mut String) {
        let (caution, reset) = self.palette.caution();
        let reasons = self.report.verdict.reasons.iter().skip(1).map(|reason| {
            let suggestion = reason.suggestion.as_ref().map(|text| format!("; {text}")).unwrap_or_default();
            format!("{}{suggestion}", reason.text)
        });
        for (at, reason) in reasons.chain(missing_rig(self.report).map(str::to_owned)).enumerate() {
            let before = if at == 0 { "\n" } else { "" };
            let _ = writeln!(out, "{before}{caution}also{reset}  {reason}");
        }
        out.push('\n');
    }

    fn write_leaks(&self, out: &mut String) {
        let ((faint, reset), (caution, _)) = (self.palette.faint(), self.palette.caution());
        let _ = writeln!(out, "{faint}{:<12}{:<24}L/min/bar, 95 %{reset}", "leak", "L/min, 95 %");
        for (leak, entry) in self.report.estimates.leaks() {
            let flow = known(entry, || interval(&self.report.leakage[leak]));
            let coefficient = known(entry, || per_bar(entry.value, entry.std));
            let line = format!("{:<12}{flow:<24}{coefficient:<24}", leak.label());
            write_row(out, &line, entry, caution, reset);
        }
        let bulk = &self.report.estimates.bulk_modulus;
        let text = format!("bulk modulus {}", known(bulk, || gpa(bulk)));
        write_row(out, &format!("{:<12}{text:<48}", "oil"), bulk, caution, reset);
    }

    /// What a long trace showed from its beginning on, also where its end shows nothing of it.
    fn write_spells(&self, out: &mut String) {
        if !self.report.trace.is_long() && self.report.alarms.len() <= MOST_ALARMS {
            return;
        }
        let (faint, reset) = self.palette.faint();
        let begins = self.report.trace.begins.as_ref();
        let since = begins.map_or_else(String::new, |clock| format!(", which begins {}", clock.start_text()));
        let _ = writeln!(out, "\n{faint}leaks through the trace{since}{reset}");
        if self.report.spells.is_empty() {
            out.push_str("no alarm at any time\n");
        }
        for spell in &self.report.spells {
            let when = spell.when(&self.report.trace);
            let _ = writeln!(out, "{:<12}{when:<32}{}", spell.fault.label(), spell.size());
        }
    }

    fn write_alarms(&self, out: &mut String) {
        if self.report.alarms.is_empty() || self.report.alarms.len() > MOST_ALARMS {
            return;
        }
        out.push('\n');
        for alarm in &self.report.alarms {
            let state = match alarm.state {
                AlarmState::Raised => "raised",
                AlarmState::Cleared => "cleared",
            };
            let at = self.report.trace.time(alarm.time_s, 2);
            let _ = writeln!(out, "alarm {state} at {at}: {} leak", alarm.fault.label());
        }
    }

    fn write_scores(&self, out: &mut String) {
        let Some(scores) = &self.report.score else { return };
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

/// A figure, where the trace tells it.
pub(crate) fn known(entry: &EstimateEntry, text: impl Fn() -> String) -> String {
    if entry.identifiable { text() } else { "–".to_owned() }
}

/// Why a trace does not tell a figure.
pub(crate) fn unknown(entry: &EstimateEntry) -> &str {
    entry.reason.as_deref().unwrap_or("not enough excitation")
}

/// A bulk modulus with its 95 % interval.
pub(crate) fn gpa(bulk: &EstimateEntry) -> String {
    format!("{} GPa", with_interval(bulk.value / 1e9, bulk.std.map(|std| std / 1e9)))
}

/// A leak coefficient of m³/(s·Pa) with its 95 % interval, L/min/bar.
pub(crate) fn per_bar(value: f64, std: Option<f64>) -> String {
    with_interval(value * LPM_PER_BAR, std.map(|std| std * LPM_PER_BAR))
}

/// A row of the table, and why it is to be doubted.
fn write_row(out: &mut String, line: &str, entry: &EstimateEntry, caution: &str, reset: &str) {
    let _ = if entry.identifiable {
        writeln!(out, "{}", line.trim_end())
    } else {
        writeln!(out, "{line}{caution}not identifiable: {}{reset}", unknown(entry))
    };
}
