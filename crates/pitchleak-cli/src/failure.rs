//! Why a command ends early: a failure, or a signal.

use crate::output;
use pitchleak::output::abandon;
use pitchleak::simulate::RecordingError;
use std::error::Error;
use std::fmt;
use std::io;
use std::path::PathBuf;

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
