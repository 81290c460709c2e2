use crate::failure::Failure;
use crate::input::rig;
use crate::{Outcome, output};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use pitchleak::output::{Inputs, OutputFile};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::trace::TraceReader;
use pitchleak::valve::{Calibrator, LeaksThen};
use pitchleak_view::Text;
use std::path::PathBuf;

/// Learn the valve of a cylinder without flow meters from traces of it: gains, laps and clearances of its edges
///
/// Internal leaks are told without. External ones look like a valve's own clearance, and smaller ones are found after it.
#[derive(Args)]
#[command(after_help = "\
Example:
  pitchleak calibrate week1.csv week2.csv --leaks zero --evidence hold.csv --out valve.toml
  # rig.toml: [valve] calibration = \"valve.toml\"")]
pub struct Arguments {
    /// Traces of one rig, ten minutes or more in all: .csv, .csv.gz, .parquet or .mat
    #[arg(value_name = "TRACE", required = true)]
    traces: Vec<PathBuf>,

    /// Rig file with [valve] [default: rig.toml beside the first trace]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,

    /// What leaked while they were recorded: after `zero` leaks are absolute, after `unknown` external ones are changes since
    #[arg(long, value_name = "LEAKS", value_parser = leaks_then())]
    leaks: LeaksThen,

    /// A hold test that finds no leak; without one, `--leaks zero` is an assumption
    #[arg(long, value_name = "HOLD")]
    evidence: Option<PathBuf>,

    /// Write the calibration here
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

fn leaks_then() -> impl TypedValueParser<Value = LeaksThen> {
    PossibleValuesParser::new(LeaksThen::NAMES)
        .try_map(|name| LeaksThen::by_name(&name).ok_or("neither zero nor unknown"))
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let rig = rig(arguments.rig.as_ref(), &arguments.traces)?.uncalibrated();
    let read = arguments.traces.iter().chain(&arguments.evidence).map(PathBuf::as_path).chain(rig.file());
    let file = OutputFile::create(&arguments.out, &Inputs::of(read))?;
    let mut calibrator = Calibrator::new(&rig, arguments.leaks)?;
    if let Some(hold) = &arguments.evidence {
        let mut reader = TraceReader::open(hold, &rig)?;
        calibrator.rest_on(&replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(()))?)?;
    }
    for path in &arguments.traces {
        calibrator.read(&mut TraceReader::open(path, &rig)?)?;
    }
    let found = calibrator.finish()?;
    file.finish_with(found.to_toml()?)?;
    output::print(&found.to_text(&output::palette()))?;
    output::print(&format!("\nIn {}: [valve] calibration = \"{}\"\n", rig.name, arguments.out.display()))?;
    Ok(Outcome::Done)
}
