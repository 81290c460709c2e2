//! The report as lines of text: verdict first, then what backs it.
//!
//! What a terminal can show beside the text: each leak's interval against its alarm level, and its course.

use super::valve::valve_line;
use super::{Text, thresholds_lpm};
use crate::Palette;
use crate::envelope::{Envelopes, Spot};
use crate::text::{Bar, INTERVAL, LIMIT, VALUE, course, scale, scale_text};
use pitchleak::core::{AlarmState, Leak, PerLeak};
use pitchleak::hold::HoldSummary;
use pitchleak::presence::FoundLeak;
use pitchleak::replay::Replay;
use pitchleak::report::{
    EstimateEntry, ReasonId, ReplayReport, TraceSummary, Verdict, capital, interval, with_interval,
};
use pitchleak::rig::Rig;
use pitchleak::trace::Record;
use pitchleak::units::{LPM_PER_BAR, LPM_PER_M3S, duration, readable};
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

/// Cells of a bar.
const BAR: usize = 32;
/// Cells of a course.
const COURSE: usize = 60;

/// Writes the bars, on one scale for all leaks.
fn write_bars(out: &mut String, report: &ReplayReport, sketch: &ReplaySketch, palette: &Palette) {
    let known = Leak::ALL.into_iter().filter(|leak| report.estimates.leaks()[*leak].identifiable);
    let bars: Vec<(Leak, Bar)> =
        known.map(|leak| (leak, Bar::of(&report.leakage[leak], sketch.threshold_lpm[leak]))).collect();
    let Some(ends) = scale(bars.iter().map(|(_, bar)| bar)) else { return };
    let (faint, reset) = palette.faint();
    let range = scale_text(ends);
    let _ = writeln!(
        out,
        "\n{faint}{:<12}{range:<width$}  {VALUE} now  {INTERVAL} 95 %  {LIMIT} alarm level{reset}",
        "leak",
        width = BAR
    );
    for (leak, bar) in bars {
        let _ = writeln!(out, "{:<12}{}", leak.label(), bar.text(ends, BAR).trim_end());
    }
}

/// Writes how large each leak was over the trace; what is above the alarm level stands out.
fn write_courses(out: &mut String, report: &ReplayReport, sketch: &ReplaySketch, palette: &Palette) {
    let courses = sketch.courses_lpm(COURSE);
    let mut flows: Vec<f64> =
        courses.iter().flat_map(|(_, course)| course.iter().flatten().copied()).collect();
    if flows.is_empty() {
        return;
    }
    flows.sort_by(f64::total_cmp);
    // What is usual: estimates begin anywhere.
    let usual = flows.get(flows.len() * 98 / 100).or(flows.last()).copied().unwrap_or(0.0);
    let threshold_lpm = sketch.threshold_lpm;
    let top = threshold_lpm.iter().map(|(_, threshold)| *threshold).fold(usual, f64::max);
    let (faint, reset) = palette.faint();
    let _ = writeln!(out, "\n{faint}{:<12}over the trace, from 0 to {top:.2} L/min{reset}", "leak");
    for (leak, course) in courses.iter() {
        let _ = writeln!(out, "{:<12}{}", leak.label(), line(course, threshold_lpm[leak], top, palette));
    }
    let [from, to] = sketch.ends_s.unwrap_or_default().map(|t_s| report.trace.time(t_s, 0));
    let width = courses.internal.len();
    let _ = writeln!(
        out,
        "{faint}{:<12}{from}{to:>rest$}{reset}",
        "",
        rest = width.saturating_sub(from.chars().count())
    );
}

fn line(flows: &[Option<f64>], threshold_lpm: f64, top: f64, palette: &Palette) -> String {
    let mut text = String::new();
    let same = |a: &Option<f64>, b: &Option<f64>| is_above(a, threshold_lpm) == is_above(b, threshold_lpm);
    for run in flows.chunk_by(same) {
        let above = run.first().is_some_and(|flow| is_above(flow, threshold_lpm));
        let (colour, reset) = if above { palette.fault() } else { ("", "") };
        text += colour;
        text += &course(run, [0.0, top]);
        text += reset;
    }
    text.trim_end().to_owned()
}

fn is_above(flow: &Option<f64>, threshold_lpm: f64) -> bool {
    flow.is_some_and(|flow| flow >= threshold_lpm)
}

/// Stretches of the trace that are kept at most.
const STRETCHES: usize = 480;

/// What a terminal shows of a replay beside its text, gathered on the way in a few kilobytes: how large each leak was over the
/// trace, beside its alarm level.
#[derive(Clone, Debug)]
pub struct ReplaySketch {
    flows_lpm: Envelopes<3>,
    threshold_lpm: PerLeak<f64>,
    ends_s: Option<[f64; 2]>,
}

impl ReplaySketch {
    /// Of a replay by `rig` that has not begun.
    pub fn new(rig: &Rig) -> Self {
        Self { flows_lpm: Envelopes::of_at_most(STRETCHES), threshold_lpm: thresholds_lpm(rig), ends_s: None }
    }

    /// Takes in a record, and the replay that has taken it in before; `renewed` where its estimates are new.
    pub fn add(&mut self, replay: &Replay, record: &Record, renewed: bool) {
        if record.after_gap {
            self.flows_lpm.pause();
        }
        let [first_s, _] = self.ends_s.unwrap_or([record.t_s; 2]);
        self.ends_s = Some([first_s, record.t_s]);
        if !renewed {
            return;
        }
        let flows = replay.watched_flows_m3s();
        let spots = Leak::ALL.map(|leak| Some(Spot::at(flows[leak].value * LPM_PER_M3S)));
        self.flows_lpm.add(record.t_s, &spots);
    }

    /// Each leak's flow over the trace in at most `columns` stretches of the same length, L/min; none where it pauses.
    pub fn courses_lpm(&self, columns: usize) -> PerLeak<Vec<Option<f64>>> {
        let courses = self.flows_lpm.courses(columns);
        PerLeak::from_fn(|leak| courses.get(leak as usize).cloned().unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_course_is_empty_where_the_trace_pauses_and_stands_out_above_the_alarm_level() {
        let course = [Some(0.0), Some(0.05), None, Some(0.4), Some(9.0), Some(-1.0)];
        assert_eq!(line(&course, 0.1, 0.4, &Palette::PLAIN), "▁▂ ██▁");
        assert_eq!(line(&course, 0.1, 0.4, &Palette::ANSI), "▁▂ \x1b[1;31m██\x1b[0m▁");
    }
}
