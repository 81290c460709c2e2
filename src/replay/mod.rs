//! Replay: a trace goes through the estimator and the leak detector, record by record, in constant memory.

mod estimator;
mod pressures;

pub use estimator::{BulkModulus, Estimator};

use crate::rig::{AlarmSettings, EstimatorKind, Rig};
use crate::trace::{Record, TraceError, TraceQuality, TraceReader};
use pitchleak_core as core;
use pitchleak_core::{AlarmState, Estimate, Excitation, LeakDetector, PerLeak, Update};
use pressures::TracePressures;

/// A leak that can be at fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// Past the piston seal.
    Internal,
    /// Out of chamber A.
    ExternalA,
    /// Out of chamber B.
    ExternalB,
}

impl Fault {
    /// The three, in the order of [`PerLeak`].
    pub const ALL: PerLeak<Self> =
        PerLeak { internal: Self::Internal, external_a: Self::ExternalA, external_b: Self::ExternalB };
}

/// A raised or cleared alarm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Alarm {
    /// Time in the trace, s.
    pub time_s: f64,
    /// Which leak.
    pub fault: Fault,
    /// Raised or cleared.
    pub state: AlarmState,
}

/// The estimates after one record, for a file of estimates over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Time in the trace, s.
    pub t_s: f64,
    /// Coefficients, m³/(s·Pa).
    pub coefficients: PerLeak<Estimate<f64>>,
    /// Leak flows at this instant's pressures, eq. (15), m³/s.
    pub flows_m3s: PerLeak<f64>,
    /// Active alarms.
    pub active: PerLeak<bool>,
}

/// One leak at the end of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeakOutcome {
    /// Coefficient, m³/(s·Pa).
    pub coefficient: Estimate<f64>,
    /// Its flow at the trace's mean pressure, m³/s; internal: at the mean size of P_L, whatever its sign.
    pub flow_m3s: Estimate<f64>,
    /// Mean flow with the sign of the pressure: what the leak carried in all, over the duration, m³/s.
    pub net_flow_m3s: f64,
    /// What the trace tells about it; `None` from the paper's law.
    pub excitation: Option<Excitation<f64>>,
}

/// What a replay found: estimates at the end of the trace, and every alarm on the way.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The trace as the user named it.
    pub trace: String,
    /// What was noticed about the trace.
    pub quality: TraceQuality,
    /// The rig's name.
    pub rig: String,
    /// Which estimator ran.
    pub estimator: EstimatorKind,
    /// The leaks.
    pub leaks: PerLeak<LeakOutcome>,
    /// The bulk modulus.
    pub bulk_modulus: BulkModulus,
    /// What the trace tells about the bulk modulus; `None` from the paper's law.
    pub bulk_modulus_excitation: Option<Excitation<f64>>,
    /// Offsets of the flow meters, m³/s, where estimated.
    pub flow_offsets_m3s: Option<[Estimate<f64>; 2]>,
    /// Gains of flow meters A and B and of the position sensor, where estimated.
    pub gains: Option<[Estimate<f64>; 3]>,
    /// Normalised innovations squared of balance and odometer: about 1 where model and declared noise fit.
    pub normalised_innovation: Option<[f64; 2]>,
    /// Alarms in the order of time.
    pub alarms: Vec<Alarm>,
    /// Alarms active at the end.
    pub active: PerLeak<bool>,
    /// Samples that the estimator itself could not use.
    pub rejected: u64,
}

/// A running replay.
pub struct Replay {
    rig: Rig,
    estimator: Estimator,
    detector: LeakDetector<f64>,
    since_detection_s: f64,
    pressures: TracePressures,
    alarms: Vec<Alarm>,
    rejected: u64,
}

impl Replay {
    /// A replay for a rig; the rig file's `[estimator]` says with which estimator.
    pub fn new(rig: &Rig) -> Self {
        Self {
            estimator: Estimator::new(rig),
            detector: LeakDetector::new(detector_settings(&rig.alarms)),
            since_detection_s: 0.0,
            pressures: TracePressures::default(),
            alarms: Vec::new(),
            rejected: 0,
            rig: rig.clone(),
        }
    }

    /// Takes in one record; says whether the estimates are new.
    #[inline]
    pub fn push(&mut self, record: &Record) -> bool {
        self.pressures.add(record);
        self.since_detection_s += record.dt_s;
        match self.estimator.update(record) {
            Update::Renewed => {
                self.detect(record.t_s);
                true
            }
            Update::Rejected => {
                self.rejected += 1;
                false
            }
            Update::Started | Update::Accepted => false,
        }
    }

    fn detect(&mut self, t_s: f64) {
        let flows = self.estimator.mean_leak_flows_m3s().unwrap_or_else(|| self.exact_flows_m3s());
        let changes = self.detector.update(self.since_detection_s, &flows);
        self.since_detection_s = 0.0;
        let changes = changes.zip(Fault::ALL);
        for (change, fault) in [changes.internal, changes.external_a, changes.external_b] {
            self.alarms.extend(change.map(|state| Alarm { time_s: t_s, fault, state }));
        }
    }

    /// The paper's law knows no uncertainty: its flows are compared with the thresholds as if they were
    /// known to a hundredth of them.
    fn exact_flows_m3s(&self) -> PerLeak<Estimate<f64>> {
        let threshold = detector_settings(&self.rig.alarms).threshold_m3s;
        self.estimator.leak_coefficients().zip(self.pressures.sizes()).zip(threshold).map(
            |((coefficient, pressure), threshold)| Estimate {
                value: coefficient.value * pressure,
                std: threshold / 100.0,
            },
        )
    }

    /// The estimates as they stand after `record`.
    pub fn point(&self, record: &Record) -> Point {
        let coefficients = self.estimator.leak_coefficients();
        let flows_m3s = coefficients.zip(leak_pressures_pa(record)).map(|(c, pressure)| c.value * pressure);
        Point { t_s: record.t_s, coefficients, flows_m3s, active: self.detector.active() }
    }

    /// The estimator.
    pub fn estimator(&self) -> &Estimator {
        &self.estimator
    }

    /// Ends the replay of the trace that `reader` read.
    pub fn finish(self, reader: &TraceReader) -> Outcome {
        let excitation = self.estimator.excitation();
        let per_leak = excitation.map_or(PerLeak::default(), |report| report.leaks.map(Some));
        Outcome {
            trace: reader.name().to_owned(),
            quality: reader.quality().clone(),
            rig: self.rig.name.clone(),
            estimator: self.rig.estimator.kind,
            leaks: self.leaks(per_leak),
            bulk_modulus: self.estimator.bulk_modulus(),
            bulk_modulus_excitation: excitation.map(|report| report.bulk_modulus),
            flow_offsets_m3s: self.estimator.flow_offsets_m3s(),
            gains: self.estimator.gains(),
            normalised_innovation: self.estimator.normalised_innovation(),
            active: self.detector.active(),
            alarms: self.alarms,
            rejected: self.rejected,
        }
    }

    fn leaks(&self, excitation: PerLeak<Option<Excitation<f64>>>) -> PerLeak<LeakOutcome> {
        let size = self.pressures.sizes();
        let net = PerLeak { internal: self.pressures.net_load(), ..size };
        let bias = self.rig.sensors().pressure.bias_std;
        let bias = PerLeak { internal: std::f64::consts::SQRT_2 * bias, external_a: bias, external_b: bias };
        self.estimator.leak_coefficients().zip(size).zip(net).zip(bias).zip(excitation).map(
            |((((coefficient, size), net), bias), excitation)| LeakOutcome {
                coefficient,
                flow_m3s: Estimate {
                    value: coefficient.value * size,
                    std: (coefficient.std * size).hypot(coefficient.value * bias),
                },
                net_flow_m3s: coefficient.value * net,
                excitation,
            },
        )
    }
}

/// Pressure across each leak, Pa: P_L, P_A, P_B.
pub fn leak_pressures_pa(record: &Record) -> PerLeak<f64> {
    let sample = &record.sample;
    PerLeak { internal: sample.load_pressure_pa(), external_a: sample.pa_pa, external_b: sample.pb_pa }
}

/// Replays a whole trace; `each` sees every record after it was taken in, and whether the estimates are
/// new.
///
/// # Errors
/// Where the trace cannot be read on, or a bad row is fatal.
pub fn replay(
    reader: &mut TraceReader,
    rig: &Rig,
    mut each: impl FnMut(&Replay, &Record, bool) -> Result<(), TraceError>,
) -> Result<Outcome, TraceError> {
    let mut replay = Replay::new(rig);
    let mut record = Record::default();
    while reader.next_record(&mut record)? {
        let renewed = replay.push(&record);
        each(&replay, &record, renewed)?;
    }
    Ok(replay.finish(reader))
}

fn detector_settings(alarms: &AlarmSettings) -> core::AlarmSettings<f64> {
    let [internal, external_a, external_b] = alarms.threshold_m3s;
    let default = core::AlarmSettings::default();
    core::AlarmSettings {
        threshold_m3s: PerLeak { internal, external_a, external_b },
        clear_share: 1.0 - alarms.hysteresis_m3s / internal.min(external_a).min(external_b),
        hold_time_s: alarms.hold_time_s,
        ..default
    }
}
