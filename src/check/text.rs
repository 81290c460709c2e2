use super::{CheckReport, Reach};
use crate::report::{Palette, data_line, misfit, rig_line};
use crate::signal::Signal;
use crate::units::{Dimension, readable};
use std::fmt::Write;

impl CheckReport {
    /// The result for people, in the colours of `palette`.
    pub fn to_text(&self, palette: &Palette) -> String {
        let mut out = String::new();
        let _ = writeln!(out, "trace  {}: {}", self.trace.path, data_line(&self.trace));
        let _ = writeln!(out, "rig    {}\n", rig_line(&self.rig));
        self.write_readings(&mut out, palette);
        self.write_channels(&mut out, palette);
        self.write_reach(&mut out, palette);
        self.write_wiring(&mut out, palette);
        self.write_consistency(&mut out, palette);
        out
    }

    fn write_readings(&self, out: &mut String, palette: &Palette) {
        let (faint, reset) = palette.faint();
        let _ = writeln!(out, "{faint}{:<12}{:>14}{:>14}   rows{reset}", "signal", "from", "to");
        for reading in &self.readings {
            let dimension = Signal::by_name(reading.signal).and_then(Signal::dimension);
            let Some(unit) = dimension.and_then(Dimension::for_people) else { continue };
            let [least, most] = [reading.least, reading.most].map(|value| readable(unit.from_si(value), 5));
            let signal = format!("{}, {}", reading.signal, unit.text);
            let _ = writeln!(out, "{signal:<12}{least:>14}{most:>14}   {:.0} %", reading.present_percent);
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

    fn write_reach(&self, out: &mut String, palette: &Palette) {
        let (faint, reset) = palette.faint();
        let _ = writeln!(out, "\n{faint}{:<12}this trace shows it to (95 %){reset}", "leak");
        for (leak, reach) in &self.leaks {
            write_reach(out, leak.label(), reach, 1.0, "L/min", palette);
        }
        write_reach(out, "bulk modulus", &self.bulk_modulus, 1e-9, "GPa", palette);
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

fn write_reach(out: &mut String, label: &str, reach: &Reach, factor: f64, unit: &str, palette: &Palette) {
    let (caution, reset) = palette.caution();
    let resolution = reach.resolution.filter(|resolution| resolution.is_finite());
    let resolution = resolution.map(|resolution| format!("± {} {unit}", readable(resolution * factor, 2)));
    let resolution = resolution.filter(|_| reach.identifiable).unwrap_or_default();
    let _ = if reach.identifiable {
        writeln!(out, "{label:<14}{resolution}")
    } else {
        let reason = reach.reason.as_deref().unwrap_or("too little excitation");
        writeln!(out, "{label:<14}{caution}not identifiable: {reason}{reset}")
    };
}
