//! From a finished replay to its report.

use super::Replay;
use super::correction::Correction;
use super::draft::{Draft, Weighed};
use super::effect_uncertainty::added_std;
use super::known::is_known;
use crate::channels::{ChannelFault, ChannelMonitor};
use crate::explain::Decision;
use crate::report::{EstimateEntry, Estimates, LeakTrend, Leakage, ReplayReport, TraceSummary};
use crate::rig::EstimatorKind;
use crate::signal::Signal;
use crate::units::LPM_PER_M3S;
use crate::wiring::Wiring;
use pitchleak_core::{Estimate, Excitation, ExcitationReport, Parameter, PerLeak};

/// Why an estimate says nothing that is no finite number.
const NO_NUMBER: &str = "the readings lead to no finite number";

impl Replay {
    /// The report on the trace so far.
    pub fn report(&self, trace: TraceSummary) -> ReplayReport {
        self.report_with(trace, &self.whole_trace(), self.decision().as_ref(), None)
    }

    /// The report with a verdict held against `weighed`, as `decision` has it; `wiring` is the mistake that explains the
    /// trace, if any does.
    pub(super) fn report_with(
        &self,
        trace: TraceSummary,
        weighed: &Weighed,
        decision: Option<&Decision>,
        wiring: Option<Wiring>,
    ) -> ReplayReport {
        let draft = Draft::new(self, weighed, decision, trace);
        let verdict = draft.verdict(wiring.as_ref());
        ReplayReport { wiring, ..draft.report(verdict) }
    }

    /// How the leak flows change at the pressures of [`leakage`](Self::leakage).
    pub(super) fn trend(
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
    pub(super) fn channel_faults(&self, channels: &ChannelMonitor) -> Vec<ChannelFault> {
        let reads_force = self.rig.estimator.kind == EstimatorKind::Paper;
        let mut faults = channels.faults(&self.rig);
        faults.retain(|fault| reads_force || fault.channel != Signal::Force);
        faults
    }

    /// Flows since they changed last, as the posterior has them, or else as the estimator has; the internal one at the mean size
    /// of P_L, whatever its sign. With those of the rig file's effects.
    pub(super) fn leakage(&self, knows_spread: bool, decision: Option<&Decision>) -> PerLeak<Leakage> {
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
        let shares = self.pressures.sizes().sizes_pa.zip(self.pressures.net().sizes_pa);
        let own = self.correction.as_ref().map_or_else(PerLeak::default, Correction::mean_leaks_m3s);
        decision.leakage.zip(shares).zip(own).map(|((belief, (size_pa, net_pa)), own_m3s)| {
            let mean_lpm = belief.mean_lpm + own_m3s * LPM_PER_M3S;
            let net_share = if size_pa > 0.0 { net_pa / size_pa } else { 1.0 };
            Leakage {
                mean_lpm,
                net_mean_lpm: Some(net_share * mean_lpm),
                std_lpm: Some(belief.std_lpm),
                since: None,
            }
        })
    }

    pub(super) fn estimates(
        &self,
        excitation: Option<ExcitationReport<f64>>,
        decision: Option<&Decision>,
    ) -> Estimates {
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
        let entries = coefficients.zip(per_leak).map(|(coefficient, excitation)| {
            let unit = EstimateEntry::COEFFICIENT_UNIT;
            match excitation {
                _ if !is_known(&coefficient) => {
                    EstimateEntry::without_spread(coefficient.value, unit).not_identifiable(NO_NUMBER)
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
}

impl Replay {
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
