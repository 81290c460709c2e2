use crate::failure::Failure;
use crate::input::{Input, Trace, one_of};
use crate::{Outcome, output};
use clap::Args;
use pitchleak::replay::{EstimateFile, Replay, replay};
use pitchleak::rig::EstimatorKind;
use pitchleak::trace::Record;
use pitchleak_view::Text;
use pitchleak_view::page::{History, Page, PageFile};
use pitchleak_view::text::ReplaySketch;
use std::path::PathBuf;

/// Replay traces: estimate their leaks and say what to do
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    #[command(flatten)]
    input: Input,

    /// Estimator [default: as in the rig file, else rls]
    #[arg(long, value_name = "NAME", value_parser = one_of(EstimatorKind::by_name, EstimatorKind::NAMES.join(", ")))]
    estimator: Option<EstimatorKind>,

    /// Write the estimates over time of one trace, a row per sample: .csv, .csv.gz or .parquet
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Write the report on one trace as a page for a browser: .html, complete in itself
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,

    /// Print the report as JSON (schema pitchleak.replay/1), a line for each trace
    #[arg(long)]
    json: bool,

    /// Exit with status 1 if a fault is found
    #[arg(long)]
    fail_on_fault: bool,

    /// Exit with status 1 if the verdict is doubtful or not sure
    #[arg(long)]
    fail_on_doubt: bool,
}

const EXAMPLES: &str = "\
Examples:
  pitchleak replay trace.csv.gz
  pitchleak replay trace.csv --report report.html
  pitchleak replay monday/*.csv --json | jq -r '[.trace.path, .verdict.status] | @tsv'
  pitchleak replay trace.csv --rig turbine7.toml --json | jq .verdict
  zcat log.csv.gz | pitchleak replay - --rig turbine7.toml --fail-on-fault";

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    arguments.input.check_single("--out", arguments.out.is_some())?;
    arguments.input.check_single("--report", arguments.report.is_some())?;
    arguments.input.for_each(|trace| run_one(arguments, trace))
}

fn run_one(arguments: &Arguments, mut trace: Trace) -> Result<Outcome, Failure> {
    let kind = &mut trace.rig.estimator.kind;
    *kind = arguments.estimator.unwrap_or(*kind);
    let inputs = trace.files();
    let mut file = arguments.out.as_ref().map(|path| EstimateFile::create(path, &inputs)).transpose()?;
    let page = arguments.report.as_ref().map(|path| PageFile::create(path, &inputs)).transpose()?;
    let mut history = page.is_some().then(History::default);
    let mut sketch = (output::draws() && !arguments.json).then(|| ReplaySketch::new(&trace.rig));
    let (mut reader, bar) = trace.open()?;
    let each = |replay: &Replay, record: &Record, renewed: bool| {
        if let Some(history) = &mut history {
            history.add(replay, record, renewed);
        }
        if let Some(sketch) = &mut sketch {
            sketch.add(replay, record, renewed);
        }
        match &mut file {
            None => Ok(()),
            Some(file) => file.write(&replay.estimate_row(record)).map_err(Failure::from),
        }
    };
    let report = replay(&mut reader, &trace.rig, each)?;
    file.map(EstimateFile::finish).transpose()?;
    if let Some((page, history)) = page.zip(history) {
        page.finish(&Page::of_replay(&report, &trace.rig, &history))?;
    }
    bar.finish_and_clear();
    output::tell(&report.trace);
    let to_json = || report.to_json();
    trace.print(arguments.json, to_json, || match &sketch {
        Some(sketch) => sketch.to_text(&report, &output::palette()),
        None => report.to_text(&output::palette()),
    })?;
    let fault = arguments.fail_on_fault && !report.verdict.faults.is_empty();
    let doubt = arguments.fail_on_doubt && !report.verdict.status.is_sure();
    Ok(if fault || doubt { Outcome::FaultFound } else { Outcome::Done })
}
