use super::writer::{self, Columns};
use super::{Biases, Scenario, Sensing, SimulateError, TraceWriter, Truth};
use crate::units::LPM_PER_M3S;
use pitchleak_core::{PerLeak, Sample, Sensors};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// A scenario with the sensors that record it.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name of what the rig follows.
    pub followed: String,
    /// What happens.
    pub scenario: Scenario,
    /// White noise of the sensors.
    pub noise: Sensors<f64>,
    /// Constant offsets of the sensors.
    pub biases: Biases,
    /// Seed of the noise.
    pub seed: u64,
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
    /// Time at which the leaks open, s.
    pub leak_onset_s: f64,
    /// The leaks.
    pub leaks: PerLeak<LeakTruth>,
    /// Effects beyond the model by their ids, SI.
    pub effects: BTreeMap<&'static str, f64>,
    /// Standard deviations of the sensors' white noise, SI.
    pub noise_std: BTreeMap<&'static str, f64>,
    /// Constant offsets of the sensors, reading minus truth, SI.
    pub biases: BTreeMap<&'static str, f64>,
    /// Root mean square of position less its reference, m.
    pub position_error_rms_m: f64,
    /// Root mean square of load less its reference, N.
    pub load_error_rms_n: f64,
}

/// One leak of a recorded trace.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct LeakTruth {
    /// Laminar coefficient, m³/(s·Pa).
    pub coefficient_m3spa: f64,
    /// Mean size of its flow, effects included, L/min.
    pub mean_flow_lpm: f64,
}

/// Why a recording was not made.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The simulation.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// A file.
    #[error("{path}: {source}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// Sums over a recording.
#[derive(Default)]
struct Totals {
    samples: u64,
    flows_m3s: PerLeak<f64>,
    position_square: f64,
    load_square: f64,
}

impl Recording {
    /// What people should know before they use the trace.
    pub fn warning(&self) -> Option<String> {
        let percent = 100.0 * self.scenario.reference.clipped_share;
        let text = || {
            format!(
                "{}: the position was held off the end stops for {percent:.1} % of the time",
                self.followed
            )
        };
        (percent > 0.0).then(text)
    }

    /// Writes the trace to `path` (`.csv`, `.csv.gz`, `-` for standard output), and what is true of it
    /// beside it as `.json`. `done` gets the share that is done.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn write(&self, path: &Path, done: impl FnMut(f64)) -> Result<TruthFile, RecordingError> {
        let write = |source| RecordingError::Write { path: path.to_owned(), source };
        let leaks_m3spa = self.scenario.leak_coefficients()?;
        let mut writer = sink(path).and_then(TraceWriter::new).map_err(write)?;
        let mut failure = None;
        let truth = self.run(&leaks_m3spa, done, |truth, shown| {
            if failure.is_none() {
                failure = writer.row(truth, shown).err();
            }
        })?;
        let written = failure.map_or_else(|| writer.into_inner().finish(), Err);
        written.map_err(write)?;
        if path != Path::new("-") {
            truth.write_beside(path)?;
        }
        Ok(truth)
    }

    /// The trace in memory, and what is true of it.
    ///
    /// # Errors
    /// [`RecordingError::Simulate`].
    pub fn columns(&self) -> Result<(Columns, TruthFile), RecordingError> {
        let mut columns = writer::columns();
        let leaks_m3spa = self.scenario.leak_coefficients()?;
        let truth = self.run(
            &leaks_m3spa,
            |_| (),
            |truth, shown| {
                for ((_, values), value) in columns.iter_mut().zip(writer::row(truth, shown)) {
                    values.push(value);
                }
            },
        )?;
        Ok((columns, truth))
    }

    /// Hands each sample and its readings to `each`.
    fn run(
        &self,
        leaks_m3spa: &PerLeak<f64>,
        mut done: impl FnMut(f64),
        mut each: impl FnMut(&Truth, &Sample<f64>),
    ) -> Result<TruthFile, SimulateError> {
        let mut sensing = Sensing::new(self.noise, self.biases, self.seed);
        let mut totals = Totals::default();
        self.scenario.run(*leaks_m3spa, |truth| {
            each(truth, &sensing.read(&truth.sample));
            totals.samples += 1;
            totals.flows_m3s = totals.flows_m3s.zip(truth.leaks_m3s).map(|(sum, flow)| sum + flow.abs());
            totals.position_square += (truth.signals.x_m - truth.position_reference_m).powi(2);
            totals.load_square += (truth.signals.force_n - truth.load_reference_n).powi(2);
            done(truth.t_s / self.scenario.duration_s);
        })?;
        Ok(self.truth(leaks_m3spa, &totals))
    }

    fn truth(&self, leaks_m3spa: &PerLeak<f64>, totals: &Totals) -> TruthFile {
        let Self { followed, scenario, noise, biases, seed } = self;
        let count = totals.samples.max(1) as f64;
        TruthFile {
            schema: "pitchleak.simulate/1",
            program: concat!("pitchleak ", env!("CARGO_PKG_VERSION")),
            reference: followed.clone(),
            rig: scenario.rig.name.clone(),
            start_s: scenario.start_s,
            duration_s: scenario.duration_s,
            sample_rate_hz: scenario.sample_rate_hz,
            samples: totals.samples,
            seed: *seed,
            leak_onset_s: scenario.onset_s,
            leaks: leaks_m3spa.zip(totals.flows_m3s).map(|(coefficient_m3spa, sum)| LeakTruth {
                coefficient_m3spa,
                mean_flow_lpm: LPM_PER_M3S * sum / count,
            }),
            effects: scenario.effects.iter().map(|active| (active.effect.spec().id, active.value)).collect(),
            noise_std: BTreeMap::from([
                ("x_m", noise.position.noise_std),
                ("pressure_pa", noise.pressure.noise_std),
                ("qa_m3s", noise.flow_a.noise_std),
                ("qb_m3s", noise.flow_b.noise_std),
                ("force_n", noise.force.noise_std),
            ]),
            biases: BTreeMap::from([
                ("x_m", biases.x_m),
                ("pa_pa", biases.pa_pa),
                ("pb_pa", biases.pb_pa),
                ("qa_m3s", biases.qa_m3s),
                ("qb_m3s", biases.qb_m3s),
                ("force_n", biases.force_n),
            ]),
            position_error_rms_m: (totals.position_square / count).sqrt(),
            load_error_rms_n: (totals.load_square / count).sqrt(),
        }
    }
}

impl TruthFile {
    /// Writes it beside the trace at `path`.
    fn write_beside(&self, path: &Path) -> Result<(), RecordingError> {
        let path = truth_path(path);
        let text = serde_json::to_string_pretty(self).map_err(std::io::Error::from);
        let written = text.and_then(|text| std::fs::write(&path, text + "\n"));
        written.map_err(|source| RecordingError::Write { path, source })
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

/// An output that has to be closed to be whole.
enum Sink {
    Plain(BufWriter<Box<dyn Write>>),
    Gzip(flate2::write::GzEncoder<BufWriter<File>>),
}

fn sink(path: &Path) -> std::io::Result<Sink> {
    if path == Path::new("-") {
        return Ok(Sink::Plain(BufWriter::new(Box::new(std::io::stdout()))));
    }
    let file = File::create(path)?;
    Ok(if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
        Sink::Gzip(flate2::write::GzEncoder::new(BufWriter::new(file), flate2::Compression::best()))
    } else {
        Sink::Plain(BufWriter::new(Box::new(file)))
    })
}

impl Sink {
    fn finish(self) -> std::io::Result<()> {
        match self {
            Self::Plain(mut out) => out.flush(),
            Self::Gzip(encoder) => encoder.finish()?.flush(),
        }
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::Plain(out) => out.write(bytes),
            Self::Gzip(encoder) => encoder.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::Plain(out) => out.flush(),
            Self::Gzip(encoder) => encoder.flush(),
        }
    }
}
