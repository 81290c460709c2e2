use crate::failure::Failure;
use crate::{Outcome, output};
use clap::Args;
use pitchleak::output::{Inputs, make_folder};
use pitchleak_reproduce::{Progress, detection, reproduce};
use pitchleak_view::page::PageFile;
use std::path::PathBuf;

/// Rerun the paper's experiment: four winds, two leak settings, its law and ours on the same readings
#[derive(Args)]
#[command(after_help = "Example: pitchleak reproduce --out reproduction --seeds 280")]
pub struct Arguments {
    /// Write the figures (SVG), the table and the report into this directory
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Write the report as a page for a browser: .html, complete in itself
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,

    /// Print the report as JSON (schema pitchleak.reproduce/1)
    #[arg(long)]
    json: bool,

    /// Seeds per row, each with its own noise; 14 windows of 20 s take turns
    #[arg(long, value_name = "N", default_value_t = 280, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    seeds: u64,

    /// Also measure the alarms: delays, and false alarms over so many hours of sound operation
    #[arg(long, value_name = "HOURS")]
    detection: Option<f64>,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    arguments.out.as_deref().map(make_folder).transpose()?;
    let page =
        arguments.report.as_ref().map(|path| PageFile::create(path, &Inputs::default())).transpose()?;
    let bar = output::bar(1, "{bar:40} {pos:>3}/{len} {msg}, {elapsed}");
    let show = |progress: Progress| {
        bar.set_length(progress.count as u64);
        bar.set_message(progress.stage);
        bar.set_position(progress.done as u64);
    };
    let mut reproduction = reproduce(arguments.seeds, show)?;
    if let Some(hours) = arguments.detection {
        reproduction.report.detection = Some(detection(hours, show)?);
    }
    bar.finish_and_clear();
    if let Some(directory) = &arguments.out {
        reproduction.write(directory)?;
    }
    if let Some(page) = page {
        page.finish(&pitchleak_reproduce::page(&reproduction)?)?;
    }
    let report = &reproduction.report;
    output::print_as(arguments.json, || report.to_json(), || report.to_text())?;
    Ok(Outcome::Done)
}
