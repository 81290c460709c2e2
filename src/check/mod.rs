//! What a trace is worth before anybody believes its leaks: data quality, channels, wiring, excitation, and what it
//! can and cannot identify.

mod readings;

pub use readings::{Reading, SIGNALS, values};

use crate::channels::{ChannelFault, ChannelMonitor};
use crate::hold::HoldSummary;
use crate::replay::{Replay, ReplayError, replay};
use crate::report::{EstimateEntry, Leakage, TraceSummary, Verdict};
use crate::rig::{EstimatorKind, Rig};
use crate::trace::{Record, TraceReader};
use crate::valve::ValveSummary;
use crate::wiring::Wiring;
use pitchleak_core::{Estimate, PerLeak};
use readings::Extremes;
use serde::Serialize;

/// The result of a check, as `check --json` prints it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// `pitchleak.check/1`.
    pub schema: &'static str,
    /// What was read.
    pub trace: TraceSummary,
    /// `wu2011`, or the rig file's path.
    pub rig: String,
    /// What each signal did.
    pub readings: Vec<Reading>,
    /// Channels that are dead, stuck, clipped, held or coarse.
    pub channels: Vec<ChannelFault>,
    /// As `replay` has it.
    pub verdict: Verdict,
    /// The mistake of wiring, sign or unit that explains what the columns as declared do not.
    pub wiring: Option<Wiring>,
    /// Of a hold test: how much of it is usable, and the smallest leaks that it finds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hold: Option<HoldSummary>,
    /// Where the valve's flows stand for meters: what they are worth, and the smallest leaks that they find.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub valve: Option<ValveSummary>,
    /// What the trace tells about each leak.
    pub leaks: PerLeak<Reach>,
    /// What the trace tells about the bulk modulus.
    pub bulk_modulus: Reach,
    /// Innovation squared over its variance, of the flow balance and of the position: about 1 where
    /// model and declared noise explain the trace.
    pub normalised_innovation: Option<[f64; 2]>,
}

/// How well a trace pins one parameter down.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reach {
    /// Whether it does.
    pub identifiable: bool,
    /// Half width of the 95 % interval: L/min for a leak, Pa for the bulk modulus.
    pub resolution: Option<f64>,
    /// Why it does not, in a few words.
    pub reason: Option<String>,
}

impl Reach {
    fn new(entry: &EstimateEntry, std: Option<f64>) -> Self {
        Self {
            identifiable: entry.identifiable,
            resolution: std.map(|std| Estimate { value: entry.value, std }.half_width95()),
            reason: entry.reason.clone(),
        }
    }
}

impl CheckReport {
    /// Name and version of the JSON form.
    pub const SCHEMA: &'static str = "pitchleak.check/1";

    /// One line of JSON.
    ///
    /// # Errors
    /// None in practice: every field has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string(self)
    }
}

/// Checks a whole trace with the default estimator, which knows what it does not know; `each` sees what [`replay`] shows.
///
/// # Errors
/// As [`replay`].
pub fn check<E: From<ReplayError>>(
    reader: &mut TraceReader<'_>,
    rig: &Rig,
    mut each: impl FnMut(&Replay, &Record, bool) -> Result<(), E>,
) -> Result<CheckReport, E> {
    let mut rig = rig.clone();
    rig.estimator.kind = EstimatorKind::Rls;
    let mut extremes = Extremes::default();
    let mut monitor = ChannelMonitor::default();
    let replayed = replay(reader, &rig, |replay, record, renewed| {
        extremes.add(record);
        if !replay.rests() {
            monitor.add(record);
        }
        each(replay, record, renewed)
    })?;
    let reach = |(entry, leakage): (&EstimateEntry, Leakage)| Reach::new(entry, leakage.std_lpm);
    let bulk_modulus = &replayed.estimates.bulk_modulus;
    Ok(CheckReport {
        schema: CheckReport::SCHEMA,
        readings: extremes.readings(),
        channels: monitor.faults(&rig),
        wiring: replayed.wiring,
        hold: replayed.hold,
        valve: replayed.valve,
        leaks: replayed.estimates.leaks().zip(replayed.leakage).map(reach),
        bulk_modulus: Reach::new(bulk_modulus, bulk_modulus.std),
        normalised_innovation: replayed.normalised_innovation,
        trace: replayed.trace,
        verdict: replayed.verdict,
        rig: rig.name,
    })
}
