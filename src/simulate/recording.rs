use super::valve::ValveSensors;
use super::writer::Columns;
use super::{
    Biases, Opening, Reading, Scenario, Sensing, SensorFault, SensorFaults, SimulateError, TraceLayout,
    TraceWriter,
};
use crate::output::{self, Inputs, OutputError, OutputFile};
use crate::reference::AfterEnd;
use crate::rig::Instruments;
use crate::units::LPM_PER_M3S;
use pitchleak_core::PerLeak;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// A scenario with the sensors that record it.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name of what the rig follows.
    pub followed: String,
    /// What happens.
    pub scenario: Scenario,
    /// Data sheets of the sensors, of which the white noise is used.
    pub instruments: Instruments,
    /// Constant offsets of the sensors.
    pub biases: Biases,
    /// Mistakes of the sensors, in the order in which they happen.
    pub sensor_faults: Vec<SensorFault>,
    /// Seed of the noise and of the mistakes.
    pub seed: u64,
    /// The files that all this was read from.
    pub inputs: Inputs,
}

/// What is true of a recorded trace: written beside it as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TruthFile {
    /// `pitchleak.simulate/1`.
    pub schema: &'static str,
    /// The program and its version.
    pub program: &'static str,
    /// What the rig followed, as given.
    pub reference: String,
    /// Name of the rig.
    pub rig: String,
    /// Time of the reference at which the trace begins, s.
    pub start_s: f64,
    /// Length of the trace, s.
    pub duration_s: f64,
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// Samples written.
    pub samples: u64,
    /// Seed of noise and biases.
    pub seed: u64,
    /// Time at which there is first a leak, s; zero: from the beginning, or never.
    pub leak_onset_s: f64,
    /// The leaks.
    pub leaks: PerLeak<LeakTruth>,
    /// Effects beyond the model by their ids, SI.
    pub effects: BTreeMap<&'static str, f64>,
    /// Standard deviations of the sensors' white noise, SI.
    pub noise_std: BTreeMap<&'static str, f64>,
    /// Constant offsets of the sensors, reading minus truth, SI.
    pub biases: Biases,
    /// Mistakes of the sensors, as given, in the order in which they happen.
    pub sensor_faults: Vec<String>,
    /// How the reference went on after its end, and when, where the trace is longer.
    pub reference_end: Option<ReferenceEnd>,
    /// Root mean square of position less its reference, m.
    pub position_error_rms_m: f64,
    /// Root mean square of load less its reference, N.
    pub load_error_rms_n: f64,
}

/// A reference that is shorter than the trace.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReferenceEnd {
    /// Time into the trace of its end, s.
    pub time_s: f64,
    /// How it goes on.
    pub after: AfterEnd,
}

/// One leak of a recorded trace.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct LeakTruth {
    /// Laminar coefficient at the leak's largest, and at 40 °C where the oil has a temperature, m³/(s·Pa).
    pub coefficient_m3spa: f64,
    /// Mean size of its flow, effects included, L/min.
    pub mean_flow_lpm: f64,
    /// How much of it is there at a time.
    pub course: Opening,
}

/// Why a recording was not made.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// A file of another kind.
    #[error("{path}: a simulated trace is written as .csv or .csv.gz, or to `-` (standard output)", path = .0.display())]
    Kind(PathBuf),
    /// The simulation.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// A file.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Standard output.
    #[error("cannot write to standard output: {0}")]
    StandardOutput(io::Error),
    /// The truth as JSON.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
}

/// Sums over a recording.
#[derive(Default)]
struct Totals {
    /// Written.
    rows: u64,
    samples: u64,
    flows_m3s: PerLeak<f64>,
    position_square: f64,
    load_square: f64,
}

impl Recording {
    /// What people should know before they use the trace, a line each.
    pub fn warnings(&self) -> Vec<String> {
        let percent = 100.0 * self.scenario.reference.clipped_share;
        let clipped = || format!("the position was held off the end stops for {percent:.1} % of the time");
        let ended = |end: ReferenceEnd| {
            let after = match end.after {
                AfterEnd::Held => "keeps its last values",
                AfterEnd::Mirrored => "runs back and forth again",
            };
            format!("it ends {:.0} s into the trace and then {after}", end.time_s)
        };
        let lines = (percent > 0.0).then(clipped).into_iter().chain(self.reference_end().map(ended));
        lines.map(|line| format!("{}: {line}", self.followed)).collect()
    }

    /// Where the trace is longer than what the rig follows.
    fn reference_end(&self) -> Option<ReferenceEnd> {
        let Scenario { reference, start_s, duration_s, .. } = &self.scenario;
        let time_s = (reference.span_s()?.1 - start_s).max(0.0);
        (time_s < *duration_s - 1e-9).then_some(ReferenceEnd { time_s, after: reference.after_end })
    }

    /// Writes the trace to `path` (`.csv`, `.csv.gz`, `-` for standard output), and what is true of it
    /// beside it as `.json`. `done` gets the share that is done and says whether to go on.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn write(
        &self,
        path: &Path,
        done: impl FnMut(f64) -> ControlFlow<()>,
    ) -> Result<TruthFile, RecordingError> {
        let name = path.to_string_lossy().to_ascii_lowercase();
        if name == "-" {
            let mut out = BufWriter::new(io::stdout());
            let truth = self.write_rows(&mut out, done)?;
            return truth
                .and_then(|truth| out.flush().map(|()| truth))
                .map_err(RecordingError::StandardOutput);
        }
        if !name.ends_with(".csv") && !name.ends_with(".csv.gz") {
            return Err(RecordingError::Kind(path.to_owned()));
        }
        let mut trace = OutputFile::create(path, &self.inputs)?;
        let mut beside = OutputFile::create(truth_path(path), &self.inputs)?;
        let truth = self.write_rows(&mut trace, done)?.map_err(|source| trace.error(source))?;
        let json = serde_json::to_string_pretty(&truth)?;
        writeln!(beside, "{json}").map_err(|source| beside.error(source))?;
        output::finish_all([trace, beside])?;
        Ok(truth)
    }

    /// Writes the trace; the output may fail, or what is simulated.
    fn write_rows(
        &self,
        out: &mut impl Write,
        done: impl FnMut(f64) -> ControlFlow<()>,
    ) -> Result<io::Result<TruthFile>, SimulateError> {
        let leaks_m3spa = self.scenario.leak_coefficients()?;
        let mut writer = match TraceWriter::new(out, TraceLayout::of(&self.scenario)) {
            Ok(writer) => writer,
            Err(error) => return Ok(Err(error)),
        };
        let mut failure = None;
        let truth = self.run(leaks_m3spa, done, |row| {
            failure = writer.row(row).err();
            failure.is_none()
        })?;
        Ok(failure.map_or(Ok(truth), Err))
    }

    /// The trace in memory, and what is true of it; `done` as for [`write`](Self::write).
    ///
    /// # Errors
    /// [`RecordingError::Simulate`].
    pub fn columns(
        &self,
        done: impl FnMut(f64) -> ControlFlow<()>,
    ) -> Result<(Columns, TruthFile), RecordingError> {
        let layout = TraceLayout::of(&self.scenario);
        let mut columns = layout.columns();
        let truth = self.run(self.scenario.leak_coefficients()?, done, |row| {
            layout.push(row, &mut columns);
            true
        })?;
        Ok((columns, truth))
    }

    /// Hands each row to `each` until that has had enough.
    fn run(
        &self,
        leaks_m3spa: PerLeak<f64>,
        mut done: impl FnMut(f64) -> ControlFlow<()>,
        mut each: impl FnMut(&Reading) -> bool,
    ) -> Result<TruthFile, SimulateError> {
        let Self { scenario, instruments, biases, sensor_faults, seed, .. } = self;
        let mut sensing = Sensing::new(instruments.spread(), *biases, *seed);
        let Scenario { rig, duration_s, .. } = scenario;
        let mut faults = SensorFaults::new(sensor_faults, &rig.instruments, rig.cylinder.stroke_m, *seed);
        let mut valve_sensors = ValveSensors::of(rig, instruments, &scenario.valve_flaws, *seed);
        let mut totals = Totals::default();
        let mut stopped = false;
        scenario.run_while(leaks_m3spa, |truth| {
            let valve =
                valve_sensors.as_mut().and_then(|sensors| sensors.read(truth, truth.t_s / duration_s));
            let shown = faults.show(&Reading::at(truth, &sensing.read(&truth.sample), valve));
            if shown.is_some_and(|row| !each(&row)) {
                return false;
            }
            totals.rows += u64::from(shown.is_some());
            totals.samples += 1;
            totals.flows_m3s = totals.flows_m3s.zip(truth.leaks_m3s).map(|(sum, flow)| sum + flow.abs());
            totals.position_square += (truth.signals.x_m - truth.position_reference_m).powi(2);
            totals.load_square += (truth.signals.force_n - truth.load_reference_n).powi(2);
            stopped = done(truth.t_s / duration_s).is_break();
            !stopped
        })?;
        if stopped {
            return Err(SimulateError::Stopped);
        }
        Ok(self.truth(leaks_m3spa, &totals))
    }

    fn truth(&self, leaks_m3spa: PerLeak<f64>, totals: &Totals) -> TruthFile {
        let Self { followed, scenario, instruments, biases, sensor_faults, seed, .. } = self;
        let noise = instruments.spread();
        let leaky = scenario.leaks.zip(leaks_m3spa).into_iter().filter(|(_, (_, most))| *most > 0.0);
        let onset_s = leaky.map(|(_, (leak, _))| leak.opening.onset_s()).reduce(f64::min).unwrap_or(0.0);
        let count = totals.samples.max(1) as f64;
        TruthFile {
            schema: "pitchleak.simulate/1",
            program: concat!("pitchleak ", env!("CARGO_PKG_VERSION")),
            reference: followed.clone(),
            rig: scenario.rig.name.clone(),
            start_s: scenario.start_s,
            duration_s: scenario.duration_s,
            sample_rate_hz: scenario.sample_rate_hz,
            samples: totals.rows,
            seed: *seed,
            leak_onset_s: onset_s,
            leaks: leaks_m3spa.zip(totals.flows_m3s).zip(scenario.leaks).map(
                |((coefficient_m3spa, sum), leak)| LeakTruth {
                    coefficient_m3spa,
                    mean_flow_lpm: LPM_PER_M3S * sum / count,
                    course: leak.opening,
                },
            ),
            effects: scenario.effects.iter().map(|active| (active.effect.spec().id, active.value)).collect(),
            noise_std: BTreeMap::from([
                ("x_m", noise.position.noise_std),
                ("pressure_pa", noise.pressure.noise_std),
                ("qa_m3s", noise.flow_a.noise_std),
                ("qb_m3s", noise.flow_b.noise_std),
                ("force_n", noise.force.noise_std),
            ]),
            biases: *biases,
            sensor_faults: sensor_faults.iter().map(ToString::to_string).collect(),
            reference_end: self.reference_end(),
            position_error_rms_m: (totals.position_square / count).sqrt(),
            load_error_rms_n: (totals.load_square / count).sqrt(),
        }
    }
}

/// Where the truth of the trace at `path` is written: `T.csv.gz` → `T.json`.
fn truth_path(path: &Path) -> PathBuf {
    let plain = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
        path.with_extension("")
    } else {
        path.to_owned()
    };
    plain.with_extension("json")
}
