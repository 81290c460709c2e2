use crate::Outcome;
use crate::output::{self, Failure};
use clap::Args;
use pitchleak::fleet::{
    FleetFile, FleetNights, FleetReport, FleetRig, FleetRow, FleetTable, FleetTrace, Stopped, judge_all,
};
use pitchleak_view::Text;
use pitchleak_view::page::{Page, PageFile};
use pitchleak_view::text::fleet_terminal;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Judge the traces of many cylinders on all cores: how each cylinder is, and a row per cylinder and trace
///
/// A trace that can't be read is reported and stands in the table with its error. The exit status is then 2, once all
/// others are judged.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// Traces, or patterns that name them (in quotes: `*` within a folder, `**` through folders)
    #[arg(value_name = "GLOB", required = true)]
    traces: Vec<String>,

    /// Rig file of all traces, or a CSV table of rig files with the header `trace,rig` or `trace,rig,cylinder`, where
    /// `trace` may be a pattern [default: rig.toml beside each trace, else the built-in rig wu2011]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,

    /// Write the table: .parquet, .csv or .csv.gz
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Keep a table that grows in this folder (Parquet, by day): only traces that are new or changed since the last run
    /// are read, and those of all nights are reported
    #[arg(long, value_name = "FOLDER")]
    table: Option<PathBuf>,

    /// Write the result as a page for a browser: .html, complete in itself
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,

    /// Print cylinders, counts and rows as JSON (schema pitchleak.fleet/1)
    #[arg(long)]
    json: bool,

    /// Learn from all traces how often each explanation is true, as `[decision] odds` for the rig files
    #[arg(long)]
    odds: bool,

    /// Exit with status 1 if a fault of a cylinder is found that no later trace excludes
    #[arg(long)]
    fail_on_fault: bool,
}

const EXAMPLES: &str = "\
Examples:
  pitchleak fleet 'farm/**/*.csv.gz' --out fleet.parquet
  pitchleak fleet 'logs/2026-05-*.csv' --rig rigs.csv --out may.csv
  pitchleak fleet 'farm/**/*.csv.gz' --table nights/ --report farm.html   # each night: what is new
  pitchleak fleet 'farm/**/*.csv.gz' --table nights/ --odds               # lines for the rig files
  pitchleak fleet farm/T7/*/*.csv --json | jq '.by_cylinder[] | select(.status == \"leak\") | .cylinder'
  pitchleak fleet 'farm/**/*.csv' --fail-on-fault || echo 'somebody has to go there'";

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let rigs = FleetRig::from_file(arguments.rig.clone());
    let traces = FleetTrace::find(&arguments.traces, &rigs)?;
    output::warn(&FleetTrace::doubles(&traces).collect::<Vec<_>>());
    let inputs = FleetTrace::inputs(&traces, &rigs);
    let file = arguments.out.as_ref().map(|path| FleetFile::create(path, &inputs)).transpose()?;
    let page = arguments.report.as_ref().map(|path| PageFile::create(path, &inputs)).transpose()?;
    let nights = arguments.table.as_deref().map(FleetNights::open).transpose()?;
    let (traces, seen) = match &nights {
        Some(nights) => nights.news(traces),
        None => (traces, Vec::new()),
    };
    let bar = output::bar(traces.len() as u64, "{bar:40} {pos}/{len} traces, {eta} left");
    let judged = |row: &FleetRow| {
        bar.inc(1);
        if let Some(error) = &row.error {
            bar.suspend(|| output::complain("error", error));
        }
    };
    let mut rows =
        judge_all(&traces, judged, &AtomicBool::new(false)).map_err(|Stopped| Failure::Interrupted)?;
    bar.finish_and_clear();
    if let Some(nights) = nights {
        rows = nights.add(seen, rows)?;
    }
    if let Some(file) = file {
        file.write(&FleetTable::of(&rows))?;
    }
    let report = FleetReport::of(&rows);
    let report = if arguments.odds { report.with_odds() } else { report };
    if let Some(page) = page {
        page.finish(&Page::of_fleet(&report))?;
    }
    output::print_as(
        arguments.json,
        || report.to_json(),
        || {
            let palette = output::palette();
            if output::draws() { fleet_terminal(&report, &palette) } else { report.to_text(&palette) }
        },
    )?;
    let fault = arguments.fail_on_fault && report.by_cylinder.iter().any(|one| !one.faults.is_empty());
    match report.counts.error {
        0 if fault => Ok(Outcome::FaultFound),
        0 => Ok(Outcome::Done),
        errors => Err(Failure::NotJudged { errors, traces: rows.len() }),
    }
}
