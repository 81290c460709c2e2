//! Replay: a trace goes through the estimator and the leak detector, record by record, in constant memory.

mod conditions;
mod consistency;
mod correction;
mod episodes;
mod estimate_file;
mod estimator;
mod scoring;
mod spikes;
mod state;
mod stream;
mod summary;
mod weighing;

pub use estimate_file::{EstimateFile, EstimateFileError, EstimateRow};
pub use estimator::{BulkModulus, Estimator};
pub use state::RestoreError;
pub(crate) use state::every_number;
pub(crate) use stream::Fresh;
pub use stream::{Stream, Taken};

use crate::channels::ChannelMonitor;
use crate::explain::{Decision, Statistic, explain};
use crate::hold::{self, HoldTest, Recorder};
use crate::report::{Alarm, ReplayReport, TraceSummary};
use crate::rig::{EstimatorKind, Rig};
use crate::told::Beside;
use crate::trace::{Record, TraceError, TraceFault, TraceReader};
use crate::valve::{CalibrationError, ValveMeter};
use crate::wiring::Refused;
use conditions::{OilTemperature, TracePressures};
use consistency::Consistency;
use correction::{Correction, EffectUncertainty, added_std};
use episodes::Episodes;
use pitchleak_core::continuity::Block;
use pitchleak_core::{
    AlarmState, Estimate, Innovation, Leak, LeakDetector, LeakPressures, PerLeak, RlsError, Update,
};
use scoring::Scoring;
use spikes::{Sifted, Spikes};
use weighing::Weighing;

/// A stream's verdict is held against so much of it: longer than a leak takes to show, shorter than a shift. Chosen.
const HORIZON_S: f64 = 1200.0;

/// A running replay.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub struct Replay {
    rig: Rig,
    correction: Option<Correction>,
    estimator: Estimator,
    doubt: EffectUncertainty,
    detector: LeakDetector<f64>,
    /// Over the trace, or since the leak changed.
    pressures: TracePressures,
    /// Over the trace, which the decision is about.
    #[serde(default)]
    all_pressures: TracePressures,
    changed_at_s: Option<f64>,
    scoring: Scoring,
    alarms: Vec<Alarm>,
    /// When those were raised that the posterior rules out, s: they are told once it no longer does.
    held_s: PerLeak<Option<f64>>,
    weighing: Weighing,
    episodes: Episodes,
    channels: ChannelMonitor,
    consistency: Consistency,
    spikes: Spikes,
    oil: OilTemperature,
    statistic: Box<Statistic>,
    /// Blocks that it took in since they were last forgotten.
    #[serde(skip)]
    fresh: Vec<Block<f64>>,
    /// What tells mistakes of wiring beside it.
    evidence: Beside,
    /// Whether the ports are shut: a hold is for [`hold`](crate::hold), not for this estimator.
    rests: bool,
    /// Time of the last record, s.
    end_s: f64,
    /// Of the last block, in its own standard deviations.
    #[serde(skip)]
    innovation: Option<f64>,
}

impl Replay {
    /// A replay for a rig; the rig file's `[estimator]` says with which estimator.
    ///
    /// # Errors
    /// Where nothing can be estimated for such a rig; no rig file makes one.
    pub fn new(rig: &Rig) -> Result<Self, RlsError> {
        Ok(Self {
            correction: Correction::of(rig),
            estimator: Estimator::new(rig)?,
            doubt: EffectUncertainty::of(rig)?,
            detector: LeakDetector::new(rig.alarms),
            pressures: TracePressures::default(),
            all_pressures: TracePressures::default(),
            changed_at_s: None,
            scoring: Scoring::default(),
            alarms: Vec::new(),
            held_s: PerLeak::default(),
            weighing: Weighing::default(),
            episodes: Episodes::default(),
            channels: ChannelMonitor::default(),
            consistency: Consistency::default(),
            spikes: Spikes::new(&rig.sensors()),
            oil: OilTemperature::default(),
            statistic: Box::new(Statistic::new(&rig.cylinder, &rig.fluid, &rig.sensors())),
            fresh: Vec::new(),
            evidence: Beside::default(),
            rests: false,
            end_s: 0.0,
            innovation: None,
            rig: rig.clone(),
        })
    }

    /// Whether each part is one that a replay of this rig has.
    fn fits_its_rig(&self) -> bool {
        Self::new(&self.rig).is_ok_and(|fresh| {
            std::mem::discriminant(&fresh.estimator) == std::mem::discriminant(&self.estimator)
                && fresh.correction.is_some() == self.correction.is_some()
                && fresh.doubt.count() == self.doubt.count()
                && self.channels.is_possible()
        })
    }

    /// Takes in one record; says whether the estimates are new.
    #[inline]
    pub fn push(&mut self, record: &Record) -> bool {
        self.end_s = record.t_s;
        if !record.has_both_pressures() {
            self.rests = true;
            return false;
        }
        if let Some(is_shut) = record.shut
            && is_shut != self.rests
        {
            self.rests = is_shut;
            return self.open_or_shut(record);
        }
        if self.rests {
            return false;
        }
        self.push_open(record)
    }

    /// Takes in a record at which the ports are shut or opened: what passes while they are shut is not in its flows.
    #[cold]
    fn open_or_shut(&mut self, record: &Record) -> bool {
        !self.rests && self.push_open(&Record { after_gap: true, ..*record })
    }

    /// Takes in a record of open ports.
    #[inline]
    fn push_open(&mut self, record: &Record) -> bool {
        self.channels.add(record);
        match self.spikes.sift(record) {
            Sifted::Waits => false,
            Sifted::Taken => self.correct(record),
            Sifted::AfterSpikes(left_out_s) => {
                self.correct(&Record { dt_s: record.dt_s + left_out_s, ..*record })
            }
            Sifted::AfterAll(waited) => {
                let renewed = waited.iter().fold(false, |renewed, waited| self.correct(waited) | renewed);
                self.correct(record) | renewed
            }
        }
    }

    /// Takes in a record that is no spike.
    #[inline]
    fn correct(&mut self, record: &Record) -> bool {
        self.doubt.push(record);
        match &mut self.correction {
            None => self.take(record),
            Some(correction) => {
                let corrected = correction.correct(record);
                self.take(&corrected)
            }
        }
    }

    #[inline]
    fn take(&mut self, record: &Record) -> bool {
        self.pressures.add(record);
        self.all_pressures.add(record);
        self.oil.add(record);
        if self.knows_noise() {
            let fresh = &mut self.fresh;
            self.statistic.push_each(record.step_s(), &record.sample, &mut |block| {
                if fresh.len() == stream::MOST_FRESH {
                    fresh.clear();
                }
                fresh.push(*block);
            });
            self.evidence.add(record, &self.rig);
        }
        let update = self.estimator.update(record);
        match update {
            Update::Balanced { innovation } => self.weigh(innovation),
            Update::Renewed { elapsed_s, changed, innovation } => {
                self.weigh(innovation);
                if changed {
                    self.pressures = TracePressures::default();
                    self.changed_at_s = Some(record.t_s);
                }
                self.weigh_renewal(changed);
                self.scoring.renew(self.estimator.leak_coefficients(), self.estimator.pressure_biases_pa());
                self.detect(record.t_s, elapsed_s);
            }
            _ => {}
        }
        self.scoring.add(record, self.by_effects_m3s());
        matches!(update, Update::Renewed { .. })
    }

    /// Whether the estimator knows how good its figures are: the paper's law does not, and nothing is weighed for it.
    fn knows_noise(&self) -> bool {
        self.rig.estimator.kind != EstimatorKind::Paper
    }

    /// What explains the records so far; none where they are too few.
    pub fn decision(&self) -> Option<Decision> {
        let told = self.evidence.told(&self.rig);
        let explain = || explain(&self.statistic, &self.rig, self.effect_doubts_m3s(), &told);
        self.knows_noise().then(explain).flatten()
    }

    /// What the uncertainty of the rig file's effects adds to the leaks' spreads, m³/s.
    fn effect_doubts_m3s(&self) -> PerLeak<f64> {
        let pressures = self.pressures.sizes();
        let certain = self.estimator.leak_flows_m3s(&pressures).unwrap_or_default();
        self.leak_flows_m3s(&pressures).zip(certain).map(|(wide, certain)| added_std(wide, certain))
    }

    /// Forgets what is long ago: a stream may run for months.
    fn forgetting(mut self) -> Self {
        let fresh = Statistic::new(&self.rig.cylinder, &self.rig.fluid, &self.rig.sensors());
        *self.statistic = fresh.forgetting(HORIZON_S);
        Self { evidence: self.evidence.forgetting(), ..self }
    }

    /// Weighs whether model and noise explain a block.
    fn weigh(&mut self, innovation: Option<Innovation<f64>>) {
        if let Some(innovation) = innovation {
            self.consistency.balance(innovation);
            self.innovation = Some(innovation.value / innovation.variance.sqrt());
        }
    }

    /// Weighs whether they explain the travel, or the estimates began anew.
    fn weigh_renewal(&mut self, changed: bool) {
        if self.consistency.is_next_stretch() {
            self.channels.next_stretch();
        }
        if changed {
            self.consistency.restarted();
        } else if let Some([_, position]) = self.estimator.normalised_innovation() {
            self.consistency.position(position);
        }
    }

    /// Holds the leak flows against their alarms, `elapsed_s` of watched time after they were held last.
    fn detect(&mut self, t_s: f64, elapsed_s: f64) {
        let flows = self.watched_flows_m3s();
        for (fault, change) in self.detector.update(elapsed_s, &flows) {
            match change {
                Some(AlarmState::Raised) => self.held_s[fault] = Some(t_s),
                Some(AlarmState::Cleared) if self.held_s[fault].take().is_some() => {
                    self.episodes.withdraw(fault)
                }
                Some(state) => self.alarms.push(Alarm { time_s: t_s, fault, state }),
                None => continue,
            }
            self.weighing.alarmed(t_s);
        }
        if self.held_s.iter().any(|(_, held)| held.is_some()) {
            self.release(t_s);
        }
        let alarms = &self.rig.alarms;
        let gone_m3s = alarms.threshold_m3s.map(|threshold| alarms.clearing_m3s(threshold));
        let there = flows.map(|flow| flow.value).zip(gone_m3s);
        self.episodes.add(t_s, elapsed_s, there, &self.detector.active());
    }

    /// Tells the alarms that were held back of leaks that are no longer ruled out.
    fn release(&mut self, t_s: f64) {
        self.renew(t_s);
        for fault in Leak::ALL {
            let decision = self.weighing.decision.as_ref();
            let is_ruled_out = decision.is_some_and(|decision| decision.rules_out_alarm(fault));
            if let Some(time_s) = self.held_s[fault].take_if(|_| !is_ruled_out) {
                let at = self.alarms.partition_point(|alarm| alarm.time_s <= time_s);
                self.alarms.insert(at, Alarm { time_s, fault, state: AlarmState::Raised });
            }
        }
    }

    /// Decides anew where that is due.
    fn renew(&mut self, t_s: f64) {
        if self.weighing.is_due(t_s) {
            let decision = self.decision().map(|decision| decision.read_by(&self.rig.columns, &self.rig));
            self.weighing.set(t_s, decision);
        }
    }

    /// Leaks whose alarm stands and was told.
    fn standing(&self) -> PerLeak<bool> {
        self.detector.active().zip(self.held_s).map(|(active, held_s)| active && held_s.is_none())
    }

    /// Leak flows as they are held against their alarms, m³/s: means over the estimator's memory; of the paper's law, which
    /// knows no uncertainty, at the mean pressures of the trace.
    pub fn watched_flows_m3s(&self) -> PerLeak<Estimate<f64>> {
        let flows = self.estimator.mean_leaks_m3s().map(|flows| {
            self.doubt.widen(with_effects(self.correction.as_ref(), flows), |correction, estimator| {
                with_effects(Some(correction), estimator.mean_leaks_m3s().unwrap_or_default())
            })
        });
        flows.unwrap_or_else(|| {
            with_effects(self.correction.as_ref(), self.exact_flows_m3s(&self.pressures.sizes()))
        })
    }

    /// What the flow balance of the last block had that the estimates before it did not foretell, in standard deviations;
    /// none before the first, and from the paper's law.
    pub fn innovation(&self) -> Option<f64> {
        self.innovation
    }

    /// Leak coefficients, m³/(s·Pa); the uncertainty of the rig file's effects widens them.
    pub fn leak_coefficients(&self) -> PerLeak<Estimate<f64>> {
        self.doubt.widen(self.estimator.leak_coefficients(), |_, estimator| estimator.leak_coefficients())
    }

    /// Leak flows at `pressures`, eq. (15), and those of the rig file's effects, m³/s.
    fn leak_flows_m3s(&self, pressures: &LeakPressures<f64>) -> PerLeak<Estimate<f64>> {
        let flows = self.estimator.leak_flows_m3s(pressures);
        let flows = flows.unwrap_or_else(|| self.exact_flows_m3s(pressures));
        self.doubt.widen(with_effects(self.correction.as_ref(), flows), |correction, estimator| {
            with_effects(Some(correction), estimator.leak_flows_m3s(pressures).unwrap_or_default())
        })
    }

    /// The paper's law knows no uncertainty: its flows are compared with the thresholds as if they were
    /// known to a hundredth of them.
    fn exact_flows_m3s(&self, pressures: &LeakPressures<f64>) -> PerLeak<Estimate<f64>> {
        let threshold = self.rig.alarms.threshold_m3s;
        self.estimator.leak_coefficients().zip(pressures.sizes_pa).zip(threshold).map(
            |((coefficient, pressure), threshold)| Estimate {
                value: coefficient.value * pressure,
                std: threshold / 100.0,
            },
        )
    }

    /// The estimates as they stand after `record`.
    pub fn estimate_row(&self, record: &Record) -> EstimateRow {
        let coefficients = self.leak_coefficients();
        let pressures = read_leak_pressures_pa(record, self.estimator.pressure_biases_pa());
        let laminar_m3s = coefficients.zip(pressures).map(|(c, pressure)| c.value * pressure);
        let flows_m3s = laminar_m3s.zip(self.by_effects_m3s()).map(|(laminar, own)| laminar + own);
        EstimateRow { t_s: record.t_s, coefficients, flows_m3s, active: self.standing() }
    }

    /// What the rig file's effects let leak at the last record, m³/s.
    fn by_effects_m3s(&self) -> PerLeak<f64> {
        self.correction.as_ref().map_or_else(PerLeak::default, Correction::leaks_m3s)
    }

    /// Whether both ports are shut: such records are for [`crate::hold`].
    pub fn rests(&self) -> bool {
        self.rests
    }

    /// Alarms so far, in the order of time.
    pub fn alarms(&self) -> &[Alarm] {
        &self.alarms
    }

    /// The alarms so far, which are forgotten.
    fn take_alarms(&mut self) -> Vec<Alarm> {
        self.episodes.forget();
        std::mem::take(&mut self.alarms)
    }

    /// The rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The estimator.
    pub fn estimator(&self) -> &Estimator {
        &self.estimator
    }
}

/// Leak flows with those that the rig file's effects carry themselves, m³/s.
fn with_effects(correction: Option<&Correction>, flows: PerLeak<Estimate<f64>>) -> PerLeak<Estimate<f64>> {
    let own = correction.map_or_else(PerLeak::default, Correction::mean_leaks_m3s);
    flows.zip(own).map(|(flow, own)| Estimate { value: flow.value + own, ..flow })
}

/// Pressure across each leak, Pa: P_L, P_A, P_B as read less the biases found of the sensors A and B.
fn read_leak_pressures_pa(record: &Record, [bias_a, bias_b]: [f64; 2]) -> PerLeak<f64> {
    leak_pressures_pa([record.sample.pa_pa - bias_a, record.sample.pb_pa - bias_b])
}

/// Pressure across each leak, Pa: P_L, P_A, P_B, where the chambers have P_A and P_B.
pub fn leak_pressures_pa([pa, pb]: [f64; 2]) -> PerLeak<f64> {
    PerLeak { internal: pa - pb, external_a: pa, external_b: pb }
}

/// Error returned by [`replay()`].
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The trace cannot be read on, or has a bad row and none is allowed.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// The rig, built by hand, has values with which nothing can be estimated.
    #[error("nothing can be estimated for this rig: {0}")]
    Rig(#[from] RlsError),
    /// The calibration of the rig's valve can't be used.
    #[error(transparent)]
    Valve(#[from] Box<CalibrationError>),
}

/// Replays a whole trace; `each` sees every record after it was taken in, and whether the estimates are
/// new.
///
/// # Errors
/// Where the trace cannot be read on, or a bad row is fatal, or `each` fails.
pub fn replay<E: From<ReplayError>>(
    reader: &mut TraceReader<'_>,
    rig: &Rig,
    mut each: impl FnMut(&Replay, &Record, bool) -> Result<(), E>,
) -> Result<ReplayReport, E> {
    let mut replay = Replay::new(rig).map_err(ReplayError::from)?;
    let mut record = Record::default();
    let columns = reader.columns(&rig.columns);
    let mut refused = None;
    let mut holds: Option<Recorder> = None;
    let mut has_spool = false;
    let mut valve = ValveMeter::of(rig).map_err(|error| ReplayError::from(Box::new(error)))?;
    while next_record(reader, &mut record, &mut refused, || Refused::new(rig, &columns))? {
        let renewed = replay.push(&record);
        Recorder::record(&mut holds, &record, rig);
        ValveMeter::record(&mut valve, &record);
        has_spool |= record.valve.is_some();
        each(&replay, &record, renewed)?;
    }
    let summary =
        TraceSummary { begins: reader.clock(), ..TraceSummary::new(reader.name(), reader.quality()) };
    let mut hold = holds.and_then(|holds| holds.finish(rig)).map(|hold| hold.report(summary.clone(), rig));
    if let Some(hold) = hold.take_if(|hold| HoldTest::tells(hold, rig)) {
        return Ok(hold);
    }
    // Where the holds tell too little, the valve's flows may tell more.
    let valve = valve.and_then(|mut valve| valve.finish(rig)).map(|valve| valve.report(summary.clone(), rig));
    if let Some(report) = valve.or(hold) {
        return Ok(report);
    }
    let weighed = replay.whole_trace();
    let refused = refused.filter(|_| reader.quality().is_mostly_bad());
    let decision = replay.decision().map(|decision| decision.read_by(&columns, rig));
    let refused = refused.as_ref().and_then(Refused::wiring);
    let wiring = refused.or_else(|| weighed.wiring(decision.as_ref(), &columns, rig));
    let mut report = replay.report_with(summary, weighed, decision.as_ref(), wiring);
    hold::advise(&mut report, reader.quality(), has_spool, rig);
    Ok(report)
}

/// The next good record; rows out of range go to `refused`, and the good ones after the first of them.
#[inline]
fn next_record(
    reader: &mut TraceReader<'_>,
    record: &mut Record,
    refused: &mut Option<Refused>,
    none: impl Fn() -> Refused,
) -> Result<bool, ReplayError> {
    let taken = reader.next_record_or(record, |row| refused.get_or_insert_with(&none).add_refused(row));
    let is_good = match taken {
        Err(TraceError { trace, fault: TraceFault::NoRows { skipped, first, .. } }) => {
            let mistake = refused.as_ref().and_then(Refused::wiring).map(|wiring| wiring.sentence().into());
            return Err(TraceError { trace, fault: TraceFault::NoRows { skipped, first, mistake } }.into());
        }
        taken => taken?,
    };
    if let Some(refused) = refused.as_mut().filter(|_| is_good) {
        refused.add(record);
    }
    Ok(is_good)
}

#[cfg(test)]
mod tests;
