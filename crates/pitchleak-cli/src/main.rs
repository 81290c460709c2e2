//! The program `pitchleak`: arguments in, text out, no numerics of its own.

mod about;
mod calibrate;
mod check;
mod columns;
mod diagnose;
mod failure;
mod fleet;
mod input;
mod output;
mod prove;
mod replay;
mod reproduce;
mod simulate;
mod watch;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use failure::Failure;
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
    Replay(replay::Arguments),
    Diagnose(diagnose::Arguments),
    Check(check::Arguments),
    Prove(prove::Arguments),
    Calibrate(calibrate::Arguments),
    Columns(columns::Columns),
    Init(columns::Init),
    Fleet(fleet::Arguments),
    /// Lists what a verdict weighs beside leaks: sensors, rig and wiring, each with its prior share
    Explanations,
    Watch(watch::Arguments),
    Simulate(Box<simulate::Arguments>),
    Reproduce(reproduce::Arguments),
    Completions(about::Completions),
    Man(about::ManualPage),
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
        failure::leave_nothing_half_written()?;
    }
    match command {
        Command::Replay(arguments) => replay::run(arguments),
        Command::Diagnose(arguments) => diagnose::run(arguments),
        Command::Check(arguments) => check::run(arguments),
        Command::Prove(arguments) => prove::run(arguments),
        Command::Calibrate(arguments) => calibrate::run(arguments),
        Command::Columns(arguments) => arguments.run(),
        Command::Init(arguments) => arguments.run(),
        Command::Fleet(arguments) => fleet::run(arguments),
        Command::Explanations => about::list_explanations(),
        Command::Watch(arguments) => watch::run(arguments),
        Command::Simulate(arguments) => simulate::run(arguments),
        Command::Reproduce(arguments) => reproduce::run(arguments),
        Command::Completions(arguments) => arguments.run(),
        Command::Man(arguments) => arguments.run(),
    }
}
