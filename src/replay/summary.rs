//! From a finished replay to its report.

use super::Replay;
use super::correction::{Correction, added_std};
use super::estimator::is_known;
use crate::channels::{ChannelFault, ChannelFaultKind, ChannelMonitor};
use crate::explain::Decision;
use crate::report::{
    EstimateEntry, Estimates, Findings, FlowMeterOffsets, LeakTrend, Leakage, ReplayReport, Spell,
    TraceSummary, Verdict,
};
use crate::rig::{ColumnMap, EstimatorKind, Rig};
use crate::signal::Signal;
use crate::units::LPM_PER_M3S;
use crate::wiring::Wiring;
use pitchleak_core::{Estimate, Excitation, ExcitationReport, Parameter, PerLeak};

/// Why an estimate says nothing that is no finite number.
const NO_NUMBER: &str = "the readings lead to no finite number";

/// Faults of the channels that a verdict is held against, and earlier ones that are only told.
pub(super) struct Weighed {
    channels: Vec<ChannelFault>,
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

    /// The report on the trace so far.
    pub fn report(&self, trace: TraceSummary) -> ReplayReport {
        self.report_with(trace, self.whole_trace(), self.decision().as_ref(), None)
    }

    /// The report with a verdict held against `weighed`, as `decision` has it; `wiring` is the mistake that explains the
    /// trace, if any does.
    pub(super) fn report_with(
        &self,
        trace: TraceSummary,
        weighed: Weighed,
        decision: Option<&Decision>,
        wiring: Option<Wiring>,
    ) -> ReplayReport {
        let found = self.estimator.estimates();
        let excitation = found.as_ref().map(|found| found.excitation);
        let findings = self.findings(found.as_ref(), trace, weighed, decision, wiring);
        let verdict = Verdict::of(&findings);
        let Findings { trace, episodes, leakage, trends: trend, changed_at_s, wiring, .. } = findings;
        let is_finite = |offset: &Estimate<f64>| offset.value.is_finite() && offset.std.is_finite();
        let offsets_m3s = found.as_ref().and_then(|found| found.flow_offsets_m3s);
        ReplayReport {
            schema: ReplayReport::SCHEMA,
            rig: self.rig.name.clone(),
            hold: None,
            valve: None,
            estimator: self.rig.estimator.kind,
            verdict,
            wiring,
            trend,
            spells: Spell::of(&episodes, trace.duration_s, self.end_s),
            episodes,
            trace,
            estimates: self.estimates(excitation, decision),
            leakage,
            flow_meter_offsets: offsets_m3s
                .filter(|offsets| offsets.iter().all(is_finite))
                .map(FlowMeterOffsets::new),
            normalised_innovation: found.map(|_| self.consistency.ratios()),
            changed_at_s,
            alarms: self.alarms.clone(),
            score: self.scoring.scores(),
        }
    }

    /// What the verdict rests on.
    fn findings<'a>(
        &self,
        found: Option<&pitchleak_core::Estimates<f64>>,
        mut trace: TraceSummary,
        weighed: Weighed,
        decision: Option<&'a Decision>,
        wiring: Option<Wiring>,
    ) -> Findings<'a> {
        trace.warnings.extend(self.spikes.warning());
        let leakage = self.leakage(found.is_some(), decision);
        let threshold_lpm = self.rig.alarms.threshold_m3s.map(|flow| flow * LPM_PER_M3S);
        let changed_at_s = match decision {
            Some(decision) => decision.changed_ago_s.map(|ago_s| self.end_s - ago_s),
            None => self.changed_at_s,
        };
        let mut episodes = self.episodes.list(&self.standing());
        // A leak that comes and goes is gone when the posterior has it so, not when its alarm is cleared.
        for open in episodes.iter_mut().filter(|one| one.to_s.is_none()) {
            let is_away = decision.is_some_and(|decision| decision.is_away(open.fault));
            open.to_s = changed_at_s.filter(|at_s| is_away && *at_s > open.from_s);
        }
        Findings {
            active: self.standing(),
            trends: self.trend(found, &leakage, &threshold_lpm),
            leakage,
            episodes,
            threshold_lpm,
            trace,
            assumed: self.rig.assumed,
            alpha: self.rig.decision.alpha,
            end_s: self.end_s,
            knows_noise: self.knows_noise(),
            restarts_in_all: self.consistency.restarts(),
            changed_at_s,
            channels: weighed.channels,
            earlier_channels: weighed.earlier_channels,
            wiring,
            decision,
        }
    }

    /// How the leak flows change at the pressures of [`leakage`](Self::leakage).
    fn trend(
        &self,
        found: Option<&pitchleak_core::Estimates<f64>>,
        leakage: &PerLeak<Leakage>,
        threshold_lpm: &PerLeak<f64>,
    ) -> PerLeak<Option<LeakTrend>> {
        let pressures = self.pressures.sizes().sizes_pa;
        let thinning = self.oil.thinning_ps();
        PerLeak::from_fn(|leak| {
            let found = found.filter(|found| found.excitation.leaks[leak].identifiable)?;
            let Leakage { mean_lpm, std_lpm, .. } = leakage[leak];
            let slope = found.leak_slopes_m3spa_ps[leak].scaled(pressures[leak] * LPM_PER_M3S);
            let flow = Estimate { value: mean_lpm, std: std_lpm? };
            let trend = LeakTrend::new(flow, slope, threshold_lpm[leak])?;
            Some(thinning.map_or(trend, |thinning| trend.apart(flow, thinning)))
        })
    }

    /// Faults of the channels that are read: of the estimators only the paper's law reads the force.
    fn channel_faults(&self, channels: &ChannelMonitor) -> Vec<ChannelFault> {
        let reads_force = self.rig.estimator.kind == EstimatorKind::Paper;
        let mut faults = channels.faults(&self.rig);
        faults.retain(|fault| reads_force || fault.channel != Signal::Force);
        faults
    }

    /// Flows since they changed last, as the posterior has them, or else as the estimator has; the internal one at the mean size
    /// of P_L, whatever its sign. With those of the rig file's effects.
    fn leakage(&self, knows_spread: bool, decision: Option<&Decision>) -> PerLeak<Leakage> {
        let sizes = self.leak_flows_m3s(&self.pressures.sizes());
        let net = self.leak_flows_m3s(&self.pressures.net());
        let flows = sizes.zip(net);
        let Some(decision) = decision else {
            return flows.map(|(size, net)| {
                let leakage = Leakage::new(size);
                Leakage {
                    net_mean_lpm: Some(net.value * LPM_PER_M3S),
                    std_lpm: leakage.std_lpm.filter(|_| knows_spread && is_known(&size)),
                    ..leakage
                }
            });
        };
        let pressures = &self.all_pressures;
        let shares = pressures.sizes().sizes_pa.zip(pressures.net().sizes_pa);
        let shares = shares.map(|(size_pa, net_pa)| if size_pa > 0.0 { net_pa / size_pa } else { 1.0 });
        let own = self.correction.as_ref().map_or_else(PerLeak::default, Correction::mean_leaks_m3s);
        decision.leakage.zip(shares).zip(own).map(|((belief, net_share), own_m3s)| {
            let mean_lpm = belief.mean_lpm + own_m3s * LPM_PER_M3S;
            Leakage {
                mean_lpm,
                net_mean_lpm: Some(net_share * mean_lpm),
                std_lpm: Some(belief.std_lpm),
                since: None,
            }
        })
    }

    fn estimates(&self, excitation: Option<ExcitationReport<f64>>, decision: Option<&Decision>) -> Estimates {
        let per_leak = excitation.map_or(PerLeak::default(), |report| report.leaks.map(Some));
        let (coefficients, certain) = (self.leak_coefficients(), self.estimator.leak_coefficients());
        let coefficients = PerLeak::from_fn(|leak| match decision {
            Some(decision) if decision.pressures_pa[leak] > 0.0 => {
                let per_pa = 1.0 / (LPM_PER_M3S * decision.pressures_pa[leak]);
                let found = decision.leakage[leak].estimate_lpm().scaled(per_pa);
                // Effects of the rig file part a flow between its laws: its sum is known better than they are.
                let doubt = added_std(coefficients[leak], certain[leak]);
                Estimate { std: found.std.hypot(doubt), ..found }
            }
            _ => coefficients[leak],
        });
        let entries = PerLeak::from_fn(|leak| {
            let (coefficient, unit) = (coefficients[leak], EstimateEntry::COEFFICIENT_UNIT);
            match per_leak[leak] {
                _ if !is_known(&coefficient) => {
                    EstimateEntry::without_spread(coefficient.value, unit).not_identifiable(NO_NUMBER)
                }
                // What is named or ruled out is told, whatever the estimator alone makes of it.
                Some(_) if decision.is_some_and(|decision| decision.tells(leak)) => {
                    EstimateEntry::new(coefficient, unit)
                }
                None => EstimateEntry::without_spread(coefficient.value, unit),
                Some(excitation) => judged(EstimateEntry::new(coefficient, unit), &excitation),
            }
        });
        Estimates {
            internal_leak_coefficient: entries.internal,
            external_leak_a_coefficient: entries.external_a,
            external_leak_b_coefficient: entries.external_b,
            bulk_modulus: self.bulk_modulus(excitation.map(|report| report.bulk_modulus)),
        }
    }

    fn bulk_modulus(&self, excitation: Option<Excitation<f64>>) -> EstimateEntry {
        let found = self.estimator.bulk_modulus();
        let unit = EstimateEntry::BULK_MODULUS_UNIT;
        if !found.value.is_finite() {
            return EstimateEntry::without_spread(self.rig.fluid.bulk_modulus_pa, unit)
                .not_identifiable(NO_NUMBER);
        }
        let bare = EstimateEntry::without_spread(found.value, unit);
        let entry = match found.spread {
            None => bare,
            Some((std, ci95)) => EstimateEntry { std: Some(std), ci95: Some(ci95), ..bare },
        };
        if let Some(reason) = self.contradiction(found.value) {
            return entry.not_identifiable(reason);
        }
        excitation.map_or(entry.clone(), |excitation| judged(entry, &excitation))
    }

    /// Says so where the trace asks for a bulk modulus that the rig file rules out, by three of its standard
    /// deviations: then something else in the chambers gives way.
    fn contradiction(&self, bulk_modulus_pa: f64) -> Option<String> {
        let declared = &self.rig.fluid;
        let relative = declared.bulk_modulus_std_pa / declared.bulk_modulus_pa;
        let deviation = (declared.bulk_modulus_pa / bulk_modulus_pa - 1.0) / relative;
        (deviation.abs() > 3.0).then(|| {
            format!(
                "the trace contradicts the rig file's {:.2} ± {:.2} GPa",
                declared.bulk_modulus_pa / 1e9,
                declared.bulk_modulus_std_pa / 1e9
            )
        })
    }
}

/// The entry, marked where the trace does not identify the parameter.
fn judged(entry: EstimateEntry, excitation: &Excitation<f64>) -> EstimateEntry {
    if excitation.identifiable {
        return entry;
    }
    entry.not_identifiable(match excitation.traded_with {
        Some(other) => format!("trades off with {}", label(other)),
        None if excitation.variance_reduction < 0.5 => {
            "this trace says little beyond the rig file".to_owned()
        }
        None => "too little excitation".to_owned(),
    })
}

fn label(parameter: Parameter) -> &'static str {
    match parameter {
        Parameter::Compressibility => "the bulk modulus",
        Parameter::Internal => "the internal leak",
        Parameter::ExternalA => "the external leak A",
        Parameter::ExternalB => "the external leak B",
        Parameter::OffsetA => "the offset of flow meter A",
        Parameter::OffsetB => "the offset of flow meter B",
        Parameter::GainA => "the gain of flow meter A",
        Parameter::GainB => "the gain of flow meter B",
        Parameter::GainPosition => "the gain of the position sensor",
    }
}
