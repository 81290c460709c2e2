//! The arguments that say what to read.

use crate::failure::Failure;
use crate::text_format::TextFormat;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use pitchleak::Rig;
use pitchleak::output::Inputs;
use pitchleak::trace::{BadRows, TraceReader};
use std::path::PathBuf;

#[derive(Args)]
pub struct Input {
    /// Trace to read: .csv or .csv.gz, `-` for standard input
    #[arg(value_name = "TRACE")]
    pub trace: PathBuf,

    /// Rig file [default: rig.toml beside the trace, else the built-in rig wu2011]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,

    /// End at the first bad row instead of skipping it
    #[arg(long)]
    strict: bool,

    #[command(flatten)]
    text_format: TextFormat,
}

impl Input {
    pub fn rig(&self) -> Result<Rig, Failure> {
        let mut rig = match &self.rig {
            Some(path) => Rig::load(path)?,
            None => Rig::beside(&self.trace)?,
        };
        self.text_format.settle(&mut rig);
        Ok(rig)
    }

    /// The files read, which are not to be written over.
    pub fn files(&self, rig: &Rig) -> Inputs {
        Inputs::of(std::iter::once(self.trace.as_path()).chain(rig.file()))
    }

    /// The trace, and a bar that follows the reading on a terminal.
    pub fn open(&self, rig: &Rig) -> Result<(TraceReader<'static>, ProgressBar), Failure> {
        let size = std::fs::metadata(&self.trace).map_or(0, |metadata| metadata.len());
        let bar = progress(size);
        let reader = TraceReader::open_through(&self.trace, rig, |file| Box::new(bar.wrap_read(file)))?;
        let bad_rows = if self.strict { BadRows::Fatal } else { BadRows::Skip };
        Ok((reader.with_bad_rows(bad_rows), bar))
    }
}

/// A smaller file is read before anyone sees a bar.
const WORTH_A_BAR: u64 = 8 << 20;

/// On standard error; hidden where that is no terminal.
fn progress(bytes: u64) -> ProgressBar {
    if bytes < WORTH_A_BAR {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {bytes_per_sec}, {eta} left");
    ProgressBar::new(bytes).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
