//! Whole traces: replayed, checked, proved by leaks put in, and a valve calibrated by them.

use crate::Outcome;
use crate::input::{Input, Trace, one_of, rig};
use crate::output::{self, Failure};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use pitchleak::check::check;
use pitchleak::core::PerLeak;
use pitchleak::diagnose::Roles;
use pitchleak::output::{Inputs, OutputFile};
use pitchleak::prove::prove;
use pitchleak::replay::{EstimateFile, Replay, ReplayError, replay};
use pitchleak::rig::EstimatorKind;
use pitchleak::trace::{Record, TraceReader};
use pitchleak::units::{Dimension, LPM_PER_M3S, parse};
use pitchleak::valve::{CalibrationError, Calibrator, LeaksThen};
use pitchleak_view::Text;
use pitchleak_view::page::{History, Page, PageFile};
use pitchleak_view::text::{CheckSketch, ReplaySketch};
use std::path::{Path, PathBuf};

/// Replay traces: estimate their leaks and say what to do
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct ReplayArguments {
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

impl ReplayArguments {
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.input.check_single("--out", self.out.is_some())?;
        self.input.check_single("--report", self.report.is_some())?;
        self.input.for_each(|trace| self.run_one(trace))
    }

    fn run_one(&self, mut trace: Trace) -> Result<Outcome, Failure> {
        let kind = &mut trace.rig.estimator.kind;
        *kind = self.estimator.unwrap_or(*kind);
        let inputs = trace.files();
        let mut file = self.out.as_ref().map(|path| EstimateFile::create(path, &inputs)).transpose()?;
        let mut page = CoursePage::create(self.report.as_deref(), &inputs)?;
        let mut sketch = (output::draws() && !self.json).then(|| ReplaySketch::new(&trace.rig));
        let (mut reader, bar) = trace.open()?;
        let each = |replay: &Replay, record: &Record, renewed: bool| {
            page.add(replay, record, renewed);
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
        page.finish(|history| Page::of_replay(&report, &trace.rig, history))?;
        bar.finish_and_clear();
        output::tell(&report.trace);
        let to_json = || report.to_json();
        trace.print(self.json, to_json, || match &sketch {
            Some(sketch) => sketch.to_text(&report, &output::palette()),
            None => report.to_text(&output::palette()),
        })?;
        let fault = self.fail_on_fault && !report.verdict.faults.is_empty();
        let doubt = self.fail_on_doubt && !report.verdict.status.is_sure();
        Ok(if fault || doubt { Outcome::FaultFound } else { Outcome::Done })
    }
}

/// The page that was asked for, if one was, and the trace's course that it draws.
struct CoursePage(Option<(PageFile, History)>);

impl CoursePage {
    fn create(path: Option<&Path>, inputs: &Inputs) -> Result<Self, Failure> {
        let page = path.map(|path| PageFile::create(path, inputs)).transpose()?;
        Ok(Self(page.map(|page| (page, History::default()))))
    }

    fn add(&mut self, replay: &Replay, record: &Record, renewed: bool) {
        if let Some((_, history)) = &mut self.0 {
            history.add(replay, record, renewed);
        }
    }

    fn finish(self, page_of: impl FnOnce(&History) -> Page) -> Result<(), Failure> {
        if let Some((page, history)) = self.0 {
            page.finish(&page_of(&history))?;
        }
        Ok(())
    }
}

/// Check traces: data quality, excitation, what they can and cannot identify
#[derive(Args)]
#[command(after_help = "Example: pitchleak check trace.csv.gz --rig turbine7.toml")]
pub struct CheckArguments {
    #[command(flatten)]
    input: Input,

    /// Write the result on one trace as a page for a browser: .html, complete in itself
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,

    /// Print the result as JSON (schema pitchleak.check/1), a line for each trace
    #[arg(long)]
    json: bool,
}

impl CheckArguments {
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.input.check_single("--report", self.report.is_some())?;
        self.input.for_each(|trace| self.run_one(&trace))
    }

    fn run_one(&self, trace: &Trace) -> Result<Outcome, Failure> {
        let mut page = CoursePage::create(self.report.as_deref(), &trace.files())?;
        let mut sketch = (output::draws() && !self.json).then(|| CheckSketch::new(&trace.rig));
        let (mut reader, bar) = trace.open()?;
        let report = check(&mut reader, &trace.rig, |replay, record, renewed| {
            page.add(replay, record, renewed);
            if let Some(sketch) = &mut sketch {
                sketch.add(record);
            }
            Ok::<_, Failure>(())
        })?;
        page.finish(|history| Page::of_check(&report, &trace.rig, history))?;
        bar.finish_and_clear();
        output::tell(&report.trace);
        let to_json = || report.to_json();
        trace.print(self.json, to_json, || match &sketch {
            Some(sketch) => sketch.to_text(&report, &output::palette()),
            None => report.to_text(&output::palette()),
        })?;
        Ok(Outcome::Done)
    }
}

/// Put a known leak into your own trace: is it found, at its size, how soon, and from which size on?
#[derive(Args)]
#[command(after_help = "\
Example:
  pitchleak prove trace.csv                              # each kind, twice and five times its alarm's threshold
  pitchleak prove trace.csv --leak-internal '0.3 L/min' --report proof.html")]
pub struct ProveArguments {
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

impl ProveArguments {
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.input.check_single("--report", self.report.is_some())?;
        self.input.for_each(|trace| self.run_one(&trace))
    }

    fn run_one(&self, trace: &Trace) -> Result<Outcome, Failure> {
        let sizes_lpm = PerLeak {
            internal: self.leak_internal.clone(),
            external_a: self.leak_external_a.clone(),
            external_b: self.leak_external_b.clone(),
        };
        let page = self.report.as_ref().map(|path| PageFile::create(path, &trace.files())).transpose()?;
        let bar = output::spinner("{spinner} {pos} leaks put in, {elapsed}");
        let proof = prove(|| trace.open_again(), &trace.rig, &sizes_lpm, || bar.inc(1))?;
        bar.finish_and_clear();
        if let Some(page) = page {
            page.finish(&Page::of_proof(&proof, &trace.rig))?;
        }
        output::tell(&proof.trace);
        trace.print(self.json, || proof.to_json(), || proof.to_text(&output::palette()))?;
        Ok(Outcome::Done)
    }
}

/// Learn the valve of a cylinder without flow meters from traces of it: gains, laps and clearances of its edges
///
/// Internal leaks are told without. External ones look like a valve's own clearance, and smaller ones are found after it.
#[derive(Args)]
#[command(after_help = "\
Example:
  pitchleak calibrate week1.csv week2.csv --leaks zero --evidence hold.csv --out valve.toml
  # rig.toml: [valve] calibration = \"valve.toml\"")]
pub struct CalibrateArguments {
    /// Traces of one rig, five minutes or more in all: .csv, .csv.gz, .parquet or .mat
    #[arg(value_name = "TRACE", required = true)]
    traces: Vec<PathBuf>,

    /// Rig file with [valve] [default: rig.toml beside the first trace]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,

    /// What leaked while they were recorded: after `zero` leaks are absolute, after `unknown` external ones are changes since
    #[arg(long, value_name = "LEAKS", value_parser = leaks_then())]
    leaks: LeaksThen,

    /// A hold test that finds no leak, for `--leaks zero`, which without one is an assumption
    #[arg(long, value_name = "HOLD")]
    evidence: Option<PathBuf>,

    /// Write the calibration here
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

fn leaks_then() -> impl TypedValueParser<Value = LeaksThen> {
    PossibleValuesParser::new(LeaksThen::NAMES)
        .try_map(|name| LeaksThen::by_name(&name).ok_or("neither zero nor unknown"))
}

/// A file as a rig file names it: from its own folder.
fn seen_from(rig: Option<&Path>, file: &Path) -> PathBuf {
    let folder = rig.and_then(Path::parent).unwrap_or(Path::new(""));
    let within = file.strip_prefix(folder).map(Path::to_path_buf);
    within.or_else(|_| std::path::absolute(file)).unwrap_or_else(|_| file.to_path_buf())
}

impl CalibrateArguments {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let rig = rig(self.rig.as_ref(), &self.traces)?.uncalibrated();
        let read = self.traces.iter().chain(&self.evidence).map(PathBuf::as_path).chain(rig.file());
        let file = OutputFile::create(&self.out, &Inputs::of(read))?;
        let mut calibrator = Calibrator::new(&rig, self.leaks)?;
        let traces = Roles::of(&self.traces, &[])?;
        traces.repeated.iter().for_each(|same| output::warn(&[same.to_string()]));
        if let Some(hold) = &self.evidence {
            let mut reader = TraceReader::open(hold, &rig)?;
            let report = replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(()))?;
            match calibrator.rest_on(&report) {
                Err(aside @ CalibrationError::UnknownInSpiteOfEvidence) => output::warn(&[aside.to_string()]),
                rests => rests?,
            }
        }
        for path in &traces.fitted {
            calibrator.read(&mut TraceReader::open(path, &rig)?)?;
        }
        let found = calibrator.finish()?;
        file.finish_with(found.to_toml()?)?;
        output::print(&found.to_text(&output::palette()))?;
        let out = seen_from(rig.file(), &self.out);
        output::print(&format!("\nIn {}: [valve] calibration = \"{}\"\n", rig.name, out.display()))?;
        Ok(Outcome::Done)
    }
}
