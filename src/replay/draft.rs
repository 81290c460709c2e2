//! A report in the making: its figures once, its verdict as soon as it is known what speaks against them.

use super::Replay;
use crate::channels::{ChannelFault, ChannelFaultKind};
use crate::explain::Decision;
use crate::report::{
    Episode, Estimates, Findings, FlowMeterOffsets, LeakTrend, Leakage, ReplayReport, Spell, TraceSummary,
    Verdict,
};
use crate::rig::{ColumnMap, Rig};
use crate::units::LPM_PER_M3S;
use crate::wiring::Wiring;
use pitchleak_core::PerLeak;

/// What a verdict is held against.
pub(super) struct Weighed {
    /// Faults of channels that count, and earlier ones that are only told.
    pub channels: Vec<ChannelFault>,
    earlier_channels: Vec<ChannelFault>,
}

impl Weighed {
    /// The mistake that `decision` is sure of, of a trace whose columns were read by `columns`. No wiring explains what a
    /// broken channel reads.
    pub fn wiring(&self, decision: Option<&Decision>, columns: &ColumnMap, rig: &Rig) -> Option<Wiring> {
        let is_broken = self.channels.iter().any(|fault| fault.kind != ChannelFaultKind::Coarse);
        Wiring::of(decision?, columns, rig).filter(|_| !is_broken)
    }
}

impl Replay {
    /// A file's verdict: all that was read.
    pub(super) fn whole_trace(&self) -> Weighed {
        Weighed { channels: self.channel_faults(&self.channels), earlier_channels: Vec::new() }
    }

    /// A stream's: its last stretch. It may run for months, and what once misfitted is mended or forgotten.
    pub(super) fn last_stretch(&self) -> Weighed {
        let channels = self.channel_faults(&self.channels.lately());
        let mut earlier_channels = self.channel_faults(&self.channels);
        earlier_channels.retain(|one| channels.iter().all(|fault| fault.channel != one.channel));
        Weighed { channels, earlier_channels }
    }
}

/// All of a report but its verdict.
pub(super) struct Draft<'a> {
    replay: &'a Replay,
    weighed: &'a Weighed,
    decision: Option<&'a Decision>,
    trace: TraceSummary,
    found: Option<pitchleak_core::Estimates<f64>>,
    estimates: Estimates,
    leakage: PerLeak<Leakage>,
    threshold_lpm: PerLeak<f64>,
    trend: PerLeak<Option<LeakTrend>>,
    changed_at_s: Option<f64>,
    episodes: Vec<Episode>,
}

impl<'a> Draft<'a> {
    pub fn new(
        replay: &'a Replay,
        weighed: &'a Weighed,
        decision: Option<&'a Decision>,
        mut trace: TraceSummary,
    ) -> Self {
        trace.warnings.extend(replay.spikes.warning());
        let found = replay.estimator.estimates();
        let excitation = found.as_ref().map(|found| found.excitation);
        let leakage = replay.leakage(excitation.is_some(), decision);
        let threshold_lpm = replay.rig.alarms.threshold_m3s.map(|flow| flow * LPM_PER_M3S);
        Self {
            estimates: replay.estimates(excitation, decision),
            trend: replay.trend(found.as_ref(), &leakage, &threshold_lpm),
            changed_at_s: match decision {
                Some(decision) => decision.changed_ago_s.map(|ago_s| replay.end_s - ago_s),
                None => replay.changed_at_s,
            },
            episodes: replay.episodes.list(),
            replay,
            weighed,
            decision,
            trace,
            found,
            leakage,
            threshold_lpm,
        }
    }

    pub fn verdict(&self, wiring: Option<&Wiring>) -> Verdict {
        let Replay { detector, consistency, end_s, .. } = self.replay;
        Verdict::of(&Findings {
            active: detector.active(),
            leakage: &self.leakage,
            estimates: &self.estimates,
            trends: &self.trend,
            episodes: &self.episodes,
            threshold_lpm: self.threshold_lpm,
            trace: &self.trace,
            assumed: self.replay.rig.assumed,
            alpha: self.replay.rig.decision.alpha,
            end_s: *end_s,
            knows_noise: self.replay.knows_noise(),
            restarts_in_all: consistency.restarts(),
            changed_at_s: self.changed_at_s,
            channels: &self.weighed.channels,
            earlier_channels: &self.weighed.earlier_channels,
            wiring,
            decision: self.decision,
        })
    }

    pub fn report(self, verdict: Verdict) -> ReplayReport {
        let replay = self.replay;
        let ratios = self.found.as_ref().map(|_| replay.consistency.ratios());
        ReplayReport {
            schema: ReplayReport::SCHEMA,
            rig: replay.rig.name.clone(),
            hold: None,
            valve: None,
            estimator: replay.rig.estimator.kind,
            verdict,
            wiring: None,
            trend: self.trend,
            spells: Spell::of(&self.episodes, self.trace.duration_s, replay.end_s),
            episodes: self.episodes,
            trace: self.trace,
            estimates: self.estimates,
            leakage: self.leakage,
            flow_meter_offsets: self
                .found
                .and_then(|found| found.flow_offsets_m3s)
                .filter(|offsets| offsets.iter().all(|one| one.value.is_finite() && one.std.is_finite()))
                .map(FlowMeterOffsets::new),
            normalised_innovation: ratios,
            changed_at_s: self.changed_at_s,
            alarms: replay.alarms.clone(),
            score: replay.scoring.scores(),
        }
    }
}
