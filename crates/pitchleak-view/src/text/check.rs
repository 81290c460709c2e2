//! A check as lines of text: what each signal did, what fails, what the trace tells.

use super::replay::{data_line, hold_line, misfit, rig_line};
use super::valve::valve_line;
use super::{Text, thresholds_lpm};
use crate::Palette;
use crate::envelope::{Envelopes, Spot};
use crate::text::{Bar, INTERVAL, LIMIT, ZERO, course, scale};
use pitchleak::check::{CheckReport, Reach, Reading, SIGNALS, values};
use pitchleak::core::{Leak, PerLeak};
use pitchleak::rig::Rig;
use pitchleak::signal::Signal;
use pitchleak::trace::Record;
use pitchleak::units::{Dimension, readable};
use std::fmt::Write;

impl Text for CheckReport {
    fn to_text(&self, palette: &Palette) -> String {
        CheckText { report: self, palette, sketch: None }.text()
    }
}

impl CheckSketch {
    /// The result for a terminal that knows Unicode: with each signal's course over the trace, and a bar of what is hidden of
    /// each leak.
    pub fn to_text(&self, report: &CheckReport, palette: &Palette) -> String {
        CheckText { report, palette, sketch: Some(self) }.text()
    }
}

/// A result, and how it is to be shown.
struct CheckText<'a> {
    report: &'a CheckReport,
    palette: &'a Palette,
    sketch: Option<&'a CheckSketch>,
}

impl CheckText<'_> {
    fn text(&self) -> String {
        let mut out = String::new();
        let _ = writeln!(out, "trace  {}: {}", self.report.trace.path, data_line(&self.report.trace));
        let _ = writeln!(out, "rig    {}\n", rig_line(&self.report.rig));
        if let Some(hold) = &self.report.hold {
            let _ = writeln!(out, "This is a hold test: {}.\n", hold_line(hold));
        }
        if let Some(valve) = &self.report.valve {
            let _ = writeln!(out, "No flow meters, the valve's flows: {}.\n", valve_line(valve));
        }
        self.write_readings(&mut out);
        self.write_channels(&mut out);
        self.write_reach(&mut out);
        self.write_wiring(&mut out);
        self.write_consistency(&mut out);
        out
    }

    fn write_readings(&self, out: &mut String) {
        let (faint, reset) = self.palette.faint();
        let over = self.sketch.map_or("", |_| "    over the trace");
        let _ = writeln!(out, "{faint}{:<12}{:>14}{:>14}   rows{over}{reset}", "signal", "from", "to");
        let courses = self.sketch.map(|sketch| sketch.courses(&self.report.readings)).unwrap_or_default();
        let courses = courses.iter().map(String::as_str).chain(std::iter::repeat(""));
        for (reading, course) in self.report.readings.iter().zip(courses) {
            let dimension = Signal::by_name(reading.signal).and_then(Signal::dimension);
            let Some(unit) = dimension.and_then(Dimension::for_people) else { continue };
            let [least, most] = [reading.least, reading.most].map(|value| readable(unit.from_si(value), 5));
            let signal = format!("{}, {}", reading.signal, unit.text);
            let present = format!("{:.0} %", reading.present_percent);
            let line = format!("{signal:<12}{least:>14}{most:>14}   {present:<6}  {course}");
            let _ = writeln!(out, "{}", line.trim_end());
        }
    }

    fn write_channels(&self, out: &mut String) {
        let (caution, reset) = self.palette.caution();
        if !self.report.channels.is_empty() {
            let _ = writeln!(out);
        }
        for fault in &self.report.channels {
            let _ = writeln!(out, "{caution}{}{reset}: {}", fault.text, fault.suggestion);
        }
    }

    fn write_wiring(&self, out: &mut String) {
        let Some(wiring) = &self.report.wiring else { return };
        let (caution, reset) = self.palette.caution();
        let _ = writeln!(out, "\n{caution}Check the wiring: {}{reset}", wiring.suggestion);
        let Some((table, lines)) = wiring.mending() else { return };
        let _ = writeln!(out, "Where that is so, this in the rig file mends it:\n    [{table}]");
        for line in lines {
            let _ = writeln!(out, "    {line}");
        }
    }

    fn write_reach(&self, out: &mut String) {
        let (faint, reset) = self.palette.faint();
        let legend = self.sketch.map_or_else(String::new, |_| format!("   {}", CheckSketch::legend()));
        let _ = writeln!(out, "\n{faint}{:<12}this trace shows it to (95 %){legend}{reset}", "leak");
        let hidden = PerLeak::from_fn(|leak| known(&self.report.leaks[leak]));
        let bars = self.sketch.map(|sketch| sketch.bars(hidden)).unwrap_or_default();
        for (leak, reach) in &self.report.leaks {
            let shown = format!("{:<30}{}", text(reach, 1.0, "L/min"), bars[leak]);
            write_reach(out, leak.label(), reach, &shown, self.palette);
        }
        let bulk_modulus = &self.report.bulk_modulus;
        write_reach(out, "bulk modulus", bulk_modulus, &text(bulk_modulus, 1e-9, "GPa"), self.palette);
    }

    fn write_consistency(&self, out: &mut String) {
        let (caution, reset) = self.palette.caution();
        let verdict = &self.report.verdict;
        let _ = match misfit(verdict) {
            Some(sentence) => writeln!(out, "\n{caution}{sentence}{reset}"),
            None => writeln!(out, "\n`replay` says {}.", verdict.status.word()),
        };
    }
}

/// Half width of the 95 % interval, where there is one.
fn known(reach: &Reach) -> Option<f64> {
    reach.resolution.filter(|resolution| reach.identifiable && resolution.is_finite())
}

fn text(reach: &Reach, factor: f64, unit: &str) -> String {
    let known = known(reach).map(|resolution| format!("± {} {unit}", readable(resolution * factor, 2)));
    known.unwrap_or_default()
}

/// A line of the table: how well it is known and shown, or why it is not.
fn write_reach(out: &mut String, label: &str, reach: &Reach, shown: &str, palette: &Palette) {
    let (caution, reset) = palette.caution();
    let _ = if reach.identifiable {
        writeln!(out, "{}", format!("{label:<14}{shown}").trim_end())
    } else {
        let reason = reach.reason.as_deref().unwrap_or("too little excitation");
        writeln!(out, "{label:<14}{caution}not identifiable: {reason}{reset}")
    };
}

/// Stretches of the trace that are kept at most.
const STRETCHES: usize = 240;
/// Cells of a course.
const COURSE: usize = 28;
/// Cells of a bar.
const BAR: usize = 32;

/// What a terminal shows of a check beside its text, gathered on the way in a few kilobytes: each signal over the trace,
/// and how large a leak is hidden, beside its alarm level.
#[derive(Clone, Debug)]
pub struct CheckSketch {
    signals: Envelopes<{ SIGNALS.len() }>,
    threshold_lpm: PerLeak<f64>,
}

impl CheckSketch {
    /// Of a check by `rig` that has not begun.
    pub fn new(rig: &Rig) -> Self {
        Self { signals: Envelopes::of_at_most(STRETCHES), threshold_lpm: thresholds_lpm(rig) }
    }

    /// Takes in a record.
    pub fn add(&mut self, record: &Record) {
        if record.after_gap {
            self.signals.pause();
        }
        let spots = values(record).map(|value| value.map(Spot::at));
        self.signals.add(record.t_s, &spots);
    }

    /// Each signal over the trace, from its lowest to its highest reading; in the order of `readings`.
    fn courses(&self, readings: &[Reading]) -> Vec<String> {
        let courses = self.signals.courses(COURSE);
        let of = |reading: &Reading| {
            let place = SIGNALS.iter().position(|signal| signal.name() == reading.signal)?;
            Some(course(courses.get(place)?, [reading.least, reading.most]))
        };
        readings.iter().map(|reading| of(reading).unwrap_or_default()).collect()
    }

    /// Says what the bars show.
    fn legend() -> String {
        format!("{INTERVAL} hidden by noise  {LIMIT} alarm level")
    }

    /// A bar for each leak of these resolutions, L/min, on one scale.
    fn bars(&self, resolution_lpm: PerLeak<Option<f64>>) -> PerLeak<String> {
        let bar = |leak: Leak| {
            let interval = [0.0, resolution_lpm[leak]?];
            Some(Bar { interval, value: (0.0, ZERO), limit: self.threshold_lpm[leak] })
        };
        let bars = PerLeak::from_fn(bar);
        let ends = scale(bars.iter().filter_map(|(_, bar)| bar.as_ref()));
        bars.map(|bar| bar.zip(ends).map_or_else(String::new, |(bar, ends)| bar.text(ends, BAR)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sketch() -> CheckSketch {
        let mut sketch = CheckSketch::new(&Rig::paper());
        for i in (0..1000).filter(|i| !(400..600).contains(i)) {
            let mut record = Record { t_s: 0.01 * f64::from(i), after_gap: i == 600, ..Record::default() };
            record.sample.x_m = 1e-4 * f64::from(i);
            record.sample.qb_m3s = None;
            sketch.add(&record);
        }
        sketch
    }

    #[test]
    fn a_signal_goes_from_its_lowest_to_its_highest_reading_and_stops_where_the_trace_pauses() {
        let reading = |signal, most| Reading { signal, unit: "", least: 0.0, most, present_percent: 100.0 };
        let courses = sketch().courses(&[reading("x", 0.1), reading("pa", 0.0), reading("qb", 0.0)]);
        assert_eq!(courses[0], "▁▁▁▂▂▂▂▃▃▃▄▄    ▅▆▆▆▆▇▇▇▇███");
        assert_eq!(courses[1], courses[0].replace(|mark| mark != ' ', "▁"));
        assert_eq!(courses[2].trim(), "");
    }

    #[test]
    fn what_is_hidden_is_seen_beside_the_alarm_level() {
        let sketch = CheckSketch { threshold_lpm: PerLeak::from_fn(|_| 0.1), ..sketch() };
        let known = PerLeak { internal: Some(0.05), external_a: Some(0.2), external_b: None };
        let bars = sketch.bars(known);
        assert_eq!(bars.internal.trim_end(), "│━━━━━━━━       ┊");
        assert_eq!(bars.external_a, "│━━━━━━━━━━━━━━━┊━━━━━━━━━━━━━━━");
        assert_eq!(bars.external_b, "");
    }
}
