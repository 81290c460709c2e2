//! Results as lines of text: verdict first, then what backs it.
//!
//! Marks in a line of text: an interval beside an alarm level, and heights.

mod check;
mod diagnosis;
mod fleet;
pub(crate) mod proof;
mod replay;
mod valve;

pub use check::CheckSketch;
pub use diagnosis::sentence;
pub(crate) use diagnosis::{companions, constants};
pub use fleet::fleet_terminal;
pub(crate) use fleet::found;
pub use replay::{ReplaySketch, data_line};
pub(crate) use replay::{gpa, hold_line, known, misfit, missing_rig, per_bar, rig_line, unknown};
pub(crate) use valve::valve_line;

use pitchleak::core::PerLeak;
use pitchleak::report::{Leakage, Status};
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

pub(crate) const ZERO: char = '│';
pub(crate) const INTERVAL: char = '━';
pub(crate) const LIMIT: char = '┊';
pub(crate) const VALUE: char = '●';

/// What a bar shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bar {
    pub(crate) interval: [f64; 2],
    /// What stands over all else, and its mark.
    pub(crate) value: (f64, char),
    /// The alarm level.
    pub(crate) limit: f64,
}

/// The ends of a scale that holds zero and all bars; none where they have no length.
pub(crate) fn scale<'a>(bars: impl IntoIterator<Item = &'a Bar>) -> Option<[f64; 2]> {
    let ends = bars.into_iter().flat_map(|bar| [bar.interval[0], bar.interval[1], bar.limit]);
    let ends = ends.filter(|end| end.is_finite());
    let (low, high) = ends.fold((0.0_f64, 0.0_f64), |(low, high), end| (low.min(end), high.max(end)));
    (high > low).then_some([low, high])
}

/// The ends in words.
pub(crate) fn scale_text([low, high]: [f64; 2]) -> String {
    // No minus before a zero.
    let from = if low > -0.005 { 0.0 } else { low };
    format!("{from:.2} to {high:.2} L/min")
}

impl Bar {
    /// Of a leak beside its alarm level, L/min.
    pub(crate) fn of(leakage: &Leakage, threshold_lpm: f64) -> Self {
        Self { interval: leakage.ci95(), value: (leakage.mean_lpm, VALUE), limit: threshold_lpm }
    }

    /// So many cells from one end of the scale to the other; later marks over earlier ones.
    pub(crate) fn text(&self, [low, high]: [f64; 2], cells: usize) -> String {
        let cell = |value: f64| {
            (((value - low) / (high - low)).clamp(0.0, 1.0) * cells.saturating_sub(1) as f64).round() as usize
        };
        let mut text = vec![' '; cells];
        let mut put = |at: usize, mark: char| text.iter_mut().skip(at).take(1).for_each(|cell| *cell = mark);
        put(cell(0.0), ZERO);
        let [from, to] = self.interval.map(cell);
        (from..=to).for_each(|at| put(at, INTERVAL));
        put(cell(self.limit), LIMIT);
        put(cell(self.value.0), self.value.1);
        text.into_iter().collect()
    }
}

const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// A mark for each value between `low` and `high`, a blank for a missing one.
pub(crate) fn course(values: &[Option<f64>], [low, high]: [f64; 2]) -> String {
    values.iter().map(|value| value.map_or(' ', |value| level((value - low) / (high - low)))).collect()
}

/// The mark for a share of the greatest height.
pub(crate) fn level(share: f64) -> char {
    let index = (share * LEVELS.len() as f64) as usize;
    LEVELS.get(index).or(LEVELS.last()).copied().unwrap_or(' ')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_shows_value_interval_and_alarm_level() {
        let bar = Bar { interval: [0.402, 0.598], value: (0.5, VALUE), limit: 0.1 };
        assert_eq!(bar.text([0.0, 0.62], 32), "│    ┊              ━━━━━●━━━━━ ");
        let unsure = Bar { interval: [0.5; 2], limit: 0.5, ..bar };
        assert_eq!(unsure.text([0.0, 0.5], 32).trim_end(), format!("│{}●", " ".repeat(30)));
    }

    #[test]
    fn a_scale_holds_zero_and_what_is_finite() {
        let bar = Bar { interval: [0.2, f64::INFINITY], value: (0.5, VALUE), limit: 0.1 };
        assert_eq!(scale([&bar]), Some([0.0, 0.2]));
        assert_eq!(scale([&Bar { interval: [f64::NAN; 2], limit: 0.0, ..bar }]), None);
        assert_eq!(scale_text([-0.001, 0.2]), "0.00 to 0.20 L/min");
    }

    #[test]
    fn every_share_has_its_height() {
        assert_eq!(
            [-1.0, 0.0, 0.5, 0.99, 1.0, 7.0, f64::NAN].map(level),
            ['▁', '▁', '▅', '█', '█', '█', '▁']
        );
    }
}
