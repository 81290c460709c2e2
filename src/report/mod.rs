//! What a replay found, as data (`pitchleak.replay/1`) and as text for people.

mod reason;
mod spell;
mod statement;
mod trend;
mod verdict;

pub use reason::{Reason, ReasonId};
pub use spell::{Episode, Spell};
pub use statement::{advice, capital, interval, with_interval};
pub(crate) use statement::{join, why};
pub use trend::{LeakTrend, OilShare, ReachTime, Slope};
pub use verdict::{Findings, Status, Verdict};

use crate::hold::HoldSummary;
use crate::rig::EstimatorKind;
use crate::score::LeakScore;
use crate::times::Clock;
use crate::trace::TraceQuality;
use crate::units::LPM_PER_M3S;
use crate::valve::ValveSummary;
use crate::wiring::Wiring;
use jiff::civil::Date;
use pitchleak_core::{AlarmState, Estimate, Leak, PerLeak};
use serde::Serialize;

/// A replay's result, as `replay --json` prints it. Numbers that are not finite become `null`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReplayReport {
    /// `pitchleak.replay/1`.
    pub schema: &'static str,
    /// What was read.
    pub trace: TraceSummary,
    /// `wu2011`, or the rig file's path.
    pub rig: String,
    /// The estimator that ran.
    pub estimator: EstimatorKind,
    /// At the end of the trace.
    pub estimates: Estimates,
    /// Mean leak flows: over the trace, or since `changed_at_s`.
    pub leakage: PerLeak<Leakage>,
    /// Offsets of the flow meters, where the rig file says that they may be off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flow_meter_offsets: Option<FlowMeterOffsets>,
    /// Innovation squared over its variance, of the flow balance and of the position, over the whole trace: about 1 where
    /// model and declared noise explain it, far above where they do not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normalised_innovation: Option<[f64; 2]>,
    /// Of a hold test: how much of it was usable. Its leakages are means over that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hold: Option<HoldSummary>,
    /// Where the valve's flows stood for meters: what it and they are worth. Its leakages are means since the leaks changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub valve: Option<ValveSummary>,
    /// What to make of it.
    pub verdict: Verdict,
    /// The mistake of wiring that explains the trace, if any does; `check` tells it by itself.
    #[serde(skip)]
    pub wiring: Option<Wiring>,
    /// How fast each leak changes; none where the data don't tell.
    pub trend: PerLeak<Option<LeakTrend>>,
    /// Every leak that the trace showed, in the order of time.
    pub episodes: Vec<Episode>,
    /// The episodes in short: those of a leak that follow one another closely are told as one.
    pub spells: Vec<Spell>,
    /// When the leak last changed, s: the estimates then began anew.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changed_at_s: Option<f64>,
    /// In the order of time.
    pub alarms: Vec<Alarm>,
    /// Only where the trace has reference leak flows; none for a leak without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<PerLeak<Option<LeakScore>>>,
}

impl ReplayReport {
    /// Name and version of the JSON form.
    pub const SCHEMA: &'static str = "pitchleak.replay/1";

    /// One line of JSON.
    ///
    /// # Errors
    /// None in practice: every field has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string(self)
    }
}

/// What was read of a trace.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TraceSummary {
    /// As the user named it.
    pub path: String,
    /// Good rows.
    pub samples: u64,
    /// Bad rows.
    pub skipped: u64,
    /// The clock of its time stamps, where it has any: what it shows where the trace's seconds begin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub begins: Option<Clock>,
    /// From the first to the last good row, s.
    pub duration_s: f64,
    /// Samples per second where they come regularly; none for a single row.
    pub sample_rate_hz: Option<f64>,
    /// The same of the channel that is read most seldom.
    #[serde(skip)]
    pub slowest_hz: Option<f64>,
    /// Whether most bad rows go back in time.
    #[serde(skip)]
    pub is_out_of_order: bool,
    /// Pauses much longer than the usual step.
    pub gaps: u64,
    /// How the file was read, where it is not as this program writes one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reading: Option<String>,
    /// What a reader of the results should know of the data, a line each.
    pub warnings: Vec<String>,
}

impl TraceSummary {
    /// The summary of a trace that has been read to its end.
    pub fn new(path: &str, quality: &TraceQuality) -> Self {
        Self {
            path: path.to_owned(),
            samples: quality.rows,
            skipped: quality.skipped,
            begins: None,
            duration_s: quality.duration_s,
            sample_rate_hz: quality.sample_rate_hz(),
            slowest_hz: quality.slowest_hz(),
            is_out_of_order: quality.is_out_of_order(),
            gaps: quality.gaps,
            reading: quality.reading.clone(),
            warnings: quality.warnings(),
        }
    }

    /// A time of the trace for people: in seconds with so many decimals where the trace is shorter than ten minutes, else what
    /// its clock shows, or how long after the start.
    pub fn time(&self, t_s: f64, decimals: usize) -> String {
        match &self.begins {
            _ if !self.is_long() => format!("{t_s:.decimals$} s"),
            Some(clock) => clock.text(t_s, self.duration_s),
            None => after_start(t_s, self.duration_s),
        }
    }

    /// Whether seconds are no unit for its times.
    pub fn is_long(&self) -> bool {
        self.duration_s >= LONG_S
    }
}

/// From here on seconds are no unit for people, s.
const LONG_S: f64 = 600.0;

/// `8 h 14 min`, or `14 min 20 s` of a trace shorter than an hour.
fn after_start(t_s: f64, duration_s: f64) -> String {
    let whole = t_s.round();
    let (minutes, seconds) = ((whole / 60.0).floor(), whole.rem_euclid(60.0));
    if duration_s < 3600.0 {
        return format!("{minutes:.0} min {seconds:02.0} s");
    }
    let minutes = (t_s / 60.0).round();
    format!("{:.0} h {:02.0} min", (minutes / 60.0).floor(), minutes.rem_euclid(60.0))
}

/// The parameters of eq. (1).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimates {
    /// C_ip.
    pub internal_leak_coefficient: EstimateEntry,
    /// C_epA.
    pub external_leak_a_coefficient: EstimateEntry,
    /// C_epB.
    pub external_leak_b_coefficient: EstimateEntry,
    /// β.
    pub bulk_modulus: EstimateEntry,
}

impl Estimates {
    /// The coefficients by leak.
    pub fn leaks(&self) -> PerLeak<&EstimateEntry> {
        PerLeak {
            internal: &self.internal_leak_coefficient,
            external_a: &self.external_leak_a_coefficient,
            external_b: &self.external_leak_b_coefficient,
        }
    }
}

/// One parameter's estimate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EstimateEntry {
    /// Best value, in `unit`.
    pub value: f64,
    /// Standard deviation of its error; none where the estimator gives none.
    pub std: Option<f64>,
    /// The interval that holds the true value with 95 % probability.
    pub ci95: Option<[f64; 2]>,
    /// SI.
    pub unit: &'static str,
    /// Whether this trace pins the parameter down.
    pub identifiable: bool,
    /// Why it does not, in a few words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl EstimateEntry {
    /// Unit of the leak coefficients.
    pub const COEFFICIENT_UNIT: &'static str = "m3/(s*Pa)";
    /// Unit of the bulk modulus.
    pub const BULK_MODULUS_UNIT: &'static str = "Pa";

    /// An identified estimate with its interval.
    pub fn new(estimate: Estimate<f64>, unit: &'static str) -> Self {
        let Estimate { value, std } = estimate;
        Self { value, std: Some(std), ci95: Some(estimate.ci95()), unit, identifiable: true, reason: None }
    }

    /// A bare value of an estimator that does not know how good it is.
    pub fn without_spread(value: f64, unit: &'static str) -> Self {
        Self { value, std: None, ci95: None, unit, identifiable: true, reason: None }
    }

    /// The same, which this trace does not pin down for `reason`.
    #[must_use]
    pub fn not_identifiable(self, reason: impl Into<String>) -> Self {
        Self { identifiable: false, reason: Some(reason.into()), ..self }
    }
}

/// Mean flow of one leak.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Leakage {
    /// Mean size of the flow, whichever way the pressure drives it, L/min.
    pub mean_lpm: f64,
    /// Mean flow with its sign, positive out of chamber A (external B: out of chamber B), L/min.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub net_mean_lpm: Option<f64>,
    /// Standard deviation of its error, L/min; none where the estimator gives none.
    pub std_lpm: Option<f64>,
    /// The flow is what leaks more than on this day, when the valve was calibrated; none where it is absolute.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub since: Option<Date>,
}

impl Leakage {
    /// From a flow in m³/s.
    pub fn new(flow_m3s: Estimate<f64>) -> Self {
        let lpm = flow_m3s.scaled(LPM_PER_M3S);
        Self { mean_lpm: lpm.value, net_mean_lpm: None, std_lpm: Some(lpm.std), since: None }
    }

    /// The interval that holds the mean with 95 % probability, L/min; without length where nothing is known of its error.
    pub fn ci95(&self) -> [f64; 2] {
        let value = self.mean_lpm;
        self.std_lpm.map_or([value; 2], |std| Estimate { value, std }.ci95())
    }
}

/// Offsets of the flow meters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FlowMeterOffsets {
    /// Meter A.
    pub a: FlowMeterOffset,
    /// Meter B.
    pub b: FlowMeterOffset,
}

/// What a flow meter reads beside the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FlowMeterOffset {
    /// Reading minus truth, L/min.
    #[serde(rename = "mean_lpm")]
    pub offset_lpm: f64,
    /// Standard deviation of its error, L/min.
    pub std_lpm: f64,
}

impl FlowMeterOffsets {
    /// From offsets in m³/s.
    pub fn new(offsets_m3s: [Estimate<f64>; 2]) -> Self {
        let [a, b] = offsets_m3s.map(|offset| {
            let Estimate { value, std } = offset.scaled(LPM_PER_M3S);
            FlowMeterOffset { offset_lpm: value, std_lpm: std }
        });
        Self { a, b }
    }
}

/// An alarm raised or cleared.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Alarm {
    /// Time in the trace, s.
    pub time_s: f64,
    /// Which leak.
    pub fault: Leak,
    /// What happened.
    pub state: AlarmState,
}

#[cfg(test)]
mod tests;
