//! What the program says of itself: completions for a shell, manual pages, what a verdict weighs.

use crate::failure::Failure;
use crate::{Cli, Outcome, output};
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use pitchleak::explain::explanations;
use pitchleak::units::readable;

/// Write the completions of a shell to standard output
#[derive(Args)]
#[command(
    after_help = "Example: pitchleak completions bash > ~/.local/share/bash-completion/completions/pitchleak"
)]
pub struct Completions {
    /// Which shell
    shell: Shell,
}

/// Write a manual page to standard output: of the program, or of one of its commands
#[derive(Args)]
#[command(after_help = "Example: pitchleak man replay | man -l -")]
pub struct ManualPage {
    /// Which command [default: the program itself]
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
}

impl Completions {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "pitchleak", &mut script);
        output::print(&String::from_utf8_lossy(&script))?;
        Ok(Outcome::Done)
    }
}

impl ManualPage {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let mut program = Cli::command();
        program.build();
        let command = match &self.command {
            None => program,
            Some(name) => {
                program.find_subcommand(name).cloned().ok_or_else(|| Failure::NoCommand(name.clone()))?
            }
        };
        let mut page = Vec::new();
        Man::new(command).render(&mut page)?;
        output::print(&String::from_utf8_lossy(&page))?;
        Ok(Outcome::Done)
    }
}

/// A line for each, kind by kind.
pub fn list_explanations() -> Result<Outcome, Failure> {
    let mut text = format!("{:<10} {:<26} {:>9}  what\n", "kind", "id", "share");
    for entry in explanations() {
        let (kind, percent) = (entry.kind.name(), readable(100.0 * entry.share, 3));
        text += &format!("{kind:<10} {:<26} {percent:>7} %  {}\n", entry.id, entry.text);
    }
    output::print(&text)?;
    Ok(Outcome::Done)
}
