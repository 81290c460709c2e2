use crate::failure::Failure;
use crate::input::{Input, Trace};
use crate::{Outcome, output};
use clap::Args;
use pitchleak::core::PerLeak;
use pitchleak::prove::prove;
use pitchleak::units::{Dimension, LPM_PER_M3S, parse};
use pitchleak_view::Text;
use pitchleak_view::page::{Page, PageFile};
use std::path::PathBuf;

/// Put a known leak into your own trace: is it found, at its size, how soon, and from which size on?
#[derive(Args)]
#[command(after_help = "\
Example:
  pitchleak prove trace.csv                              # each kind, twice and five times its alarm's threshold
  pitchleak prove trace.csv --leak-internal '0.3 L/min' --report proof.html")]
pub struct Arguments {
    #[command(flatten)]
    input: Input,

    /// Put this mean flow in past the piston seal (\"0.3 L/min\"); may be given more than once
    #[arg(long, value_name = "Q", value_parser = flow_lpm)]
    leak_internal: Vec<f64>,

    /// Put this mean flow in out of chamber A
    #[arg(long, value_name = "Q", value_parser = flow_lpm)]
    leak_external_a: Vec<f64>,

    /// Put this mean flow in out of chamber B
    #[arg(long, value_name = "Q", value_parser = flow_lpm)]
    leak_external_b: Vec<f64>,

    /// Write the result on one trace as a page for a browser: .html, complete in itself
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,

    /// Print the result as JSON (schema pitchleak.prove/1), a line for each trace
    #[arg(long)]
    json: bool,
}

fn flow_lpm(text: &str) -> Result<f64, String> {
    let flow_m3s = parse(text, Dimension::Flow).map_err(|error| error.to_string())?;
    if text.trim().parse::<f64>().is_ok() {
        return Err("a flow needs its unit, e.g. \"0.3 L/min\"".to_owned());
    }
    if flow_m3s > 0.0 {
        Ok(flow_m3s * LPM_PER_M3S)
    } else {
        Err("a leak that is put in is more than none".to_owned())
    }
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    arguments.input.check_single("--report", arguments.report.is_some())?;
    arguments.input.for_each(|trace| run_one(arguments, &trace))
}

fn run_one(arguments: &Arguments, trace: &Trace) -> Result<Outcome, Failure> {
    let sizes_lpm = PerLeak {
        internal: arguments.leak_internal.clone(),
        external_a: arguments.leak_external_a.clone(),
        external_b: arguments.leak_external_b.clone(),
    };
    let page = arguments.report.as_ref().map(|path| PageFile::create(path, &trace.files())).transpose()?;
    let bar = output::spinner("{spinner} {pos} leaks put in, {elapsed}");
    let proof = prove(|| trace.open_again(), &trace.rig, &sizes_lpm, || bar.inc(1))?;
    bar.finish_and_clear();
    if let Some(page) = page {
        page.finish(&Page::of_proof(&proof, &trace.rig))?;
    }
    output::tell(&proof.trace);
    trace.print(arguments.json, || proof.to_json(), || proof.to_text(&output::palette()))?;
    Ok(Outcome::Done)
}
