//! Standard output and standard error.

use crate::failure::Failure;
use indicatif::{ProgressBar, ProgressStyle};
use pitchleak::report::TraceSummary;
use pitchleak_view::Palette;
use std::borrow::Cow;
use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Writes `text` to standard output.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(harmless(text).as_bytes()).and_then(|()| out.flush()).map_err(Failure::Output)
}

/// Prints a result: as JSON where that is asked for, else as text.
pub fn print_as(
    json: bool,
    to_json: impl FnOnce() -> Result<String, serde_json::Error>,
    to_text: impl FnOnce() -> String,
) -> Result<(), Failure> {
    print(&if json { to_json()? + "\n" } else { to_text() })
}

/// One line on standard error, if that is still open.
pub fn complain(kind: &str, message: &dyn Display) {
    let message = message.to_string().replace('\n', "\\n");
    let _ = writeln!(io::stderr().lock(), "{kind}: {}", harmless(&message));
}

static QUIET: AtomicBool = AtomicBool::new(false);

/// No notes and no warnings from here on, where `quiet`.
pub fn be_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// How a trace was read, and what to know of it.
pub fn tell(trace: &TraceSummary) {
    if let Some(reading) = trace.reading.as_ref().filter(|_| !is_quiet()) {
        complain("note", &format!("{} read with {reading}", trace.path));
    }
    warn(&trace.warnings);
}

/// A warning line each.
pub fn warn(warnings: &[String]) {
    for warning in warnings.iter().filter(|_| !is_quiet()) {
        complain("warning", warning);
    }
}

/// A bar of so many steps on standard error; hidden where that is no terminal.
pub fn bar(length: u64, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style)
}

/// A count of work whose length nobody knows, on standard error; hidden where that is no terminal.
pub fn spinner(template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_spinner());
    ProgressBar::new_spinner().with_style(style)
}

/// Colours only on a terminal, and only where nobody forbids them (no-color.org).
pub fn palette() -> Palette {
    let forbidden = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    if is_terminal() && !forbidden { Palette::ANSI } else { Palette::PLAIN }
}

/// Whether standard output is a terminal that knows more than lines.
fn is_terminal() -> bool {
    io::stdout().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// Whether standard output is a terminal that shows more than letters: by the locale, and on Windows by its own terminal.
pub fn draws() -> bool {
    let says_utf8 = |value: std::ffi::OsString| {
        let value = value.to_string_lossy().to_ascii_lowercase();
        value.contains("utf-8") || value.contains("utf8")
    };
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().filter_map(std::env::var_os);
    let knows = locale.into_iter().find(|value| !value.is_empty()).is_some_and(says_utf8);
    is_terminal() && (knows || std::env::var_os("WT_SESSION").is_some())
}

/// The text with what would steer a terminal made visible: names of files and columns are anybody's. Line ends and our
/// own colours stay.
fn harmless(text: &str) -> Cow<'_, str> {
    if !text.chars().any(steers) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(next) = rest.chars().next() {
        let colour = Palette::ANSI.codes().into_iter().find(|code| rest.starts_with(code));
        let length = colour.map_or(next.len_utf8(), str::len);
        match colour {
            None if steers(next) => out.extend(next.escape_default()),
            _ => out.push_str(&rest[..length]),
        }
        rest = &rest[length..];
    }
    Cow::Owned(out)
}

/// Control characters but the line end, and those that turn the direction of writing.
fn steers(c: char) -> bool {
    (c.is_control() && c != '\n') || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_steer_no_terminal() {
        assert_eq!(harmless("a\x1b]0;title\x07\u{202e}\r\n"), "a\\u{1b}]0;title\\u{7}\\u{202e}\\r\n");
        assert_eq!(harmless("\x1b[8mhidden"), "\\u{1b}[8mhidden");
        let ours = Palette::ANSI.codes().join("leak 0.5 L/min ± 0.1\n");
        assert_eq!(harmless(&ours), ours);
        assert!(matches!(harmless("plain: µ 漏"), Cow::Borrowed(_)));
    }
}
