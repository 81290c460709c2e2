//! Files of foreign columns: how one would be read, and a rig file for them.

use crate::Outcome;
use crate::input::{TextFormat, rig};
use crate::output::{self, Failure};
use clap::Args;
use pitchleak::Rig;
use pitchleak::output::{Inputs, write};
use pitchleak::signal::Signal;
use pitchleak::template::{NEEDED_KEYS, template};
use pitchleak::trace::{FileReading, ProposedLine};
use std::path::{Path, PathBuf};

/// Show how a file would be read, and propose [columns] for foreign names
#[derive(Args)]
#[command(after_help = "\
Examples:
  pitchleak columns export.csv
  pitchleak columns export.csv --rig turbine7.toml --json | jq -r '.proposals[].line'")]
pub struct Columns {
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

impl Columns {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let mut rig = rig(self.rig.as_ref(), std::slice::from_ref(&self.file))?;
        self.text_format.settle(&mut rig);
        let reading = FileReading::of(&self.file, &rig)?;
        output::print_as(self.json, || reading.to_json(), || reading.to_text())?;
        Ok(Outcome::Done)
    }
}

/// Begin a rig file for traces: their columns named, the cylinder's numbers as blanks to fill in
///
/// Each blank says where its number is found and what is usual. What is proposed by values alone is marked: check it.
#[derive(Args)]
#[command(after_help = "\
Example:
  pitchleak init logger.csv      # writes rig.toml beside it: fill in the blanks
  pitchleak replay logger.csv    # names the first blank that is left")]
pub struct Init {
    /// Traces of one rig: .csv, .csv.gz, .parquet or .mat, `-` for standard input
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,

    /// Write the rig file here, where there is none yet [default: rig.toml beside the first trace]
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,

    #[command(flatten)]
    text_format: TextFormat,
}

impl Init {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let first = self.files.first().map(PathBuf::as_path).unwrap_or(Path::new("-"));
        let out = self.out.clone().unwrap_or_else(|| first.with_file_name("rig.toml"));
        if out.symlink_metadata().is_ok() {
            return Err(Failure::RigIsThere(out));
        }
        let mut rig = Rig::paper();
        self.text_format.settle(&mut rig);
        let (mut lines, mut given) = (Vec::new(), Vec::new());
        for path in &self.files {
            let reading = FileReading::of(path, &rig)?;
            let is_among = |name: &str, lines: &[ProposedLine]| lines.iter().any(|line| key(line) == name);
            let signals = reading.columns.iter().filter_map(|column| column.signal);
            given.extend(signals.filter(|name| !is_among(name, &reading.named)).filter_map(Signal::by_name));
            for line in reading.named.into_iter().chain(reading.proposals) {
                if !is_among(key(&line), &lines) {
                    lines.push(line);
                }
            }
        }
        let inputs = Inputs::of(self.files.iter().map(PathBuf::as_path));
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
}

/// The signal that a line is for.
fn key(line: &ProposedLine) -> &str {
    line.line.split(" = ").next().unwrap_or_default()
}
