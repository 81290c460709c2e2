//! Simulated traces, and the paper's experiment on them.

use crate::Outcome;
use crate::output::{self, Failure};
use clap::Args;
use pitchleak::Rig;
use pitchleak::core::PerLeak;
use pitchleak::output::{Inputs, make_folder};
use pitchleak::simulate::{
    EffectSize, Followed, LeakCourse, Noise, Plan, SensorFault, Span, ValveFlaw, share_of_full_scale,
};
use pitchleak::units::{self, Dimension};
use pitchleak::wind::{Emulation, Wind};
use pitchleak_reproduce::{Progress, detection, reproduce};
use pitchleak_view::page::PageFile;
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Simulate a rig with known leaks and write what its sensors would have recorded
#[derive(Args)]
#[command(after_help = SIMULATE_EXAMPLES)]
pub struct SimulateArguments {
    /// What the rig follows: 5, 13, 21 or 30 (m/s, built in), OpenFAST output (.out, .outb), or CSV with
    /// t_s, pitch_deg, pitch_moment_Nm
    #[arg(long, value_name = "CASE|FILE", conflicts_with_all = ["position", "load"])]
    wind: Option<Wind>,

    /// Instead of wind: piston position, constant ("100 mm") or a CSV file with t_s and x_mm
    #[arg(long, value_name = "X|FILE", required_unless_present = "wind", requires = "load")]
    position: Option<String>,

    /// Instead of wind: load against extension, constant ("2 kN") or a CSV file with t_s and force_n
    #[arg(long, value_name = "F|FILE", requires = "position", allow_hyphen_values = true)]
    load: Option<String>,

    /// Rig file [default: the built-in rig wu2011]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,

    /// Leak past the piston: mean flow over the run's first minute ("0.5 L/min") or coefficient ("0.02
    /// L/min/bar"); it may grow ("0.1 L/min -> 0.5 L/min @ 10 s..300 s"), begin or end ("0.5 L/min @ ..200 s"), come and go
    /// ("0.5 L/min every 60 s for 10 s")
    #[arg(long, value_name = "Q", default_value = "0", value_parser = leak, allow_hyphen_values = true)]
    leak_internal: LeakCourse,

    /// Leak out of chamber A
    #[arg(long, value_name = "Q", default_value = "0", value_parser = leak, allow_hyphen_values = true)]
    leak_external_a: LeakCourse,

    /// Leak out of chamber B
    #[arg(long, value_name = "Q", default_value = "0", value_parser = leak, allow_hyphen_values = true)]
    leak_external_b: LeakCourse,

    /// Time into the trace at which leaks without times of their own open [default: before it begins]
    #[arg(long, value_name = "TIME", value_parser = in_unit_of(Dimension::Time))]
    onset: Option<f64>,

    /// Oil temperature: "45 °C", "20 °C -> 60 °C @ 0 s..600 s", or a CSV file with t_s and temp_c. Leaks have
    /// their size at 40 °C and follow the viscosity of an oil ISO VG 32; the trace gets a column temp_c
    #[arg(long, value_name = "T|FILE")]
    oil_temp: Option<String>,

    /// Hold test: both ports are shut in this part of the trace ("5 s..15 s"), which gets a column `shut`. The piston stays where
    /// the oil and the load let it
    #[arg(long, value_name = "SPAN")]
    shut: Option<Span>,

    /// Effect beyond the model and its size in SI units; may be given more than once
    #[arg(long, value_name = "ID=VALUE")]
    effect: Vec<EffectSize>,

    /// What the valve of a rig with [valve] does beside its data sheet: "clearance=0.05 L/min" (of each edge), "hysteresis=1 %",
    /// "drift=0.5 %" (of the spool's zero), "droop=2 bar" (of a supply measured elsewhere); may be given more than once
    #[arg(long, value_name = "FLAW")]
    valve: Vec<ValveFlaw>,

    /// White noise of every sensor, 3 sigma: `none`, `rig` (as the rig file says), or a share of full scale
    #[arg(long, value_name = "NOISE", default_value = "none")]
    noise: Noise,

    /// Constant offset of every sensor, drawn evenly within this share of full scale
    #[arg(long, value_name = "SHARE", value_parser = share_of_full_scale, default_value = "0")]
    bias: f64,

    /// Mistake of a sensor, its wires or the recorder, e.g. "qa stuck 20 s..40 s"; may be given more than once
    /// and then happens in this order. All ways are listed below
    #[arg(long, value_name = "FAULT")]
    fault: Vec<SensorFault>,

    /// Seed of noise, offsets and mistakes
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Length of the trace [default: 60 s, or what the wind or reference has]
    #[arg(long, value_name = "TIME", value_parser = in_unit_of(Dimension::Time))]
    duration: Option<f64>,

    /// Where in the wind or reference the trace begins [default: 10 s after its beginning]
    #[arg(long, value_name = "TIME", value_parser = in_unit_of(Dimension::Time))]
    start: Option<f64>,

    /// Samples per second, or a frequency ("1 kHz")
    #[arg(long, value_name = "RATE", value_parser = in_unit_of(Dimension::Frequency), default_value = "100")]
    sample_rate: f64,

    /// Loads of the turbine are divided by this (the paper: 1000)
    #[arg(long, value_name = "FACTOR", default_value_t = Emulation::paper().load_scale)]
    load_scale: f64,

    /// Positions of the turbine are divided by this
    #[arg(long, value_name = "FACTOR", default_value_t = Emulation::paper().position_scale)]
    position_scale: f64,

    /// Inertia of the blade about its pitch axis, kg m^2
    #[arg(long, value_name = "J", default_value_t = Emulation::paper().blade_inertia_kgm2)]
    blade_inertia: f64,

    /// Trace to write: .csv or .csv.gz, `-` for standard output; the truth goes beside it as .json
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

const SIMULATE_EXAMPLES: &str = "\
Mistakes (--fault) of the channels t, x, pa, pb, qa, qb, force, temp; each with ' @ 20 s..40 s' where not for ever:
  'qa dead' (zero), 'qa stuck', 'qa missing', 'qa reversed', 'qa absolute', 'x other_end' (from the B end),
  'pa offset 10 bar', 'qb offset 1 %' (of full scale), 'qa drift 0.2 L/min/h', 'qa drift 1 %/h', 'qa gain 20 %',
  'pa times 10', 'pa in psi' (the number in another unit), 't in ms', 'qa clipped 5 L/min', 'qa held 200 ms',
  'pa late 100 ms', 'pa spikes 0.1 %' (of its readings are full scale), 'swap qa qb', 'rows lost 2 %',
  'rows lost 20 s..25 s'

Examples:
  pitchleak simulate --wind 13 --leak-internal '0.5 L/min' --noise '1 %' --seed 7 --out trace.csv.gz
  pitchleak simulate --wind 13 --leak-internal '0 -> 0.5 L/min' --oil-temp '30 °C -> 55 °C' --duration '10 min' --out trace.csv
  pitchleak simulate --wind 21 --noise '0.3 %' --fault 'swap pa pb' --fault 'qa drift 1 %/h' --out trace.csv
  pitchleak simulate --wind run.outb --rig turbine7.toml --effect viscous_friction=1500 --out trace.csv
  pitchleak simulate --position '100 mm' --load '4 kN' --shut '2 s..' --leak-internal '0.01 L/min' --noise rig --duration '12 s' --out hold.csv
  pitchleak simulate --position '100 mm' --load load.csv --duration '30 s' --out - | pitchleak replay -";

/// Reads a quantity that is not negative.
fn in_unit_of(dimension: Dimension) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match units::parse(text, dimension) {
        Ok(value) if value < 0.0 => Err("must not be negative".to_owned()),
        parsed => parsed.map_err(|error| error.to_string()),
    }
}

fn leak(text: &str) -> Result<LeakCourse, String> {
    // A bare number is m³/s, of which nobody thinks.
    if text.trim().parse::<f64>().is_ok_and(|number| number > 0.0) {
        return Err("a leak needs its unit, e.g. \"0.5 L/min\"".to_owned());
    }
    text.parse::<LeakCourse>().map_err(|error| error.to_string())
}

impl SimulateArguments {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let rig = self.rig.as_ref().map_or_else(|| Ok(Rig::paper()), Rig::load)?;
        let recording = self.plan().recording(rig)?;
        output::warn(&recording.warnings());
        let bar = output::bar(1000, "{bar:40} {percent:>3} %  simulating, {eta} left");
        recording.write(&self.out, |share| {
            bar.set_position((1000.0 * share) as u64);
            ControlFlow::Continue(())
        })?;
        bar.finish_and_clear();
        Ok(Outcome::Done)
    }

    fn followed(&self) -> Followed {
        match &self.wind {
            Some(wind) => {
                let emulation = Emulation {
                    load_scale: self.load_scale,
                    position_scale: self.position_scale,
                    blade_inertia_kgm2: self.blade_inertia,
                    ..Emulation::paper()
                };
                Followed::Wind(wind.clone(), emulation)
            }
            None => Followed::Given {
                position: self.position.clone().unwrap_or_default(),
                load: self.load.clone().unwrap_or_default(),
            },
        }
    }

    fn plan(&self) -> Plan {
        Plan {
            followed: self.followed(),
            leaks: PerLeak {
                internal: self.leak_internal,
                external_a: self.leak_external_a,
                external_b: self.leak_external_b,
            },
            onset_s: self.onset.unwrap_or(0.0),
            oil_temperature: self.oil_temp.clone(),
            shut: self.shut,
            effects: self.effect.clone(),
            valve_flaws: self.valve.clone(),
            noise: self.noise,
            bias_share: self.bias,
            sensor_faults: self.fault.clone(),
            seed: self.seed,
            start_s: self.start,
            duration_s: self.duration,
            sample_rate_hz: self.sample_rate,
        }
    }
}

/// Rerun the paper's experiment: four winds, two leak settings, its law and ours on the same readings
#[derive(Args)]
#[command(after_help = "Example: pitchleak reproduce --out reproduction --seeds 280")]
pub struct ReproduceArguments {
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

impl ReproduceArguments {
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.out.as_deref().map(make_folder).transpose()?;
        let page = self.report.as_ref().map(|path| PageFile::create(path, &Inputs::default())).transpose()?;
        let bar = output::bar(1, "{bar:40} {pos:>3}/{len} {msg}, {elapsed}");
        let show = |progress: Progress| {
            bar.set_length(progress.count as u64);
            bar.set_message(progress.stage);
            bar.set_position(progress.done as u64);
        };
        let mut reproduction = reproduce(self.seeds, show)?;
        if let Some(hours) = self.detection {
            reproduction.report.detection = Some(detection(hours, show)?);
        }
        bar.finish_and_clear();
        if let Some(directory) = &self.out {
            reproduction.write(directory)?;
        }
        if let Some(page) = page {
            page.finish(&pitchleak_reproduce::page(&reproduction)?)?;
        }
        let report = &reproduction.report;
        output::print_as(self.json, || report.to_json(), || report.to_text())?;
        Ok(Outcome::Done)
    }
}
