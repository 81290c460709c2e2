//! The program `pitchleak`: arguments in, text out, no numerics of its own; and what it says of itself: completions for a shell,
//! manual pages, what a verdict weighs.

mod columns;
mod diagnose;
mod fleet;
mod input;
mod output;
mod replay;
mod simulate;
mod watch;

use clap::error::ErrorKind;
use clap::{Args, CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use clap_mangen::Man;
use output::Failure;
use pitchleak::explain::explanations;
use pitchleak::units::readable;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

/// Says how much oil leaks where in a hydraulic pitch cylinder.
#[derive(Parser)]
#[command(name = "pitchleak", version, about, after_help = EXIT_STATUS)]
struct Cli {
    #[command(subcommand)]
    command: Command,

    /// Say nothing but results and errors: no notes, no warnings
    #[arg(long, short, global = true)]
    quiet: bool,
}

const EXIT_STATUS: &str = "\
Exit status: 0 done; 1 a fault was found and --fail-on-fault was given;
2 bad input or usage, or traces that could not be judged;
129, 130, 143 ended by SIGHUP, Ctrl-C, SIGTERM.
`pitchleak TRACE` alone is `pitchleak replay TRACE`. Every command explains itself: pitchleak replay --help";

#[derive(Subcommand)]
enum Command {
    Replay(replay::ReplayArguments),
    Diagnose(diagnose::Arguments),
    Check(replay::CheckArguments),
    Prove(replay::ProveArguments),
    Calibrate(replay::CalibrateArguments),
    Columns(columns::Columns),
    Init(columns::Init),
    Fleet(fleet::Arguments),
    /// Lists what a verdict weighs beside leaks: sensors, rig and wiring, each with its prior share
    Explanations,
    Watch(watch::Arguments),
    Simulate(Box<simulate::SimulateArguments>),
    Reproduce(simulate::ReproduceArguments),
    Completions(Completions),
    Man(ManualPage),
}

/// What a command that ran to its end has to say by its exit status.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Done,
    FaultFound,
}

fn main() -> ExitCode {
    let outcome = match Cli::try_parse_from(with_command(std::env::args_os().collect())) {
        Ok(cli) => {
            output::be_quiet(cli.quiet);
            run(&cli.command)
        }
        Err(answer) => tell(&answer),
    };
    match outcome {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::FaultFound) => ExitCode::from(1),
        // The reader of our output has closed it: not an error of ours.
        Err(failure) if failure.is_broken_pipe() => ExitCode::SUCCESS,
        Err(failure) => {
            output::complain("error", &failure);
            ExitCode::from(failure.status())
        }
    }
}

/// A trace alone is replayed: `pitchleak logger.csv`. What has a dot or a folder in it is one that may be missing: no command has.
fn with_command(mut arguments: Vec<OsString>) -> Vec<OsString> {
    let is_trace = arguments.get(1).is_some_and(|first| {
        let name = first.to_string_lossy();
        let is_path = name.contains(['.', '/']) || Path::new(first).is_file();
        let names_a_trace = *name == *"-" || (!name.starts_with('-') && is_path);
        names_a_trace && Cli::command().find_subcommand(&*name).is_none()
    });
    if is_trace {
        arguments.insert(1, "replay".into());
    }
    arguments
}

/// Help and version, which were asked for, or what is wrong with the command line, in one line.
fn tell(answer: &clap::Error) -> Result<Outcome, Failure> {
    if answer.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        answer.exit();
    }
    if answer.use_stderr() {
        return Err(Failure::Arguments(in_one_line(&answer.to_string())));
    }
    answer.print().map_err(Failure::Output)?;
    Ok(Outcome::Done)
}

/// What the parser of arguments says: the mistake, its tip, and how the command is used where arguments are missing.
fn in_one_line(answer: &str) -> String {
    let lines = || answer.lines().map(str::trim).filter(|line| !line.is_empty());
    let mut line = String::new();
    for part in
        lines().filter(|part| !part.starts_with("Usage:") && !part.starts_with("For more information"))
    {
        let part = part.trim_start_matches("error: ").trim_start_matches("tip: ");
        line += match line.chars().last() {
            None => "",
            Some(':') => " ",
            Some(_) if part.starts_with('[') => " ",
            Some(_) => "; ",
        };
        line += part;
    }
    match lines().find_map(|part| part.strip_prefix("Usage: ")) {
        Some(usage) if line.contains("required arguments") => format!("{line} (usage: {usage})"),
        _ => line,
    }
}

fn run(command: &Command) -> Result<Outcome, Failure> {
    // A watch that is to end saves its state first.
    if !matches!(command, Command::Watch(_)) {
        output::leave_nothing_half_written()?;
    }
    match command {
        Command::Replay(arguments) => arguments.run(),
        Command::Diagnose(arguments) => diagnose::run(arguments),
        Command::Check(arguments) => arguments.run(),
        Command::Prove(arguments) => arguments.run(),
        Command::Calibrate(arguments) => arguments.run(),
        Command::Columns(arguments) => arguments.run(),
        Command::Init(arguments) => arguments.run(),
        Command::Fleet(arguments) => fleet::run(arguments),
        Command::Explanations => list_explanations(),
        Command::Watch(arguments) => watch::run(arguments),
        Command::Simulate(arguments) => arguments.run(),
        Command::Reproduce(arguments) => arguments.run(),
        Command::Completions(arguments) => arguments.run(),
        Command::Man(arguments) => arguments.run(),
    }
}

/// Write the completions of a shell to standard output
#[derive(Args)]
#[command(
    after_help = "Example: pitchleak completions bash > ~/.local/share/bash-completion/completions/pitchleak"
)]
struct Completions {
    /// Which shell
    shell: Shell,
}

/// Write a manual page to standard output: of the program, or of one of its commands
#[derive(Args)]
#[command(after_help = "Example: pitchleak man replay | man -l -")]
struct ManualPage {
    /// Which command [default: the program itself]
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
}

impl Completions {
    fn run(&self) -> Result<Outcome, Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "pitchleak", &mut script);
        output::print(&String::from_utf8_lossy(&script))?;
        Ok(Outcome::Done)
    }
}

impl ManualPage {
    fn run(&self) -> Result<Outcome, Failure> {
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
fn list_explanations() -> Result<Outcome, Failure> {
    let mut text = format!("{:<10} {:<26} {:>9}  what\n", "kind", "id", "share");
    for entry in explanations() {
        let (kind, percent) = (entry.kind.name(), readable(100.0 * entry.share, 3));
        text += &format!("{kind:<10} {:<26} {percent:>7} %  {}\n", entry.id, entry.text);
    }
    output::print(&text)?;
    Ok(Outcome::Done)
}
