//! Results as lines of text: verdict first, then what backs it.

mod check;
mod diagnosis;
mod fleet;
pub(crate) mod proof;
mod replay;
mod valve;

pub use check::CheckSketch;
pub(crate) use diagnosis::companions;
pub use diagnosis::sentence;
pub use fleet::fleet_terminal;
pub(crate) use fleet::found;
pub use replay::{ReplaySketch, data_line};
pub(crate) use replay::{gpa, hold_line, known, misfit, missing_rig, per_bar, rig_line, unknown};
pub(crate) use valve::valve_line;

use pitchleak::core::PerLeak;
use pitchleak::report::Status;
use pitchleak::rig::Rig;
use pitchleak::units::LPM_PER_M3S;

/// A result that people read.
pub trait Text {
    /// In the colours of `palette`.
    fn to_text(&self, palette: &Palette) -> String;
}

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

    pub(crate) fn fault(&self) -> (&'static str, &'static str) {
        (self.fault, self.reset)
    }

    pub(crate) fn faint(&self) -> (&'static str, &'static str) {
        (self.faint, self.reset)
    }

    pub(crate) fn caution(&self) -> (&'static str, &'static str) {
        (self.caution, self.reset)
    }
}

/// What every trace is to tell: the leaks in their order, and the oil.
pub(crate) const ESTIMATES: [&str; 4] =
    ["internal leak", "external A leak", "external B leak", "bulk modulus of the oil"];

/// The alarm level of each leak, L/min.
pub(crate) fn thresholds_lpm(rig: &Rig) -> PerLeak<f64> {
    rig.alarms.threshold_m3s.map(|flow| flow * LPM_PER_M3S)
}

/// A number with so many significant digits, and no more than so many decimals.
pub(crate) fn significant(value: f64, digits: i32, most_decimals: i32) -> String {
    let decimals = (f64::from(digits - 1) - value.abs().log10().floor()).clamp(0.0, most_decimals.into());
    format!("{value:.*}", decimals as usize)
}
