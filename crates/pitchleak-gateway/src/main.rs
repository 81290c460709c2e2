//! The service `pitchleak-gateway`: watches hydraulic pitch cylinders whose samples come over MQTT. What it finds out is
//! the engine's ([`pitchleak::live`]); here is what makes a service of it.

mod broker;
mod config;
mod failure;
mod http;
mod input;
mod log;
mod metrics;
mod mqtt;
mod notify;
mod outbox;
mod pace;
mod probe;
mod run;
mod saver;
mod service;
mod summaries;
mod topics;

use clap::Parser;
use config::Config;
use failure::Failure;
use std::path::PathBuf;
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
Exit status: 0 ended by SIGTERM or SIGINT, state saved; 2 the configuration or the state cannot be used.";

fn main() -> ExitCode {
    match start(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {}", failure.to_string().replace('\n', " "));
            ExitCode::from(2)
        }
    }
}

fn start(arguments: &Arguments) -> Result<(), Failure> {
    let config = Config::load(&arguments.config)?;
    if arguments.check_config {
        println!("{}", run::in_words(&config));
        return Ok(());
    }
    run::run(config)
}
