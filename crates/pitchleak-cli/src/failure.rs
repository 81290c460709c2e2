use pitchleak::diagnose::FittedAndJudged;
use pitchleak::fleet::FleetError;
use pitchleak::live::{CheckpointError, ConfigError};
use pitchleak::output::OutputError;
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
