use pitchleak::live::{CheckpointError, ConfigError};
use std::io;
use std::path::{Path, PathBuf};

/// Why the service does not start, or ended; one line for people each.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    #[error("cannot read {path}: {source}", path = path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{path}: {why}", path = path.display())]
    Content { path: PathBuf, why: String },
    #[error(transparent)]
    Watch(#[from] ConfigError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("cannot listen on {address}: {source}")]
    Listen { address: String, source: io::Error },
    #[error("TLS: {0}")]
    Tls(String),
    #[error("cannot write to standard output: {0}")]
    Output(io::Error),
    #[error("cannot {what}: {source}")]
    System { what: &'static str, source: io::Error },
}

impl Failure {
    pub fn content(path: &Path, why: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), why: why.into() }
    }
}
