//! Standard output and standard error, and why a command ends early: a failure, or a signal.

use crate::output;
use indicatif::{ProgressBar, ProgressStyle};
use pitchleak::output::abandon;
use pitchleak::report::TraceSummary;
use pitchleak::simulate::RecordingError;
use pitchleak_view::Palette;
use std::borrow::Cow;
use std::error::Error;
use std::fmt::{self, Display};
use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
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

/// Why a command ended early; one line for people each.
#[derive(Debug)]
pub enum Failure {
    /// What the engine says of traces, rig files, options and output files.
    Engine(Box<dyn Error + Send + Sync>),
    /// The command line.
    Arguments(String),
    /// A trace that is read more than once.
    ReadOnce,
    /// Some of many traces; the others were.
    NotJudged {
        /// Those that were not.
        errors: usize,
        /// All.
        traces: usize,
    },
    /// Lines came, and none was a sample.
    NoSample(u64),
    /// A file that is of one trace.
    OneTraceOnly {
        /// The flag that names the file.
        flag: &'static str,
        /// Traces given.
        traces: usize,
    },
    /// `init` writes over nothing.
    RigIsThere(PathBuf),
    /// A manual page of no command.
    NoCommand(String),
    /// Ctrl-C, or the signal to end.
    Interrupted,
    /// Standard input.
    Input(io::Error),
    /// Standard output.
    Output(io::Error),
}

/// So it is no `Error` itself.
impl<E: Error + Send + Sync + 'static> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Engine(Box::new(error))
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Engine(error) if error.is::<serde_json::Error>() => write!(f, "cannot write JSON: {error}"),
            Self::Engine(error) => error.fmt(f),
            Self::Arguments(answer) => f.write_str(answer),
            Self::ReadOnce => f.write_str("standard input is read once, and this takes files: give a file"),
            Self::NotJudged { errors, traces } => {
                write!(f, "{errors} of {traces} traces could not be judged")
            }
            Self::NoSample(lines) => write!(f, "none of {lines} lines is a sample: the notices say why"),
            Self::OneTraceOnly { flag, traces } => write!(f, "{flag} is of one trace: {traces} are given"),
            Self::RigIsThere(path) => {
                let path = path.display();
                write!(f, "{path} is there already, and stays: name another by --out, or take it away")
            }
            Self::NoCommand(name) => write!(f, "no command `{name}`; pitchleak --help names them"),
            Self::Interrupted => f.write_str("interrupted: no file is left half-written"),
            Self::Input(source) => write!(f, "cannot read standard input: {source}"),
            Self::Output(source) => write!(f, "cannot write to standard output: {source}"),
        }
    }
}

impl Failure {
    /// The program's exit status; after Ctrl-C 130, as shells tell of it.
    pub fn status(&self) -> u8 {
        if matches!(self, Self::Interrupted) { 130 } else { 2 }
    }

    /// Whether the reader of standard output is gone.
    pub fn is_broken_pipe(&self) -> bool {
        let cause = match self {
            Self::Output(cause) => Some(cause),
            Self::Engine(error) => match error.downcast_ref() {
                Some(RecordingError::StandardOutput(cause)) => Some(cause),
                _ => None,
            },
            _ => None,
        };
        cause.is_some_and(|cause| cause.kind() == io::ErrorKind::BrokenPipe)
    }
}

/// Ctrl-C, the signal to end, and a terminal that is gone: from here on these end the program at once, with its half-written files removed.
pub fn leave_nothing_half_written() -> Result<(), Failure> {
    at_the_end(|signal| {
        abandon();
        output::complain("error", &Failure::Interrupted);
        // As shells tell of a signal.
        std::process::exit(128 + signal);
    })
}

/// Has the signals that end a program handled. Of those that whoever started it has ignored (`nohup`, a shell's job in the
/// background) each stays so.
#[cfg(unix)]
pub fn at_the_end(handle: impl Fn(i32) + Send + 'static) -> Result<(), Failure> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let ignored = ignored();
    let heard = [SIGHUP, SIGINT, SIGTERM].into_iter().filter(|signal| ignored & 1 << (signal - 1) == 0);
    let mut signals = Signals::new(heard).map_err(|error| Failure::Output(io::Error::other(error)))?;
    std::thread::spawn(move || signals.forever().for_each(handle));
    Ok(())
}

/// A bit for each signal that is ignored (proc(5)); none where the system does not say.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or_default()
}

/// As above, where there is Ctrl-C alone.
#[cfg(not(unix))]
pub fn at_the_end(handle: impl Fn(i32) + Send + 'static) -> Result<(), Failure> {
    const SIGINT: i32 = 2;
    ctrlc::set_handler(move || handle(SIGINT)).map_err(|error| Failure::Output(io::Error::other(error)))
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
