use super::{CheckReport, Reach, Sketch};
use crate::report::{Palette, data_line, misfit, rig_line};
use crate::signal::Signal;
use crate::units::{Dimension, readable};
use pitchleak_core::PerLeak;
use std::fmt::Write;

impl CheckReport {
    /// The result for people, in the colours of `palette`.
    pub fn to_text(&self, palette: &Palette) -> String {
        self.text(palette, None)
    }

    /// The same for a terminal that knows Unicode: with each signal's course over the trace, and a bar of what is hidden of
    /// each leak.
    pub fn to_terminal(&self, palette: &Palette, sketch: &Sketch) -> String {
        self.text(palette, Some(sketch))
    }

    fn text(&self, palette: &Palette, sketch: Option<&Sketch>) -> String {
        let mut out = String::new();
        let _ = writeln!(out, "trace  {}: {}", self.trace.path, data_line(&self.trace));
        let _ = writeln!(out, "rig    {}\n", rig_line(&self.rig));
        self.write_readings(&mut out, palette, sketch);
        self.write_channels(&mut out, palette);
        self.write_reach(&mut out, palette, sketch);
        self.write_wiring(&mut out, palette);
        self.write_consistency(&mut out, palette);
        out
    }

    fn write_readings(&self, out: &mut String, palette: &Palette, sketch: Option<&Sketch>) {
        let (faint, reset) = palette.faint();
        let over = sketch.map_or("", |_| "    over the trace");
        let _ = writeln!(out, "{faint}{:<12}{:>14}{:>14}   rows{over}{reset}", "signal", "from", "to");
        let courses = sketch.map(|sketch| sketch.courses(&self.readings)).unwrap_or_default();
        let courses = courses.iter().map(String::as_str).chain(std::iter::repeat(""));
        for (reading, course) in self.readings.iter().zip(courses) {
            let dimension = Signal::by_name(reading.signal).and_then(Signal::dimension);
            let Some(unit) = dimension.and_then(Dimension::for_people) else { continue };
            let [least, most] = [reading.least, reading.most].map(|value| readable(unit.from_si(value), 5));
            let signal = format!("{}, {}", reading.signal, unit.text);
            let present = format!("{:.0} %", reading.present_percent);
            let line = format!("{signal:<12}{least:>14}{most:>14}   {present:<6}  {course}");
            let _ = writeln!(out, "{}", line.trim_end());
        }
    }

    fn write_channels(&self, out: &mut String, palette: &Palette) {
        let (caution, reset) = palette.caution();
        if !self.channels.is_empty() {
            let _ = writeln!(out);
        }
        for fault in &self.channels {
            let _ = writeln!(out, "{caution}{}{reset}: {}", fault.text, fault.suggestion);
        }
    }

    fn write_wiring(&self, out: &mut String, palette: &Palette) {
        let Some(wiring) = &self.wiring else { return };
        let (caution, reset) = palette.caution();
        let _ = writeln!(out, "\n{caution}Check the wiring: {}{reset}", wiring.suggestion);
        if wiring.columns.is_empty() {
            return;
        }
        let _ = writeln!(out, "Where that is so, this in the rig file mends it:\n    [columns]");
        for line in &wiring.columns {
            let _ = writeln!(out, "    {line}");
        }
    }

    fn write_reach(&self, out: &mut String, palette: &Palette, sketch: Option<&Sketch>) {
        let (faint, reset) = palette.faint();
        let legend = sketch.map_or_else(String::new, |_| format!("   {}", Sketch::legend()));
        let _ = writeln!(out, "\n{faint}{:<12}this trace shows it to (95 %){legend}{reset}", "leak");
        let hidden = PerLeak::from_fn(|leak| self.leaks[leak].known());
        let bars = sketch.map(|sketch| sketch.bars(hidden)).unwrap_or_default();
        for (leak, reach) in &self.leaks {
            let shown = format!("{:<30}{}", reach.text(1.0, "L/min"), bars[leak]);
            write_reach(out, leak.label(), reach, &shown, palette);
        }
        let bulk_modulus = &self.bulk_modulus;
        write_reach(out, "bulk modulus", bulk_modulus, &bulk_modulus.text(1e-9, "GPa"), palette);
    }

    fn write_consistency(&self, out: &mut String, palette: &Palette) {
        let Some(ratios) = self.normalised_innovation else { return };
        let (caution, reset) = palette.caution();
        let _ = match misfit(ratios) {
            Some(sentence) => writeln!(out, "\n{caution}{sentence}{reset}"),
            None => writeln!(out, "\nModel and declared noise explain this trace."),
        };
    }
}

impl Reach {
    /// Half width of the 95 % interval, where there is one.
    fn known(&self) -> Option<f64> {
        self.resolution.filter(|resolution| self.identifiable && resolution.is_finite())
    }

    fn text(&self, factor: f64, unit: &str) -> String {
        let known = self.known().map(|resolution| format!("± {} {unit}", readable(resolution * factor, 2)));
        known.unwrap_or_default()
    }
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
