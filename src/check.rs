//! What a trace is worth before anybody believes its leaks: data quality, channels, wiring, excitation, and what it
//! can and cannot identify.

use crate::channels::{ChannelFault, ChannelMonitor};
use crate::hold::HoldSummary;
use crate::replay::{Replay, ReplayError, replay};
use crate::report::{EstimateEntry, Leakage, TraceSummary, Verdict};
use crate::rig::{EstimatorKind, Rig};
use crate::signal::Signal;
use crate::trace::{Record, TraceReader};
use crate::units::Dimension;
use crate::valve::ValveSummary;
use crate::wiring::Wiring;
use pitchleak_core::{Estimate, PerLeak};
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

/// What one signal did over a trace, SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reading {
    /// Name of the signal, as in the column headers.
    pub signal: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Lowest reading.
    pub least: f64,
    /// Highest reading.
    pub most: f64,
    /// Share of the rows that have it, %.
    pub present_percent: f64,
}

/// Extremes of every signal in constant memory.
#[derive(Clone, Debug)]
pub(super) struct Extremes {
    rows: u64,
    channels: [Channel; SIGNALS.len()],
}

#[derive(Clone, Copy, Debug)]
struct Channel {
    count: u64,
    least: f64,
    most: f64,
}

/// What a check tells of, in the order of its table.
pub const SIGNALS: [Signal; 8] = [
    Signal::Position,
    Signal::PressureA,
    Signal::PressureB,
    Signal::FlowA,
    Signal::FlowB,
    Signal::Force,
    Signal::Spool,
    Signal::Supply,
];

/// Of each of [`SIGNALS`], SI.
pub fn values(record: &Record) -> [Option<f64>; SIGNALS.len()] {
    let (s, valve) = (&record.sample, record.valve);
    [
        Some(s.x_m),
        Some(s.pa_pa).filter(|reading| !reading.is_nan()),
        Some(s.pb_pa).filter(|reading| !reading.is_nan()),
        s.qa_m3s,
        s.qb_m3s,
        s.force_n,
        valve.map(|valve| valve.spool),
        valve.and_then(|valve| valve.supply_pa),
    ]
}

impl Default for Extremes {
    fn default() -> Self {
        let empty = Channel { count: 0, least: f64::INFINITY, most: f64::NEG_INFINITY };
        Self { rows: 0, channels: [empty; SIGNALS.len()] }
    }
}

impl Extremes {
    pub fn add(&mut self, record: &Record) {
        self.rows += 1;
        for (channel, value) in self.channels.iter_mut().zip(values(record)) {
            if let Some(value) = value {
                channel.count += 1;
                channel.least = channel.least.min(value);
                channel.most = channel.most.max(value);
            }
        }
    }

    /// The signals that the trace has.
    pub fn readings(&self) -> Vec<Reading> {
        let present = SIGNALS.iter().zip(&self.channels).filter(|(_, channel)| channel.count > 0);
        let reading = |(signal, channel): (&Signal, &Channel)| Reading {
            signal: signal.name(),
            unit: signal.dimension().map_or("", Dimension::si),
            least: channel.least,
            most: channel.most,
            present_percent: 100.0 * channel.count as f64 / self.rows as f64,
        };
        present.map(reading).collect()
    }
}
