use pitchleak::figure::FigureError;
use pitchleak::reference::ReferenceError;
use pitchleak::replay::{EstimateFileError, ReplayError};
use pitchleak::reproduce::ReproduceError;
use pitchleak::rig::RigError;
use pitchleak::simulate::{EffectsError, RecordingError};
use pitchleak::trace::TraceError;
use pitchleak::wind::{EmulationError, HistoryError};
use std::io;
use std::path::PathBuf;

/// Why a command ended early; one line for people each.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The rig file.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The trace.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// The replay of a trace.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// Standard output.
    #[error("cannot write to standard output: {0}")]
    Output(#[from] io::Error),
    /// The file of estimates.
    #[error(transparent)]
    Estimates(#[from] EstimateFileError),
    /// A figure.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// A rig file or a figure.
    #[error("cannot write {file}: {source}")]
    Save {
        /// As named by the user.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// The report as JSON.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// Wind to follow.
    #[error(transparent)]
    Wind(#[from] HistoryError),
    /// Wind that the rig cannot follow.
    #[error(transparent)]
    Emulation(#[from] EmulationError),
    /// Position or load to follow.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// Effects beyond the model.
    #[error(transparent)]
    Effects(#[from] EffectsError),
    /// The simulation or its trace.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The paper's experiment.
    #[error(transparent)]
    Reproduce(#[from] ReproduceError),
    /// A file beside the trace.
    #[error("{path}: {source}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

impl Failure {
    /// Whether the reader of standard output is gone.
    pub fn is_broken_pipe(&self) -> bool {
        let cause = match self {
            Self::Output(cause)
            | Self::Write { source: cause, .. }
            | Self::Recording(RecordingError::Write { source: cause, .. }) => cause,
            _ => return false,
        };
        cause.kind() == io::ErrorKind::BrokenPipe
    }
}
