//! Colours of a terminal, or none.

use pitchleak::report::Status;

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
