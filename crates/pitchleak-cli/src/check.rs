use crate::failure::Failure;
use crate::input::Input;
use crate::{Outcome, output};
use clap::Args;
use pitchleak::check::check;
use pitchleak::page::{History, Page, PageFile};
use std::path::PathBuf;

/// Check a trace: data quality, excitation, what it can and cannot identify
#[derive(Args)]
#[command(after_help = "Example: pitchleak check trace.csv.gz --rig turbine7.toml")]
pub struct Arguments {
    #[command(flatten)]
    input: Input,

    /// Write the result as a page for a browser: .html, complete in itself
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,

    /// Print the result as JSON (schema pitchleak.check/1)
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let rig = arguments.input.rig()?;
    let inputs = arguments.input.files(&rig);
    let page = arguments.report.as_ref().map(|path| PageFile::create(path, &inputs)).transpose()?;
    let mut history = page.is_some().then(History::default);
    let (mut reader, bar) = arguments.input.open(&rig)?;
    let report = check(&mut reader, &rig, |replay, record, renewed| {
        if let Some(history) = &mut history {
            history.add(replay, record, renewed);
        }
        Ok::<_, Failure>(())
    })?;
    if let Some((page, history)) = page.zip(history) {
        page.finish(&Page::of_check(&report, &rig, &history))?;
    }
    bar.finish_and_clear();
    output::note(&report.trace);
    output::warn(&report.trace.warnings);
    let text = if arguments.json { report.to_json()? + "\n" } else { report.to_text(&output::palette()) };
    output::print(&text)?;
    Ok(Outcome::Done)
}
