use crate::failure::Failure;
use crate::input::Input;
use crate::{Outcome, output};
use clap::Args;
use pitchleak::check::check;

/// Check a trace: data quality, excitation, what it can and cannot identify
#[derive(Args)]
#[command(after_help = "Example: pitchleak check trace.csv.gz --rig turbine7.toml")]
pub struct Arguments {
    #[command(flatten)]
    input: Input,

    /// Print the result as JSON (schema pitchleak.check/1)
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let rig = arguments.input.rig()?;
    let (mut reader, bar) = arguments.input.open(&rig)?;
    let report = check(&mut reader, &rig)?;
    bar.finish_and_clear();
    output::warn(&report.trace.warnings);
    let text = if arguments.json { report.to_json()? + "\n" } else { report.to_text(&output::palette()) };
    output::print(&text)?;
    Ok(Outcome::Done)
}
