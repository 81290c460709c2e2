//! A check as lines of text: what each signal did, what fails, what the trace tells.

use super::Text;
use super::check_sketch::CheckSketch;
use super::replay::{data_line, hold_line, misfit, rig_line};
use super::valve::valve_line;
use crate::Palette;
use pitchleak::check::{CheckReport, Reach};
use pitchleak::core::PerLeak;
use pitchleak::signal::Signal;
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
        if wiring.columns.is_empty() {
            return;
        }
        let _ = writeln!(out, "Where that is so, this in the rig file mends it:\n    [columns]");
        for line in &wiring.columns {
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
