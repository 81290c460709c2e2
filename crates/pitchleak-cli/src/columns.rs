use crate::failure::Failure;
use crate::input::{TextFormat, rig};
use crate::{Outcome, output};
use clap::Args;
use pitchleak::trace::FileReading;
use std::path::PathBuf;

/// Show how a file would be read, and propose [columns] for foreign names
#[derive(Args)]
#[command(after_help = "\
Examples:
  pitchleak columns export.csv
  pitchleak columns export.csv --rig turbine7.toml --json | jq -r '.proposals[].line'")]
pub struct Arguments {
    /// Trace to look at: .csv, .csv.gz, .parquet or .mat, `-` for standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// Rig file [default: rig.toml beside the file, else the built-in rig wu2011]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,

    /// Print the result as JSON (schema pitchleak.columns/1)
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    text_format: TextFormat,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut rig = rig(arguments.rig.as_ref(), std::slice::from_ref(&arguments.file))?;
    arguments.text_format.settle(&mut rig);
    let reading = FileReading::of(&arguments.file, &rig)?;
    let text = if arguments.json { reading.to_json()? + "\n" } else { reading.to_text() };
    output::print(&text)?;
    Ok(Outcome::Done)
}
