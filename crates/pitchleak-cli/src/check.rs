use crate::failure::Failure;
use crate::input::{Input, Trace};
use crate::{Outcome, output};
use clap::Args;
use pitchleak::check::check;
use pitchleak_view::Text;
use pitchleak_view::page::{History, Page, PageFile};
use pitchleak_view::text::CheckSketch;
use std::path::PathBuf;

/// Check traces: data quality, excitation, what they can and cannot identify
#[derive(Args)]
#[command(after_help = "Example: pitchleak check trace.csv.gz --rig turbine7.toml")]
pub struct Arguments {
    #[command(flatten)]
    input: Input,

    /// Write the result on one trace as a page for a browser: .html, complete in itself
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,

    /// Print the result as JSON (schema pitchleak.check/1), a line for each trace
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    arguments.input.check_single("--report", arguments.report.is_some())?;
    arguments.input.for_each(|trace| run_one(arguments, &trace))
}

fn run_one(arguments: &Arguments, trace: &Trace) -> Result<Outcome, Failure> {
    let inputs = trace.files();
    let page = arguments.report.as_ref().map(|path| PageFile::create(path, &inputs)).transpose()?;
    let mut history = page.is_some().then(History::default);
    let mut sketch = (output::draws() && !arguments.json).then(|| CheckSketch::new(&trace.rig));
    let (mut reader, bar) = trace.open()?;
    let report = check(&mut reader, &trace.rig, |replay, record, renewed| {
        if let Some(history) = &mut history {
            history.add(replay, record, renewed);
        }
        if let Some(sketch) = &mut sketch {
            sketch.add(record);
        }
        Ok::<_, Failure>(())
    })?;
    if let Some((page, history)) = page.zip(history) {
        page.finish(&Page::of_check(&report, &trace.rig, &history))?;
    }
    bar.finish_and_clear();
    output::tell(&report.trace);
    let to_json = || report.to_json();
    trace.print(arguments.json, to_json, || match &sketch {
        Some(sketch) => sketch.to_text(&report, &output::palette()),
        None => report.to_text(&output::palette()),
    })?;
    Ok(Outcome::Done)
}
