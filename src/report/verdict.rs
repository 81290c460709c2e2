//! What an operator acts on.

use super::episode::comes_and_goes;
use super::reason::{Reason, contradictions, gaps};
use super::{Episode, Estimates, LeakTrend, Leakage, TraceSummary, statement};
use crate::channels::ChannelFault;
use crate::explain::{Decision, Explained};
use crate::wiring::{Orifice, Wiring, ZeroCheck};
use pitchleak_core::{Estimate, Fluid, Leak, PerLeak};
use serde::{Deserialize, Serialize};

/// The word that heads a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Oil leaks, and the data support that.
    Leak,
    /// Nothing leaks, and the data support that.
    Sound,
    /// Something contradicts the model or the sensors: the figures can't be trusted.
    Doubtful,
    /// The trace says too little.
    NotSure,
}

impl Status {
    /// As in data: `leak`, `sound`, `doubtful`, `not_sure`.
    pub fn id(self) -> &'static str {
        match self {
            Self::Leak => "leak",
            Self::Sound => "sound",
            Self::Doubtful => "doubtful",
            Self::NotSure => "not_sure",
        }
    }

    /// As at the head of a text.
    pub fn word(self) -> &'static str {
        match self {
            Self::Leak => "LEAK",
            Self::Sound => "SOUND",
            Self::Doubtful => "DOUBTFUL",
            Self::NotSure => "NOT SURE",
        }
    }

    /// Whether the report commits itself.
    pub fn is_sure(self) -> bool {
        matches!(self, Self::Leak | Self::Sound)
    }
}

/// What an operator acts on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// In a word.
    pub status: Status,
    /// The leaks whose alarm stands at the end of the trace, and those that come and go.
    pub faults: Vec<Leak>,
    /// In a sentence or two.
    pub text: String,
    /// Why the status is doubtful or not sure, and what to check, first things first; none where it is sure.
    pub reasons: Vec<Reason>,
    /// That each leak is above its threshold at the trace's end, as the posterior over explanations has it; none where it
    /// wasn't asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability: Option<PerLeak<f64>>,
    /// What explains the trace, best first, down to 1 %; likewise.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub explanations: Vec<Explained>,
}

/// How far model and declared noise are from explaining a trace, or the last stretch of a stream: means of ν²/S, about 1
/// where they do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misfit {
    /// Of the flow balance.
    pub balance: f64,
    /// Innovations in it.
    pub balances: u64,
    /// Of the flow balance in the worst quarter of a minute.
    pub worst_window: f64,
    /// Of the position equation.
    pub position: f64,
    /// Its largest mean over a minute or what there is.
    pub worst_position: f64,
    /// How often the estimates began anew.
    pub restarts: u64,
    /// Since when, s; −∞ over the whole trace.
    pub since_s: f64,
    /// Before that, the last ten minutes or so that they did not explain, s.
    pub unexplained_s: Option<[f64; 2]>,
}

/// All that a verdict rests on.
#[derive(Clone, Copy, Debug)]
pub struct Findings<'a> {
    /// Leaks whose alarm stands.
    pub active: PerLeak<bool>,
    /// Flows of the moment.
    pub leakage: &'a PerLeak<Leakage>,
    /// Parameters.
    pub estimates: &'a Estimates,
    /// How the leaks change.
    pub trends: &'a PerLeak<Option<LeakTrend>>,
    /// When leaks showed.
    pub episodes: &'a [Episode],
    /// Alarm thresholds, L/min.
    pub threshold_lpm: PerLeak<f64>,
    /// Full scale of the flow meters A and B, L/min.
    pub meters_lpm: [f64; 2],
    /// The oil as the rig file declares it.
    pub fluid: Fluid<f64>,
    /// What was read.
    pub trace: &'a TraceSummary,
    /// Time of the last row, s.
    pub end_s: f64,
    /// None from an estimator that knows no noise.
    pub misfit: Option<Misfit>,
    /// How often the estimates began anew since the trace began, and when last.
    pub restarts_in_all: u64,
    /// See [`restarts_in_all`](Self::restarts_in_all).
    pub changed_at_s: Option<f64>,
    /// Faults of the channels that the estimator reads, …
    pub channels: &'a [ChannelFault],
    /// … and those of before [`Misfit::since_s`].
    pub earlier_channels: &'a [ChannelFault],
    /// What else may explain the trace.
    pub suspicions: &'a Suspicions,
}

/// What else than leaks may explain a trace.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Suspicions {
    /// A mistake of wiring that does.
    pub wiring: Option<Wiring>,
    /// A sensor whose gain or zero is off that does.
    pub sensor: Option<Wiring>,
    /// The leaks held against zeros of the meters.
    pub zeros: Option<ZeroCheck>,
    /// Leaks through an orifice that explain what leaks as C P do not.
    pub orifice: Option<Orifice>,
}

impl Suspicions {
    /// Whether there is anything to weigh.
    pub fn any(&self) -> bool {
        self.wiring.is_some() || self.sensor.is_some() || self.zeros.is_some() || self.orifice.is_some()
    }
}

impl Findings<'_> {
    /// The leaks to act on.
    pub(super) fn faults(&self) -> Vec<Leak> {
        let is_fault = |leak: &Leak| self.active[*leak] || comes_and_goes(self.episodes, *leak, self.end_s);
        Leak::ALL.into_iter().filter(is_fault).collect()
    }

    /// Whether a leak's flow is known well enough to be quoted.
    pub(super) fn is_known(&self, leak: Leak) -> bool {
        self.estimates.leaks()[leak].identifiable
    }

    /// Whether the data exclude, with 95 %, that a leak is above its threshold.
    pub(super) fn is_below(&self, leak: Leak) -> bool {
        let Leakage { mean_lpm, std_lpm, .. } = self.leakage[leak];
        let most = |std| Estimate { value: mean_lpm, std }.ci95()[1];
        self.is_known(leak) && std_lpm.is_some_and(|std| most(std) < self.threshold_lpm[leak])
    }
}

impl Verdict {
    /// With what the posterior over explanations says beside it.
    pub fn with_explanations(&mut self, decision: Decision) {
        self.probability = Some(decision.probability);
        self.explanations = decision.explanations;
    }

    /// The verdict on what was found.
    pub fn of(findings: &Findings<'_>) -> Self {
        let faults = findings.faults();
        let contradictions = contradictions(findings);
        let gaps = gaps(findings);
        let (status, reasons) = if !contradictions.is_empty() {
            (Status::Doubtful, contradictions)
        } else if findings.misfit.is_none() {
            (Status::NotSure, gaps)
        } else if !faults.is_empty() {
            (Status::Leak, Vec::new())
        } else if gaps.is_empty() {
            (Status::Sound, Vec::new())
        } else {
            (Status::NotSure, gaps)
        };
        let text = statement::text(findings, status, &faults, &reasons);
        Self { status, text, faults, reasons, probability: None, explanations: Vec::new() }
    }
}
