//! The arguments that say what to read.

use crate::Outcome;
use crate::output::{self, Failure};
use clap::Args;
use indicatif::ProgressBar;
use pitchleak::Rig;
use pitchleak::output::Inputs;
use pitchleak::rig::{Decimal, Delimiter, RigError};
use pitchleak::times::{TimeFormat, TimeKind};
use pitchleak::trace::{BadRows, TraceReader};
use std::path::{Path, PathBuf};

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

    /// The files are one recording: each has its time and some of the channels
    #[arg(long)]
    join: bool,

    #[command(flatten)]
    text_format: TextFormat,
}

impl Input {
    /// Judges each trace. One that can't be read is reported; the whole then fails, once all others are judged.
    pub fn for_each(
        &self,
        mut judge: impl FnMut(Trace) -> Result<Outcome, Failure>,
    ) -> Result<Outcome, Failure> {
        if self.join {
            return self.trace(self.traces.clone()).and_then(judge);
        }
        let (mut worst, mut errors) = (Outcome::Done, 0);
        for path in &self.traces {
            match self.trace(vec![path.clone()]).and_then(&mut judge) {
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
        if given && self.traces.len() > 1 && !self.join {
            return Err(Failure::OneTraceOnly { flag, traces: self.traces.len() });
        }
        Ok(())
    }

    fn trace(&self, paths: Vec<PathBuf>) -> Result<Trace, Failure> {
        let mut rig = rig(self.rig.as_ref(), &paths)?;
        self.text_format.settle(&mut rig);
        let bad_rows = if self.strict { BadRows::Fatal } else { BadRows::Skip };
        Ok(Trace { follows: self.traces.len() > paths.len(), paths, rig, bad_rows })
    }
}

/// The rig that is given, else the one beside the first trace, else the built-in one.
pub fn rig(given: Option<&PathBuf>, traces: &[PathBuf]) -> Result<Rig, RigError> {
    match given {
        Some(rig) => Rig::load(rig),
        None => Rig::beside(traces.first().map_or(Path::new("-"), PathBuf::as_path)),
    }
}

/// One of the traces.
pub struct Trace {
    /// One, or those of one recording.
    paths: Vec<PathBuf>,
    pub rig: Rig,
    bad_rows: BadRows,
    /// Whether it is one of many, whose texts are kept apart.
    pub follows: bool,
}

impl Trace {
    /// The files read, which are not to be written over.
    pub fn files(&self) -> Inputs {
        Inputs::of(self.paths.iter().map(PathBuf::as_path).chain(self.rig.file()))
    }

    /// The trace, and a bar that follows the reading on a terminal.
    pub fn open(&self) -> Result<(TraceReader<'static>, ProgressBar), Failure> {
        let [path] = &self.paths[..] else {
            return Ok((self.open_again()?.ahead(), ProgressBar::hidden()));
        };
        let size = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
        let bar = progress(size);
        let reader = TraceReader::open_through(path, &self.rig, |file| Box::new(bar.wrap_read(file)))?;
        Ok((reader.with_bad_rows(self.bad_rows).ahead(), bar))
    }

    /// The trace without a bar, to be read again and again.
    pub fn open_again(&self) -> Result<TraceReader<'static>, Failure> {
        if self.paths.iter().any(|path| path == Path::new("-")) {
            return Err(Failure::ReadOnce);
        }
        let reader = match &self.paths[..] {
            [path] => TraceReader::open(path, &self.rig)?,
            paths => TraceReader::join(paths, &self.rig)?,
        };
        Ok(reader.with_bad_rows(self.bad_rows))
    }

    /// Prints a report: as a line of JSON, else as text, with an empty line behind it where others follow.
    pub fn print(
        &self,
        json: bool,
        to_json: impl FnOnce() -> Result<String, serde_json::Error>,
        to_text: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        output::print_as(json, to_json, || to_text() + if self.follows { "\n" } else { "" })
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

// How a text file of numbers is written, where the file leaves it open.
#[derive(Args)]
#[command(next_help_heading = "Where a file leaves it open")]
pub struct TextFormat {
    /// What stands between cells: comma, semicolon, tab or bar
    #[arg(long, value_name = "NAME", value_parser = one_of(Delimiter::by_name, Delimiter::NAMES.map(|(name, _)| name).join(", ")))]
    delimiter: Option<Delimiter>,

    /// What stands before decimals: point or comma
    #[arg(long, value_name = "NAME", value_parser = one_of(Decimal::by_name, "point, comma"))]
    decimal: Option<Decimal>,

    /// How times are written: iso, dmy, mdy, ymd, hms, epoch s|ms|us|ns, excel, or a pattern (%d.%m.%Y %H:%M:%S%.f)
    #[arg(long, value_name = "FORMAT", value_parser = one_of(TimeKind::by_name, TimeKind::ALLOWED))]
    time_format: Option<TimeKind>,
}

/// Reads an option that is one of `names`.
pub fn one_of<T>(
    by_name: fn(&str) -> Option<T>,
    names: impl Into<String>,
) -> impl Fn(&str) -> Result<T, String> + Clone {
    let names = names.into();
    move |name| by_name(name).ok_or_else(|| format!("one of: {names}"))
}

impl TextFormat {
    /// What is given comes before what the rig file says.
    pub fn settle(&self, rig: &mut Rig) {
        let csv = &mut rig.csv;
        csv.delimiter = self.delimiter.or(csv.delimiter);
        csv.decimal = self.decimal.or(csv.decimal);
        if let Some(kind) = &self.time_format {
            let zone = csv.time.take().and_then(|time| time.zone);
            csv.time = Some(TimeFormat { kind: kind.clone(), zone });
        }
    }
}
