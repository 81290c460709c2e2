//! The service `pitchleak-gateway`: watches hydraulic pitch cylinders whose samples come over MQTT. What it finds out is
//! the engine's ([`pitchleak::live`]); here is what makes a service of it.

mod alarms;
mod board;
mod broker;
mod config;
mod dead_letters;
mod failure;
mod http;
mod input;
mod log;
mod metrics;
mod mqtt;
mod outbox;
mod pace;
mod reload;
mod run;
mod saver;
mod secrets;
mod service;
mod session;
mod summaries;
mod topics;

use clap::Parser;
use config::Config;
use failure::Failure;
use std::io::Write as _;
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
