//! One cylinder and trace, by the replay of it: on all cores where there are many.

use super::{FleetTrace, TraceIdentity};
use crate::Rig;
use crate::explain::Explained;
use crate::replay::{ReplayError, replay};
use crate::report::{Episode, LeakTrend, ReplayReport, Status, with_interval};
use crate::trace::TraceReader;
use crate::units::LPM_PER_M3S;
use jiff::Timestamp;
use pitchleak_core::{Estimate, Leak, PerLeak};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

/// What one trace says of a cylinder: the report of its replay in short, or why it failed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FleetRow {
    /// Which cylinder.
    pub cylinder: String,
    /// The trace as it was named.
    pub path: String,
    /// When the trace begins: by its time stamps, else by its name; none where neither says.
    pub begins: Option<Timestamp>,
    /// Path of the rig file, or `wu2011`; none where it can't be used.
    pub rig: Option<String>,
    /// The verdict in a word; none where the trace could not be judged.
    pub status: Option<Status>,
    /// Leaks to act on.
    pub faults: Vec<Leak>,
    /// Ids of the reasons of a verdict in doubt, first things first.
    pub reasons: Vec<String>,
    /// What explains the trace, best first, down to 1 %; none without a posterior.
    #[serde(default)]
    pub explanations: Vec<FleetExplanation>,
    /// `[decision] odds` that it was judged with.
    #[serde(default)]
    pub odds: BTreeMap<String, f64>,
    /// Flows and their trends.
    pub leaks: Option<PerLeak<FleetLeak>>,
    /// Times at which an alarm was raised.
    pub alarms: u64,
    /// Good rows.
    pub samples: u64,
    /// Bad rows.
    pub skipped: u64,
    /// Pauses.
    pub gaps: u64,
    /// From the first to the last good row, s.
    pub duration_s: Option<f64>,
    /// Samples per second where they come regularly.
    pub sample_rate_hz: Option<f64>,
    /// What to know of the data.
    pub warnings: Vec<String>,
    /// Why the trace could not be judged.
    pub error: Option<String>,
}

/// An explanation of a trace that is left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FleetExplanation {
    /// Ids of what it is made of, joined by `+`.
    pub id: String,
    /// Posterior probability.
    pub probability: f64,
}

/// One leak of a cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FleetLeak {
    /// Mean size of its flow, L/min; of a leak that comes and goes, while it was last there.
    pub mean_lpm: f64,
    /// Standard deviation of its error, L/min; none where the estimator gives none, and of a leak that comes and goes.
    pub std_lpm: Option<f64>,
    /// The interval that holds the flow with 95 % probability, L/min.
    pub ci95: Option<[f64; 2]>,
    /// It is a leak to act on, and away at the trace's end.
    #[serde(default)]
    pub comes_and_goes: bool,
    /// The alarm's threshold, L/min.
    pub threshold_lpm: f64,
    /// Whether the trace pins it down.
    pub identifiable: bool,
    /// How fast it changes; none where the data don't tell.
    pub trend: Option<LeakTrend>,
}

impl FleetRow {
    /// What a replay found.
    pub fn of(identity: &TraceIdentity, report: &ReplayReport, rig: &Rig) -> Self {
        let trace = &report.trace;
        let raised = report.alarms.iter().filter(|alarm| alarm.state == pitchleak_core::AlarmState::Raised);
        Self {
            cylinder: identity.cylinder.clone(),
            path: trace.path.clone(),
            begins: identity.begins,
            rig: Some(report.rig.clone()),
            status: Some(report.verdict.status),
            faults: report.verdict.faults.clone(),
            reasons: report.verdict.reasons.iter().map(|reason| reason.id.name().to_owned()).collect(),
            explanations: report.verdict.explanations.iter().map(FleetExplanation::of).collect(),
            odds: rig.decision.odds.iter().map(|(id, share)| (id.to_owned(), share)).collect(),
            leaks: Some(PerLeak::from_fn(|leak| FleetLeak::of(report, rig, leak))),
            alarms: raised.count() as u64,
            samples: trace.samples,
            skipped: trace.skipped,
            gaps: trace.gaps,
            duration_s: Some(trace.duration_s),
            sample_rate_hz: trace.sample_rate_hz,
            warnings: trace.warnings.clone(),
            error: None,
        }
    }

    /// A trace that could not be judged.
    pub fn failed(identity: &TraceIdentity, path: String, error: String) -> Self {
        let (cylinder, begins) = (identity.cylinder.clone(), identity.begins);
        Self { cylinder, path, begins, error: Some(error), ..Self::default() }
    }

    /// Bytes that [`from_bytes`](Self::from_bytes) reads back, numbers to the last bit: for a row that another process
    /// made.
    ///
    /// # Errors
    /// None in practice: memory takes every byte.
    pub fn to_bytes(&self) -> Result<Vec<u8>, impl std::error::Error> {
        let mut bytes = Vec::new();
        ciborium::into_writer(self, &mut bytes).map(|()| bytes)
    }

    /// The row that gave these bytes.
    ///
    /// # Errors
    /// Where they are those of no row.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, impl std::error::Error> {
        ciborium::from_reader(bytes)
    }

    /// As at the head of its line.
    pub fn word(&self) -> &'static str {
        self.status.map_or("ERROR", Status::word)
    }

    /// A leak that the trace pins down without doubt.
    pub fn pinned(&self, leak: Leak) -> Option<FleetLeak> {
        let found = self.leaks?[leak];
        (found.identifiable && self.status != Some(Status::Doubtful)).then_some(found)
    }

    /// Its flow, L/min, where it comes with a standard deviation.
    pub(super) fn estimate(&self, leak: Leak) -> Option<Estimate<f64>> {
        let found = self.pinned(leak)?;
        let std = found.std_lpm.filter(|std| *std > 0.0)?;
        Some(Estimate { value: found.mean_lpm, std })
    }
}

impl FleetExplanation {
    fn of(explained: &Explained) -> Self {
        Self { id: explained.id.clone(), probability: explained.probability }
    }

    /// For people.
    pub fn text(&self) -> String {
        format!("{} {:.2}", self.id, self.probability)
    }
}

impl FleetLeak {
    fn of(report: &ReplayReport, rig: &Rig, leak: Leak) -> Self {
        let flow = report.leakage[leak];
        let last = Episode::last_of(&report.episodes, leak);
        let away = last.filter(|last| last.to_s.is_some() && report.verdict.faults.contains(&leak));
        let std_lpm = flow.std_lpm.filter(|_| away.is_none());
        Self {
            mean_lpm: away.map_or(flow.mean_lpm, |last| last.mean_lpm),
            std_lpm,
            ci95: std_lpm.map(|_| flow.ci95()),
            comes_and_goes: away.is_some(),
            threshold_lpm: rig.alarms.threshold_m3s[leak] * LPM_PER_M3S,
            identifiable: report.estimates.leaks()[leak].identifiable,
            trend: report.trend[leak],
        }
    }

    /// Its flow with its interval, for people.
    pub fn flow_text(&self) -> String {
        let flow = with_interval(self.mean_lpm, self.std_lpm);
        if self.comes_and_goes { format!("comes and goes, {flow}") } else { flow }
    }
}

/// The caller has stopped listening.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped;

enum Ended {
    Failed(ReplayError),
    Stopped,
}

impl From<ReplayError> for Ended {
    fn from(error: ReplayError) -> Self {
        Self::Failed(error)
    }
}

/// Judges one trace as a replay of it does. A trace that can't be read is a row too.
///
/// # Errors
/// [`Stopped`] soon after `go_on` says no; it is asked after each sample.
pub fn judge(trace: &FleetTrace, go_on: impl FnMut() -> bool) -> Result<FleetRow, Stopped> {
    let name = trace.path.display().to_string();
    match &trace.rig {
        Ok(rig) => judge_opened(
            &name,
            &trace.identity,
            rig,
            TraceReader::open(&trace.path, rig).map_err(ReplayError::from),
            go_on,
        ),
        Err(error) => Ok(FleetRow::failed(&trace.identity, name, error.to_string())),
    }
}

/// As [`judge`], from what opening a trace gave; `name` is the trace's.
///
/// # Errors
/// As [`judge`].
pub fn judge_opened(
    name: &str,
    identity: &TraceIdentity,
    rig: &Rig,
    opened: Result<TraceReader<'_>, ReplayError>,
    mut go_on: impl FnMut() -> bool,
) -> Result<FleetRow, Stopped> {
    keep_freed_memory();
    let replayed = opened.map_err(Ended::Failed).and_then(|mut reader| {
        let report = replay(&mut reader, rig, |_, _, _| if go_on() { Ok(()) } else { Err(Ended::Stopped) })?;
        let begins = reader.clock().and_then(|clock| clock.start()).or(identity.begins);
        Ok(FleetRow::of(&TraceIdentity { begins, ..identity.clone() }, &report, rig))
    });
    match replayed {
        Ok(row) => Ok(row),
        Err(Ended::Failed(error)) => Ok(FleetRow::failed(identity, name.to_owned(), error.to_string())),
        Err(Ended::Stopped) => Err(Stopped),
    }
}

/// The allocator of glibc hands freed memory beyond twice the largest block freed so far back to the system (`mallopt(3)`,
/// M_MMAP_THRESHOLD: 32 MiB at the most), and the next trace has its pages mapped anew, for a tenth of the time. A block
/// that nobody touches costs nothing.
fn keep_freed_memory() {
    const BLOCK: usize = (32 << 20) - (64 << 10);
    static KEPT: Once = Once::new();
    KEPT.call_once(|| drop(std::hint::black_box(Vec::<u8>::with_capacity(BLOCK))));
}

/// Judges every trace, on all cores of rayon's pool; `each` sees the rows as they come. The rows are in the order of the
/// traces. Memory: a row a trace, and for each core what a replay needs.
///
/// # Errors
/// [`Stopped`] soon after `stop` is set.
pub fn judge_all(
    traces: &[FleetTrace],
    each: impl Fn(&FleetRow) + Sync,
    stop: &AtomicBool,
) -> Result<Vec<FleetRow>, Stopped> {
    // One trace after the other from a common queue: they differ in length.
    let rows = traces.par_iter().with_max_len(1).map(|trace| {
        let row = judge(trace, || !stop.load(Ordering::Relaxed))?;
        each(&row);
        Ok(row)
    });
    rows.collect()
}
