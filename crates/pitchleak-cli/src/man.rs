use crate::failure::Failure;
use crate::{Cli, Outcome, output};
use clap::{Args, CommandFactory};
use clap_mangen::Man;

/// Write a manual page to standard output: of the program, or of one of its commands
#[derive(Args)]
#[command(after_help = "Example: pitchleak man replay | man -l -")]
pub struct Arguments {
    /// Which command [default: the program itself]
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut program = Cli::command();
    program.build();
    let command = match &arguments.command {
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
