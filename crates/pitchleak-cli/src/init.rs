use crate::failure::Failure;
use crate::input::TextFormat;
use crate::{Outcome, output};
use clap::Args;
use pitchleak::Rig;
use pitchleak::output::{Inputs, write};
use pitchleak::signal::Signal;
use pitchleak::template::{NEEDED_KEYS, template};
use pitchleak::trace::{FileReading, ProposedLine};
use std::path::{Path, PathBuf};

/// Begin a rig file for traces: their columns named, the cylinder's numbers as blanks to fill in
///
/// Each blank says where its number is found and what is usual. What is proposed by values alone is marked: check it.
#[derive(Args)]
#[command(after_help = "\
Example:
  pitchleak init logger.csv      # writes rig.toml beside it: fill in the blanks
  pitchleak replay logger.csv    # names the first blank that is left")]
pub struct Arguments {
    /// Traces of one rig: .csv, .csv.gz, .parquet or .mat, `-` for standard input
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,

    /// Write the rig file here, where there is none yet [default: rig.toml beside the first trace]
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,

    #[command(flatten)]
    text_format: TextFormat,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let first = arguments.files.first().map(PathBuf::as_path).unwrap_or(Path::new("-"));
    let out = arguments.out.clone().unwrap_or_else(|| first.with_file_name("rig.toml"));
    if out.symlink_metadata().is_ok() {
        return Err(Failure::RigIsThere(out));
    }
    let mut rig = Rig::paper();
    arguments.text_format.settle(&mut rig);
    let (mut lines, mut given) = (Vec::new(), Vec::new());
    for path in &arguments.files {
        let reading = FileReading::of(path, &rig)?;
        let taken =
            |line: &ProposedLine, lines: &[ProposedLine]| lines.iter().any(|known| key(known) == key(line));
        let named: Vec<String> = reading.named.iter().map(|line| key(line).to_owned()).collect();
        let signals = reading.columns.iter().filter_map(|column| column.signal);
        given.extend(signals.filter(|name| !named.iter().any(|key| key == name)).filter_map(Signal::by_name));
        for line in reading.named.into_iter().chain(reading.proposals) {
            if !taken(&line, &lines) {
                lines.push(line);
            }
        }
    }
    let inputs = Inputs::of(arguments.files.iter().map(PathBuf::as_path));
    write(&out, template(&rig, &lines, &given), &inputs)?;
    output::print(&format!(
        "{} written: {} columns named. Fill in {} where it says `#`, look over [columns] and [sensors], then: pitchleak replay {}\n",
        out.display(),
        lines.len() + given.len(),
        NEEDED_KEYS.join(", "),
        first.display(),
    ))?;
    Ok(Outcome::Done)
}

/// The signal that a line is for.
fn key(line: &ProposedLine) -> &str {
    line.line.split(" = ").next().unwrap_or_default()
}
