use pitchleak::replay::EstimateFileError;
use pitchleak::rig::RigError;
use pitchleak::trace::TraceError;
use std::io;

/// Why a command ended early; one line for people each.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The rig file.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The trace.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// Standard output.
    #[error("cannot write to standard output: {0}")]
    Output(#[from] io::Error),
    /// The file of estimates.
    #[error(transparent)]
    Estimates(#[from] EstimateFileError),
    /// The report as JSON.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
}

impl Failure {
    /// Whether the reader of standard output is gone.
    pub fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }
}
