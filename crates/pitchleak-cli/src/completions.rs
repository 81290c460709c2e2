use crate::failure::Failure;
use crate::{Cli, Outcome, output};
use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Write the completions of a shell to standard output
#[derive(Args)]
#[command(
    after_help = "Example: pitchleak completions bash > ~/.local/share/bash-completion/completions/pitchleak"
)]
pub struct Arguments {
    /// Which shell
    shell: Shell,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command(), "pitchleak", &mut script);
    output::print(&String::from_utf8_lossy(&script))?;
    Ok(Outcome::Done)
}
