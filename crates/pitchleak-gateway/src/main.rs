//! The service `pitchleak-gateway`: watches hydraulic pitch cylinders whose samples come over MQTT. What it finds out is
//! the engine's ([`pitchleak::live`]); here is what makes a service of it.

mod alarms;
mod board;
mod broker;
mod config;
mod http;
mod log;
mod metrics;
mod mqtt;
mod run;
mod saver;
mod service;
mod topics;

use clap::Parser;
use config::Config;
use pitchleak::live::{CheckpointError, ConfigError};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Watches hydraulic pitch cylinders whose samples come over MQTT, and publishes what leaks.
#[derive(Parser)]
#[command(name = "pitchleak-gateway", version, about, after_help = AFTER)]
struct Arguments {
    /// Configuration file (TOML)
    #[arg(value_name = "CONFIG")]
    config: PathBuf,

    /// Read the configuration and all files that it names, say what would be done, and end
    #[arg(long)]
    check_config: bool,
}

const AFTER: &str = "\
SIGHUP reads the configuration again.
Exit status: 0 ended by SIGTERM or SIGINT, state saved; 2 the configuration or the folder of the state cannot be used.";

fn main() -> ExitCode {
    let outcome = match Arguments::try_parse() {
        Ok(arguments) => start(&arguments),
        Err(error) if error.use_stderr() => error.exit(),
        Err(answer) => answer.print().map_err(Failure::Output),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {}", failure.to_string().replace('\n', " "));
            ExitCode::from(2)
        }
    }
}

fn start(arguments: &Arguments) -> Result<(), Failure> {
    let config = Config::load(&arguments.config)?;
    if !arguments.check_config {
        return run::run(&arguments.config, config);
    }
    config.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    writeln!(std::io::stdout(), "{}", run::in_words(&config)).map_err(Failure::Output)
}

/// Why the service does not start, or ended; one line for people each.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
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
    #[error("cannot start the thread `{name}`: {source}")]
    Thread { name: &'static str, source: io::Error },
    #[error("cannot wait for signals: {0}")]
    Signals(io::Error),
}

impl Failure {
    pub(crate) fn content(path: &Path, why: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), why: why.into() }
    }
}
