//! The arguments that say what to read.

use crate::failure::Failure;
use crate::text_format::TextFormat;
use crate::{Outcome, output};
use clap::Args;
use indicatif::ProgressBar;
use pitchleak::Rig;
use pitchleak::output::Inputs;
use pitchleak::trace::{BadRows, TraceReader};
use std::path::PathBuf;

#[derive(Args)]
pub struct Input {
    /// Traces to read, one after the other: .csv, .csv.gz, .parquet or .mat, `-` for standard input
    #[arg(value_name = "TRACE", required = true)]
    traces: Vec<PathBuf>,

    /// Rig file [default: rig.toml beside each trace, else the built-in rig wu2011]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,

    /// End at the first bad row instead of skipping it
    #[arg(long)]
    strict: bool,

    #[command(flatten)]
    text_format: TextFormat,
}

impl Input {
    /// Judges each trace. One that can't be read is reported; the whole then fails, once all others are judged.
    pub fn for_each(
        &self,
        mut judge: impl FnMut(Trace) -> Result<Outcome, Failure>,
    ) -> Result<Outcome, Failure> {
        let (mut worst, mut errors) = (Outcome::Done, 0);
        for path in &self.traces {
            match self.trace(path.clone()).and_then(&mut judge) {
                Ok(Outcome::Done) => {}
                Ok(Outcome::FaultFound) => worst = Outcome::FaultFound,
                Err(failure) if self.traces.len() == 1 || failure.is_broken_pipe() => return Err(failure),
                Err(failure) => {
                    output::complain("error", &failure);
                    errors += 1;
                }
            }
        }
        match errors {
            0 => Ok(worst),
            errors => Err(Failure::NotJudged { errors, traces: self.traces.len() }),
        }
    }

    /// A file that is written by `flag` is of one trace.
    pub fn check_single(&self, flag: &'static str, given: bool) -> Result<(), Failure> {
        if given && self.traces.len() > 1 {
            return Err(Failure::OneTraceOnly { flag, traces: self.traces.len() });
        }
        Ok(())
    }

    fn trace(&self, path: PathBuf) -> Result<Trace, Failure> {
        let mut rig = match &self.rig {
            Some(rig) => Rig::load(rig)?,
            None => Rig::beside(&path)?,
        };
        self.text_format.settle(&mut rig);
        let bad_rows = if self.strict { BadRows::Fatal } else { BadRows::Skip };
        Ok(Trace { path, rig, bad_rows, follows: self.traces.len() > 1 })
    }
}

/// One of the traces.
pub struct Trace {
    path: PathBuf,
    pub rig: Rig,
    bad_rows: BadRows,
    /// Whether it is one of many, whose texts are kept apart.
    pub follows: bool,
}

impl Trace {
    /// The files read, which are not to be written over.
    pub fn files(&self) -> Inputs {
        Inputs::of(std::iter::once(self.path.as_path()).chain(self.rig.file()))
    }

    /// The trace, and a bar that follows the reading on a terminal.
    pub fn open(&self) -> Result<(TraceReader<'static>, ProgressBar), Failure> {
        let size = std::fs::metadata(&self.path).map_or(0, |metadata| metadata.len());
        let bar = progress(size);
        let reader = TraceReader::open_through(&self.path, &self.rig, |file| Box::new(bar.wrap_read(file)))?;
        Ok((reader.with_bad_rows(self.bad_rows).ahead(), bar))
    }

    /// Prints a report: as a line of JSON, else as text, with an empty line behind it where others follow.
    pub fn print(&self, json: Option<String>, text: impl FnOnce() -> String) -> Result<(), Failure> {
        let end = if self.follows { "\n" } else { "" };
        output::print(&json.map_or_else(|| text() + end, |json| json + "\n"))?;
        Ok(())
    }
}

/// A smaller file is read before anyone sees a bar.
const WORTH_A_BAR: u64 = 8 << 20;

fn progress(bytes: u64) -> ProgressBar {
    if bytes < WORTH_A_BAR {
        return ProgressBar::hidden();
    }
    output::bar(bytes, "{bar:40} {percent:>3} %  {bytes_per_sec}, {eta} left")
}
