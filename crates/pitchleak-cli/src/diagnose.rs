use crate::Outcome;
use crate::input::{TextFormat, rig};
use crate::output::{self, Failure};
use clap::Args;
use indicatif::ProgressBar;
use pitchleak::Rig;
use pitchleak::diagnose::{Declared, Roles, Series, Traces, diagnose};
use pitchleak::output::{Inputs, OutputFile, make_folder};
use pitchleak::trace::{BadRows, TraceReader};
use pitchleak_view::page::{Page, PageFile};
use pitchleak_view::{Palette, Text, residual_figures};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Find the physical effect that the model lacks: traces of one rig, fitted together
///
/// Tells what the residual of the declared model shows, which known effect explains it, and the error
/// before and after on samples that were not fitted.
#[derive(Args)]
#[command(after_help = "\
Examples:
  pitchleak diagnose trace.csv.gz --rig turbine7.toml
  pitchleak diagnose monday/*.csv --test tuesday/*.csv --save-rig corrected.toml
  pitchleak replay trace.csv.gz --rig corrected.toml
  pitchleak diagnose trace.csv.gz --out-dir figures")]
pub struct Arguments {
    /// Traces to fit: .csv, .csv.gz, .parquet or .mat, `-` for standard input
    #[arg(value_name = "TRACE", required = true)]
    traces: Vec<PathBuf>,

    /// Traces to judge on [default: blocks of the fitted traces that each fit leaves out]
    #[arg(long, value_name = "TRACE", num_args = 1..)]
    test: Vec<PathBuf>,

    /// Rig file [default: rig.toml beside the first trace, else the built-in rig wu2011]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,

    /// End at the first bad row instead of skipping it
    #[arg(long)]
    strict: bool,

    /// Print the result as JSON (schema pitchleak.diagnose/1)
    #[arg(long)]
    json: bool,

    /// Write the result as a page for a browser: .html, complete in itself
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,

    /// Write figures (SVG) of the residual of each equation before and after into this directory: over time, its
    /// autocorrelation and distribution, and against each variable
    #[arg(long = "out-dir", alias = "out", value_name = "DIR")]
    out: Option<PathBuf>,

    /// Write the rig file with the effects found in it
    #[arg(long, value_name = "FILE")]
    save_rig: Option<PathBuf>,

    #[command(flatten)]
    text_format: TextFormat,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut rig = rig(arguments.rig.as_ref(), &arguments.traces)?;
    arguments.text_format.settle(&mut rig);
    let roles = Roles::of(&arguments.traces, &arguments.test)?;
    roles.repeated.iter().for_each(|same| output::warn(&[same.to_string()]));
    let inputs =
        Inputs::of(arguments.traces.iter().chain(&arguments.test).map(PathBuf::as_path).chain(rig.file()));
    let saved = arguments.save_rig.as_ref().map(|path| OutputFile::create(path, &inputs)).transpose()?;
    let page = arguments.report.as_ref().map(|path| PageFile::create(path, &inputs)).transpose()?;
    arguments.out.as_deref().map(make_folder).transpose()?;
    let bar = ProgressBar::new_spinner();
    bar.enable_steady_tick(Duration::from_millis(200));
    let bad_rows = if arguments.strict { BadRows::Fatal } else { BadRows::Skip };
    let mut warnings = Warnings::default();
    let mut read_all = |paths: &[PathBuf]| -> Result<Vec<Series>, Failure> {
        let mut traces = Traces::default();
        for (number, path) in (1..).zip(paths) {
            bar.set_message(format!("reading {} ({number} of {})", path.display(), paths.len()));
            read(path, &rig, bad_rows, &mut traces, &mut warnings)?;
        }
        Ok(traces.into_series())
    };
    let (train, test) = (read_all(&roles.fitted)?, read_all(&roles.judged)?);
    bar.suspend(|| output::warn(&in_lines(warnings)));
    bar.set_message("fitting");
    let diagnosis = diagnose(&train, &test, &Declared::of(&rig), &|| bar.tick());
    bar.finish_and_clear();
    if let Some(file) = saved {
        let before = rig.file().and_then(|path| std::fs::read_to_string(path).ok()).unwrap_or_default();
        file.finish_with(diagnosis.rig(&rig).to_toml_over(&before))?;
    }
    if let Some(page) = page {
        let names: Vec<_> =
            roles.fitted.iter().chain(&roles.judged).map(|path| path.display().to_string()).collect();
        page.finish(&Page::of_diagnosis(&diagnosis, &rig, &names))?;
    }
    if let Some(folder) = &arguments.out {
        for (name, figure) in residual_figures(&diagnosis)? {
            pitchleak::output::write(folder.join(name), figure, &inputs)?;
        }
    }
    let to_text = || format!("rig {}\n{}", rig.name, diagnosis.to_text(&Palette::PLAIN));
    output::print_as(arguments.json, || serde_json::to_string_pretty(&diagnosis), to_text)?;
    Ok(Outcome::Done)
}

/// Each warning with the traces that it is about.
type Warnings = BTreeMap<String, Vec<String>>;

fn in_lines(warnings: Warnings) -> Vec<String> {
    let line = |(warning, traces): (String, Vec<String>)| match traces.as_slice() {
        [first, _, ..] => format!("{first} and {} more: {warning}", traces.len() - 1),
        _ => format!("{}: {warning}", traces.concat()),
    };
    warnings.into_iter().map(line).collect()
}

fn read(
    path: &Path,
    rig: &Rig,
    bad_rows: BadRows,
    traces: &mut Traces,
    warnings: &mut Warnings,
) -> Result<(), Failure> {
    let mut reader = TraceReader::open(path, rig)?.with_bad_rows(bad_rows);
    traces.read(&mut reader, rig, || Ok::<_, Failure>(()))?;
    let reading = reader.quality().reading.iter().map(|reading| format!("read with {reading}"));
    for warning in reading.chain(reader.quality().warnings()) {
        warnings.entry(warning).or_default().push(reader.name().to_owned());
    }
    Ok(())
}
