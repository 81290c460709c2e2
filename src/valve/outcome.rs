//! What the valve's flows say of a trace.

use super::calibration::{LeaksThen, Since};
use super::meter::{Taken, ValveMeter};
use super::parts::Summary;
use super::unknowns::{Belief, KAPPA, LEAK_STD, LEAK_UNIT_M3SPA, clearance_std};
use crate::presence::{self, Found, FoundLeak, LeakLikelihood, Place};
use crate::report::{LeakTrend, ReplayReport, TraceSummary};
use crate::rig::Rig;
use crate::signal::Signal;
use crate::units::LPM_PER_M3S;
use nalgebra::{Matrix3, Vector3};
use pitchleak_core::{Estimate, Leak, PerLeak};
use serde::Serialize;

/// Below this share of the rated flow, at 50 bar, an internal leak is within what valves differ from any model of them: some effects that
/// nobody declared look like it, and no residual tells (docs/valve.md).
const INTERNAL_FLOOR: f64 = 0.00125;
const FLOOR_PA: f64 = 50e5;

/// In a stream nothing is said before so many parts with the same leaks: of fewer, none tells whether noise explains them (chosen by
/// hysteresis and drift that set in).
const LEAST_PARTS: usize = 6;

/// What the valve's flows and the trace are worth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ValveSummary {
    /// Time since the leaks changed, s.
    pub usable_s: f64,
    /// Least and greatest position of the spool, shares of its stroke.
    pub spool_range: [f64; 2],
    /// What the clearances A–T and B–T may leak by the data sheet, 1 σ, L/min: external leaks look the same.
    pub clearance_lpm: [f64; 2],
    /// What the readings scatter, in the declared noise's standard deviations.
    pub scatter: f64,
    /// So long a chamber was below the atmosphere, and part of it void, s: left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub void_s: Option<f64>,
    /// The chamber pressure that is not measured, `pa` or `pb`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unread: Option<&'static str>,
    /// The calibration that it rests on; none where the data sheet does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<Since>,
    /// Each leak; none where the trace does not tell of leaks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaks: Option<PerLeak<FoundLeak>>,
}

/// What was found by the valve's flows.
#[derive(Clone, Debug)]
pub struct ValveTest {
    pub(super) summary: ValveSummary,
    pub(super) found: Option<Found>,
    pub(super) taken: Option<Taken>,
    /// The leak at a chamber whose pressure is not measured.
    untold: Option<Leak>,
}

impl ValveMeter {
    /// What the readings so far say of a rig; none where there was none of the valve.
    pub fn finish(&mut self, rig: &Rig) -> Option<ValveTest> {
        self.spool_range()?;
        let taken = self.taken();
        self.test(taken, rig)
    }

    /// What the windows that have ended say of a rig; none where there was nothing of the valve.
    pub(super) fn so_far(&self, rig: &Rig) -> Option<ValveTest> {
        let is_telling = |taken: &&Taken| taken.summary.parts >= LEAST_PARTS || !taken.is_explained();
        self.test(self.last.as_ref().filter(is_telling).cloned(), rig)
    }

    fn test(&self, taken: Option<Taken>, rig: &Rig) -> Option<ValveTest> {
        let spool_range = self.spool_range()?;
        let fit = taken.as_ref().map(|taken| &taken.summary);
        let untold = self.untold();
        let told = taken.as_ref().filter(|taken| self.can_tell(taken));
        let worn = |taken: &Taken| taken.summary.belief.with_worn_clearances(&self.sheet);
        let is_by_sheet = self.since.is_none();
        let found = told
            .and_then(|taken| found(&taken.summary, untold, rig, is_by_sheet.then(|| worn(taken)).flatten()));
        let pressures_pa = fit.map(|fit| fit.pressures.sizes_pa()).unwrap_or_default();
        let clearance =
            |pressure_pa: f64| clearance_std(&self.sheet) * LEAK_UNIT_M3SPA * pressure_pa * LPM_PER_M3S;
        let summary = ValveSummary {
            usable_s: fit.map_or(0.0, |fit| fit.pressures.time_s),
            spool_range,
            clearance_lpm: [clearance(pressures_pa.external_a), clearance(pressures_pa.external_b)],
            scatter: fit.map_or(1.0, |fit| fit.noise.sqrt()),
            void_s: Some(self.void_s).filter(|void_s| *void_s > 0.0),
            unread: self.unread().map(Signal::name),
            calibrated: self.since,
            leaks: found.as_ref().map(Found::leaks),
        };
        Some(ValveTest { summary, found, taken, untold })
    }
}

/// Means and covariances of the leaks, widened by what noise does not explain; of one that is untold they say nothing.
fn leaks(fit: &Summary, belief: &Belief, untold: Option<Leak>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let (mean, covariance) = belief.leaks()?;
    let wider = fit.course.map(|course| course.max(fit.noise).max(1.0).sqrt());
    let mut covariance = Matrix3::from_fn(|i, j| covariance[(i, j)] * wider[i] * wider[j]);
    if let Some(leak) = untold {
        covariance[(leak as usize, leak as usize)] += LEAK_STD * LEAK_STD;
    }
    Some((mean, covariance))
}

/// Which leaks there are. External ones are told against clearances as the data sheet has them, and the words say so; an internal one rests
/// on no data sheet, and counts where it is there beside a valve that has worn as well.
fn found(fit: &Summary, untold: Option<Leak>, rig: &Rig, worn: Option<Belief>) -> Option<Found> {
    let covariance = fit.belief.covariance()?;
    let kappa = fit.belief.mean[KAPPA];
    let by = |belief: &Belief| {
        let (leaks, spread) = leaks(fit, belief, untold)?;
        let likelihood = LeakLikelihood { information: spread.cholesky()?.inverse(), leaks, squares: 0.0 };
        Some(Found::new(&[Place { kappa, ln_prior: 0.0, likelihood }], &fit.pressures, rig))
    };
    let mut found = by(&fit.belief)?;
    if let Some(worn) = worn {
        found.beliefs.leaks.internal = by(&worn)?.beliefs.leaks.internal;
    }
    let rated_m3s = rig.valve.as_ref().map_or(0.0, |sheet| sheet.rated_flow_m3s);
    let floor_m3spa = PerLeak { internal: INTERNAL_FLOOR * rated_m3s / FLOOR_PA, ..PerLeak::default() };
    Some(found.with_oil(kappa, covariance[(KAPPA, KAPPA)].sqrt(), floor_m3spa))
}

impl ValveTest {
    /// What the valve's flows and the trace are worth.
    pub fn summary(&self) -> &ValveSummary {
        &self.summary
    }

    /// Whether a valve as declared, its leaks and noise explain the readings.
    pub(super) fn is_explained(&self) -> bool {
        self.taken.as_ref().is_some_and(Taken::is_explained)
    }

    /// By how much a leak grows within the trace, L/min per s, where leaks go in straight lines.
    pub(super) fn growth_lpm_ps(&self, leak: Leak) -> Option<Estimate<f64>> {
        let fit = &self.taken.as_ref()?.summary;
        let unit_lpm = LEAK_UNIT_M3SPA * fit.pressures.sizes_pa()[leak] * LPM_PER_M3S;
        Some(fit.growth?[leak].scaled(unit_lpm))
    }

    /// Flows of the leaks, whatever their sign, m³/s; none where too little was read.
    pub(super) fn flows_m3s(&self) -> Option<PerLeak<Estimate<f64>>> {
        let fit = &self.taken.as_ref().filter(|taken| taken.is_settled)?.summary;
        let (mean, covariance) = leaks(fit, &fit.belief, self.untold)?;
        let at = |i: usize| Estimate { value: mean[i], std: covariance[(i, i)].sqrt() };
        let pressures_pa = fit.pressures.sizes_pa();
        Some(PerLeak::from_fn(|leak| at(leak as usize).scaled(LEAK_UNIT_M3SPA * pressures_pa[leak])))
    }

    /// The report on a trace without flow meters.
    pub fn report(&self, trace: TraceSummary, rig: &Rig) -> ReplayReport {
        let verdict = self.verdict(rig);
        let mut report = presence::report(trace, rig, self.found.as_ref(), verdict, None);
        let since = self.summary.calibrated.filter(|since| since.leaks == LeaksThen::Unknown);
        for leak in [Leak::ExternalA, Leak::ExternalB] {
            report.leakage[leak].since = since.map(|since| since.date);
        }
        let threshold_lpm = rig.alarms.threshold_m3s.map(|flow| flow * LPM_PER_M3S);
        for leak in report.verdict.faults.clone() {
            report.trend[leak] = self.growth_lpm_ps(leak).and_then(|slope| {
                let size = &report.leakage[leak];
                let flow = Estimate { value: size.mean_lpm, std: size.std_lpm? };
                LeakTrend::new(flow, slope, threshold_lpm[leak])
            });
        }
        let changed_at_s = self.taken.as_ref().and_then(|taken| taken.changed_at_s);
        ReplayReport { valve: Some(self.summary.clone()), changed_at_s, ..report }
    }
}
