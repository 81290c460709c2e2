//! What an operator acts on.

use super::reason::{Reason, contradictions, gaps};
use super::spell::comes_and_goes;
use super::{Episode, LeakTrend, Leakage, TraceSummary, statement};
use crate::channels::ChannelFault;
use crate::explain::{Decision, Explained};
use crate::rig::Assumed;
use crate::wiring::Wiring;
use pitchleak_core::{Leak, PerLeak};
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
    /// That each leak is above its threshold now; none where there is too little to weigh, or from the paper's law.
    pub probability: Option<PerLeak<f64>>,
    /// What explains the trace, best first, down to 1 %.
    pub explanations: Vec<Explained>,
}

/// All that a verdict rests on.
#[derive(Clone, Debug)]
pub struct Findings<'a> {
    /// Leaks whose alarm stands.
    pub active: PerLeak<bool>,
    /// Flows of the moment.
    pub leakage: PerLeak<Leakage>,
    /// How the leaks change.
    pub trends: PerLeak<Option<LeakTrend>>,
    /// When leaks showed.
    pub episodes: Vec<Episode>,
    /// Alarm thresholds, L/min.
    pub threshold_lpm: PerLeak<f64>,
    /// What was read.
    pub trace: TraceSummary,
    /// What of the rig nobody declared.
    pub assumed: Assumed,
    /// How sure a verdict has to be.
    pub alpha: f64,
    /// Time of the last row, s.
    pub end_s: f64,
    /// Whether the estimator knows how good its figures are.
    pub knows_noise: bool,
    /// How often the estimates began anew since the trace began, and when last.
    pub restarts_in_all: u64,
    /// See [`restarts_in_all`](Self::restarts_in_all).
    pub changed_at_s: Option<f64>,
    /// Faults of the channels that the estimator reads, …
    pub channels: Vec<ChannelFault>,
    /// … and those of before a stream's last stretch.
    pub earlier_channels: Vec<ChannelFault>,
    /// A mistake of wiring that explains the trace.
    pub wiring: Option<Wiring>,
    /// The posterior; none where there is too little to weigh.
    pub decision: Option<&'a Decision>,
}

impl Findings<'_> {
    /// The leaks to act on: those that the posterior is sure of, those that come and go, and, where nothing was weighed, those
    /// whose alarm stands.
    pub(super) fn faults(&self) -> Vec<Leak> {
        let is_fault = |leak: &Leak| {
            let now = match self.decision {
                Some(decision) if decision.status.is_sure() => decision.faults.contains(leak),
                _ => self.active[*leak],
            };
            let is_there = self.decision.is_none_or(|decision| decision.present[*leak] >= 1.0 - self.alpha);
            now || is_there && comes_and_goes(&self.episodes, *leak, self.end_s)
        };
        Leak::ALL.into_iter().filter(is_fault).collect()
    }

    /// Whether a leak's flow is known well enough to be quoted.
    pub(super) fn is_known(&self, leak: Leak) -> bool {
        self.leakage[leak].std_lpm.is_some_and(|std| std < QUOTED_SHARE * self.leakage[leak].mean_lpm)
    }

    /// Whether the data exclude that a leak is above its threshold.
    pub(super) fn is_below(&self, leak: Leak) -> bool {
        self.decision.is_some_and(|decision| decision.ruled_out.contains(&leak)) && !self.is_away(leak)
    }

    /// The other leaks than `faults`: those that are below their thresholds, and those of which the trace says too little.
    pub(super) fn below_and_open(&self, faults: &[Leak]) -> (Vec<Leak>, Vec<Leak>) {
        let others = Leak::ALL.into_iter().filter(|leak| !faults.contains(leak));
        others.partition(|leak| self.is_below(*leak))
    }

    /// Whether a leak comes and goes, as likely as not, and is away while its alarm stands.
    pub(super) fn is_away(&self, leak: Leak) -> bool {
        self.active[leak] && self.decision.is_some_and(|decision| decision.is_away(leak))
    }
}

/// A figure whose standard deviation is a larger share of it is none.
const QUOTED_SHARE: f64 = 0.5;

impl Verdict {
    /// Of this leak alone: who is sure of another is not sure of it.
    pub(crate) fn status_of(&self, leak: Leak) -> Status {
        if self.status.is_sure() && !self.faults.contains(&leak) { Status::NotSure } else { self.status }
    }

    /// The verdict on what was found.
    pub fn of(findings: &Findings<'_>) -> Self {
        let faults = findings.faults();
        let contradictions = contradictions(findings);
        let gaps = gaps(findings);
        let (status, reasons) = match findings.decision {
            _ if !contradictions.is_empty() => (Status::Doubtful, contradictions),
            _ if gaps.iter().any(|gap| gap.id.precedes_a_verdict()) => (Status::NotSure, gaps),
            Some(decision) if decision.status.is_sure() && !faults.is_empty() => (Status::Leak, Vec::new()),
            Some(decision) if decision.status == Status::Sound && gaps.is_empty() => (Status::Sound, gaps),
            _ => (Status::NotSure, gaps),
        };
        Self {
            status,
            text: statement::text(findings, status, &faults, &reasons),
            faults,
            reasons,
            probability: findings.decision.map(|decision| decision.probability),
            explanations: findings.decision.map(|decision| decision.explanations.clone()).unwrap_or_default(),
        }
    }
}
