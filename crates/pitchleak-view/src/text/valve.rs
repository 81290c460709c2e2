//! A valve's calibration, and what its flows are worth, as text.

use super::Text;
use super::replay::finds;
use crate::Palette;
use pitchleak::core::Leak;
use pitchleak::units::{duration, readable};
use pitchleak::valve::{Calibration, EdgeFound, LeaksThen, ValveSummary};
use std::fmt::Write;

/// On what the flows rest, and from which size on each leak is found.
pub(crate) fn valve_line(valve: &ValveSummary) -> String {
    let [least, most] = valve.spool_range.map(|share| readable(100.0 * share, 2));
    let basis = match valve.calibrated {
        Some(since) => format!("calibrated on {}", since.date),
        None => "by its data sheet".to_owned(),
    };
    let head = format!("{basis}; spool from {least} to {most} %");
    let Some(leaks) = &valve.leaks else { return format!("{head}; tells of no leaks") };
    // Of the leak at a chamber whose pressure is not measured nothing is told.
    let untold = valve.unread.map(|name| if name == "pa" { Leak::ExternalA } else { Leak::ExternalB });
    format!("{head}; {}", finds(leaks.iter().filter(|(leak, _)| Some(*leak) != untold)))
}

impl Text for Calibration {
    fn to_text(&self, palette: &Palette) -> String {
        let (faint, reset) = palette.faint();
        let [least, most] = self.spool_range.map(|share| readable(100.0 * share, 2));
        let mut out = format!(
            "{} of {} trace{}: the spool was seen from {least} to {most} %\n\n",
            duration(self.seconds),
            self.traces.len(),
            if self.traces.len() == 1 { "" } else { "s" }
        );
        let _ = writeln!(
            out,
            "{faint}{:<8}{:>21}{:>23}{:>29}{reset}",
            "edge", "gain, of the sheet's", "overlap, % of stroke", "clearance at 50 bar, L/min"
        );
        for EdgeFound { name, gain, lap, clearance_lpm } in self.edges() {
            let with = |[value, std]: [f64; 2], scale: f64, digits: usize| {
                format!("{:.digits$} ± {:.digits$}", value * scale, std * scale)
            };
            let _ = writeln!(
                out,
                "{name:<8}{:>21}{:>23}{:>29}",
                with(gain, 1.0, 4),
                with(lap, 100.0, 3),
                with(clearance_lpm, 1.0, 4)
            );
        }
        let _ = writeln!(out, "\nThe readings scatter {:.2} times as declared.", self.scatter);
        out.push_str(match (self.leaks, &self.evidence) {
            (LeaksThen::Zero, Some(_)) => "Leaks are absolute from here on: a hold test found none.\n",
            (LeaksThen::Zero, None) => "Leaks are absolute from here on if nothing leaked: that is assumed, and a hold test would show it (--evidence).\n",
            (LeaksThen::Unknown, _) => "External leaks are changes since today from here on; internal ones are absolute.\n",
        });
        out
    }
}
