//! A hold test as a replay's report.

use super::outcome::{Found, HoldTest};
use crate::report::{EstimateEntry, Estimates, Leakage, ReplayReport, TraceSummary};
use crate::rig::Rig;
use pitchleak_core::{Estimate, Leak, PerLeak};

/// Standard deviation of a coefficient of which the hold tells next to nothing, in those of what is believed before.
const UNKNOWN: f64 = 0.5;

impl HoldTest {
    /// The report on a trace that is a hold test.
    pub fn report(&self, trace: TraceSummary, rig: &Rig) -> ReplayReport {
        ReplayReport {
            schema: ReplayReport::SCHEMA,
            rig: rig.name.clone(),
            estimator: rig.estimator.kind,
            estimates: self.estimates(rig),
            leakage: PerLeak::from_fn(|leak| self.leakage(leak)),
            flow_meter_offsets: None,
            normalised_innovation: None,
            hold: Some(self.summary),
            verdict: self.verdict(rig),
            trend: PerLeak::default(),
            episodes: Vec::new(),
            spells: Vec::new(),
            changed_at_s: None,
            alarms: Vec::new(),
            score: None,
            trace,
        }
    }

    fn leakage(&self, leak: Leak) -> Leakage {
        let Some(found) = &self.found else {
            return Leakage { mean_lpm: 0.0, net_mean_lpm: None, std_lpm: None };
        };
        let (belief, pressure_pa) = (&found.beliefs.leaks[leak], found.fit.pressures_pa[leak]);
        let flow = Estimate { value: belief.mean * pressure_pa, std: belief.std * pressure_pa };
        let size = Leakage::new(flow);
        let against = leak == Leak::Internal && found.fit.load_pressure_pa < 0.0;
        let net_lpm = if against { -size.mean_lpm } else { size.mean_lpm };
        Leakage { net_mean_lpm: Some(net_lpm), ..size }
    }

    fn estimates(&self, rig: &Rig) -> Estimates {
        let unit = EstimateEntry::COEFFICIENT_UNIT;
        let nothing = |value, unit| {
            EstimateEntry::without_spread(value, unit).not_identifiable("the hold is too short")
        };
        let leaks = PerLeak::from_fn(|leak| {
            self.found.as_ref().map_or_else(|| nothing(0.0, unit), |found| found.coefficient(leak))
        });
        let oil = self.found.as_ref().map_or_else(
            || nothing(rig.fluid.bulk_modulus_pa, EstimateEntry::BULK_MODULUS_UNIT),
            |found| bulk_modulus(&found.beliefs.kappa_ppa, rig),
        );
        Estimates {
            internal_leak_coefficient: leaks.internal,
            external_leak_a_coefficient: leaks.external_a,
            external_leak_b_coefficient: leaks.external_b,
            bulk_modulus: oil,
        }
    }
}

impl Found {
    fn coefficient(&self, leak: Leak) -> EstimateEntry {
        let belief = &self.beliefs.leaks[leak];
        let estimate = Estimate { value: belief.mean, std: belief.std };
        let entry = EstimateEntry {
            ci95: Some(belief.interval),
            ..EstimateEntry::new(estimate, EstimateEntry::COEFFICIENT_UNIT)
        };
        if belief.std < UNKNOWN * super::presence::prior_std() {
            return entry;
        }
        entry.not_identifiable("this hold says little about it")
    }
}

/// β = 1/κ; the trace tells it where it halves what the rig file leaves open.
fn bulk_modulus(kappa_ppa: &Estimate<f64>, rig: &Rig) -> EstimateEntry {
    let Estimate { value, std } = *kappa_ppa;
    let [low, high] = kappa_ppa.ci95();
    let stiffest = if low > 0.0 { 1.0 / low } else { f64::INFINITY };
    let entry = EstimateEntry {
        ci95: Some([1.0 / high, stiffest]),
        ..EstimateEntry::new(
            Estimate { value: 1.0 / value, std: std / (value * value) },
            EstimateEntry::BULK_MODULUS_UNIT,
        )
    };
    let declared = rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa;
    if std * rig.fluid.bulk_modulus_pa < UNKNOWN * declared {
        return entry;
    }
    entry.not_identifiable("this trace says little beyond the rig file")
}
