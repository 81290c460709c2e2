//! Standard output and standard error.

use pitchleak::report::Palette;
use std::fmt::Display;
use std::io::{self, IsTerminal, Write};

/// Writes `text` to standard output.
pub fn print(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}

/// One line on standard error; if that is gone too, so be it.
pub fn complain(kind: &str, message: &dyn Display) {
    let _ = writeln!(io::stderr().lock(), "{kind}: {message}");
}

/// A warning line each.
pub fn warn(warnings: &[String]) {
    for warning in warnings {
        complain("warning", warning);
    }
}

/// Colours only on a terminal, and only where nobody forbids them (no-color.org).
pub fn palette() -> Palette {
    let forbidden = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
        || std::env::var_os("TERM").is_some_and(|term| term == "dumb");
    if io::stdout().is_terminal() && !forbidden { Palette::ANSI } else { Palette::PLAIN }
}
