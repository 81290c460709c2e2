//! Why a command ends early: a failure, or a signal.

use crate::output;
use pitchleak::diagnose::FittedAndJudged;
use pitchleak::fleet::FleetError;
use pitchleak::live::{CheckpointError, ConfigError};
use pitchleak::output::{OutputError, abandon};
use pitchleak::prove::ProveError;
use pitchleak::replay::{EstimateFileError, ReplayError};
use pitchleak::rig::RigError;
use pitchleak::simulate::{PlanError, RecordingError};
use pitchleak::trace::TraceError;
use pitchleak::valve::CalibrationError;
use pitchleak_reproduce::ReproduceError;
use pitchleak_view::figure::FigureError;
use pitchleak_view::page::PageError;
use std::io;
use std::path::PathBuf;

/// Why a command ended early; one line for people each.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The rig file.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The command line.
    #[error("{0}")]
    Arguments(String),
    /// The trace.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// The traces' roles.
    #[error(transparent)]
    Roles(#[from] FittedAndJudged),
    /// The replay of a trace.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// A leak that cannot be put into a trace.
    #[error(transparent)]
    Prove(#[from] ProveError),
    /// A valve that cannot be calibrated.
    #[error(transparent)]
    Calibrate(#[from] CalibrationError),
    /// A trace that is read more than once.
    #[error("standard input is read once, and this takes files: give a file")]
    ReadOnce,
    /// The traces of a fleet.
    #[error(transparent)]
    Fleet(#[from] FleetError),
    /// Some of many traces; the others were.
    #[error("{errors} of {traces} traces could not be judged")]
    NotJudged {
        /// Those that were not.
        errors: usize,
        /// All.
        traces: usize,
    },
    /// A file that is of one trace.
    #[error("{flag} is of one trace: {traces} are given")]
    OneTraceOnly {
        /// The flag that names the file.
        flag: &'static str,
        /// Traces given.
        traces: usize,
    },
    /// `init` writes over nothing.
    #[error("{path} is there already, and stays: name another by --out, or take it away", path = .0.display())]
    RigIsThere(PathBuf),
    /// A manual page of no command.
    #[error("no command `{0}`; pitchleak --help names them")]
    NoCommand(String),
    /// Ctrl-C, or the signal to end.
    #[error("interrupted: no file is left half-written")]
    Interrupted,
    /// Standard input.
    #[error("cannot read standard input: {0}")]
    Input(io::Error),
    /// The configuration of a watch.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The state of a watch.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Standard output.
    #[error("cannot write to standard output: {0}")]
    Output(#[from] io::Error),
    /// The file of estimates.
    #[error(transparent)]
    Estimates(#[from] EstimateFileError),
    /// The page of a report.
    #[error(transparent)]
    Page(#[from] PageError),
    /// A figure.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// A rig file or a figure.
    #[error(transparent)]
    Save(#[from] OutputError),
    /// The report as JSON.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// What is to be simulated.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The simulation or its trace.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The paper's experiment.
    #[error(transparent)]
    Reproduce(#[from] ReproduceError),
}

impl Failure {
    /// The program's exit status; after Ctrl-C 130, as shells tell of it.
    pub fn status(&self) -> u8 {
        if matches!(self, Self::Interrupted) { 130 } else { 2 }
    }

    /// Whether the reader of standard output is gone.
    pub fn is_broken_pipe(&self) -> bool {
        let cause = match self {
            Self::Output(cause) | Self::Recording(RecordingError::StandardOutput(cause)) => cause,
            _ => return false,
        };
        cause.kind() == io::ErrorKind::BrokenPipe
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
