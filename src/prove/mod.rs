//! A known leak put into a trace: is it found, at its size, how soon, and from which size on?
//!
//! The cylinder moves as it was recorded, and its chambers have the pressures that were recorded; what leaks then has to come
//! through the flow meters as well. So a laminar leak adds C P to the flows, eq. (15), from a third of the trace on, and no
//! meter reads beyond its full scale. All else of the trace stays as it is: its noise, its zeros, its lags.
//!
//! A leak knows nothing of its sensor's noise. So the pressure that drives it is the one that was read, drawn to its mean by the
//! share of its variance that is noise (Wiener's gain).

mod bound;

use crate::replay::{ReplayError, leak_pressures_pa, replay};
use crate::report::{Leakage, ReplayReport, Status, TraceSummary, Verdict};
use crate::rig::Rig;
use crate::signal::Signal;
use crate::trace::{Record, TraceReader};
use crate::units::LPM_PER_M3S;
use bound::Bound;
use pitchleak_core::{AlarmState, Estimate, Leak, PerLeak};
use serde::Serialize;

/// The leak begins behind this share of the trace: what is before says what is sound. Chosen.
const ONSET_SHARE: f64 = 1.0 / 3.0;
/// Sizes that are tried where none is asked for, in alarm thresholds.
const USUAL_SIZES: [f64; 2] = [2.0, 5.0];
/// The least size is looked for up to this many thresholds, and to this share.
const MOST_THRESHOLDS: f64 = 64.0;
const SIZE_SHARE: f64 = 0.05;
/// Two-sided 95 % as one-sided: what is sure.
const SURE: f64 = 1.645;
/// A pressure below so many times its sensor's noise drives nothing. Chosen.
const LEAST_PRESSURE: f64 = 5.0;
/// What is found is of the size that was put in where it is within so many standard deviations. Chosen.
const SIZE_SIGMAS: f64 = 4.0;
/// How finely the bound is followed after the onset, s.
const BOUND_STEP_S: f64 = 0.1;

/// What a trace proves, as `prove --json` prints it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Proof {
    /// `pitchleak.prove/1`.
    pub schema: &'static str,
    /// What was read.
    pub trace: TraceSummary,
    /// `wu2011`, or the rig file's path.
    pub rig: String,
    /// Of the trace as it was recorded.
    pub verdict: Verdict,
    /// Its leaks as it was recorded.
    pub leakage: PerLeak<Leakage>,
    /// From here on the leaks are put in, s.
    pub onset_s: f64,
    /// Each leak that was put in.
    pub cases: Vec<Case>,
    /// How small a leak of each kind is found.
    pub found_from: PerLeak<Least>,
}

/// One leak that was put in, alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Case {
    /// Which.
    pub leak: Leak,
    /// Its mean size, L/min.
    pub put_in_lpm: f64,
    /// Whether the verdict names it.
    pub found: bool,
    /// The verdict's word with it.
    pub status: Status,
    /// Leaks named that are neither in the trace nor put in.
    pub wrongly_named: Vec<Leak>,
    /// What is found beyond what the trace had, L/min.
    pub found_lpm: f64,
    /// Standard deviation of what is found, L/min.
    pub std_lpm: Option<f64>,
    /// The least that any method could have with these meters, L/min.
    pub bound_std_lpm: Option<f64>,
    /// From its onset to its alarm, s.
    pub alarm_after_s: Option<f64>,
    /// The earliest that any method could be as sure, s.
    pub bound_after_s: Option<f64>,
    /// Estimated flow over time: time, s, and flow, L/min.
    #[serde(skip)]
    pub course: Vec<(f64, f64)>,
}

/// The least leak that is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Least {
    /// L/min; none where none is.
    pub lpm: Option<f64>,
    /// The least that any method could be sure of on average over noise, L/min; this trace's own may be kinder. None where the trace doesn't tell.
    pub bound_lpm: Option<f64>,
    /// Why none can be put in.
    pub reason: Option<&'static str>,
}

impl Proof {
    /// Name and version of the JSON form.
    pub const SCHEMA: &'static str = "pitchleak.prove/1";

    /// One line of JSON.
    ///
    /// # Errors
    /// None in practice: every field has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string(self)
    }

    /// Whether each leak that was put in was found, and no other.
    pub fn is_proven(&self) -> bool {
        !self.cases.is_empty() && self.cases.iter().all(|case| case.found && case.wrongly_named.is_empty())
    }
}

/// Why nothing can be put into a trace.
#[derive(Debug, thiserror::Error)]
pub enum ProveError {
    /// Reading or replaying it.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// No flow meters.
    #[error(
        "{0}: no flow is measured: a leak cannot be put in, `pitchleak simulate --shut` shows what a hold test finds"
    )]
    NoFlows(String),
    /// A hold test.
    #[error("{0}: a hold test, whose flows are zero: `pitchleak check` says the smallest leak that it finds")]
    Hold(String),
}

/// Puts leaks into the trace that `open` opens, each time from its begin: of `sizes_lpm`, or where none is asked for of usual
/// ones. `step` is told the share of the work that is done.
///
/// # Errors
/// [`ProveError`], or what `open` fails with.
pub fn prove<'a, E: From<ProveError>>(
    open: impl Fn() -> Result<TraceReader<'a>, E>,
    rig: &Rig,
    sizes_lpm: &PerLeak<Vec<f64>>,
    mut step: impl FnMut(),
) -> Result<Proof, E> {
    let trial = Trial::of(open, rig)?;
    let asked = sizes_lpm.iter().any(|(_, sizes)| !sizes.is_empty());
    let mut cases = Vec::new();
    let mut found_from = PerLeak::<Least>::default();
    for leak in Leak::ALL {
        if let Some(reason) = trial.hidden(leak) {
            found_from[leak].reason = Some(reason);
            continue;
        }
        let threshold_lpm = rig.alarms.threshold_m3s[leak] * LPM_PER_M3S;
        let usual = USUAL_SIZES.map(|times| times * threshold_lpm);
        let sizes: &[f64] = if asked { &sizes_lpm[leak] } else { &usual };
        for size_lpm in sizes {
            cases.push(trial.put_in(leak, *size_lpm)?);
            step();
        }
        found_from[leak] = trial.least(leak, threshold_lpm, &mut step)?;
    }
    let ReplayReport { trace, rig, verdict, leakage, .. } = trial.recorded;
    Ok(Proof {
        schema: Proof::SCHEMA,
        trace,
        rig,
        verdict,
        leakage,
        onset_s: trial.onset_s,
        cases,
        found_from,
    })
}

/// The pressure across a leak, gathered sample by sample; Pa.
#[derive(Clone, Copy, Default)]
struct Drive {
    count: f64,
    mean: f64,
    mean_size: f64,
    squares: f64,
    /// Squares of its steps, of which noise has two variances.
    step_squares: f64,
    last: f64,
}

impl Drive {
    fn add(&mut self, pressure_pa: f64) {
        self.count += 1.0;
        if self.count > 1.0 {
            self.step_squares += (pressure_pa - self.last).powi(2);
        }
        self.last = pressure_pa;
        let off = pressure_pa - self.mean;
        self.mean += off / self.count;
        self.squares += off * (pressure_pa - self.mean);
        self.mean_size += (pressure_pa.abs() - self.mean_size) / self.count;
    }

    /// The share of its variance that is no noise.
    fn gain(&self) -> f64 {
        if self.squares > 0.0 { (1.0 - 0.5 * self.step_squares / self.squares).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// What drives a leak where this was read, Pa.
    fn without_noise(&self, pressure_pa: f64) -> f64 {
        self.mean + self.gain() * (pressure_pa - self.mean)
    }
}

/// A trace into which leaks are put.
struct Trial<'r, F> {
    /// Opens it from its begin.
    open: F,
    rig: &'r Rig,
    recorded: ReplayReport,
    onset_s: f64,
    /// Across the leaks, since the onset.
    drives: PerLeak<Drive>,
    /// Whether Q_A and Q_B are measured.
    has_flow: [bool; 2],
    /// Time since the onset, s, and the bound's deviations of the coefficients then.
    bounds: Vec<(f64, PerLeak<Option<f64>>)>,
}

impl<'r, 'a, E: From<ProveError>, F: Fn() -> Result<TraceReader<'a>, E>> Trial<'r, F> {
    fn of(open: F, rig: &'r Rig) -> Result<Self, E> {
        let mut reader = open()?;
        let has_flow = [Signal::FlowA, Signal::FlowB].map(|flow| reader.has(flow));
        let mut first_s = None;
        let recorded = replay(&mut reader, rig, |_, record, _| {
            first_s.get_or_insert(record.t_s);
            Ok::<(), ReplayError>(())
        })
        .map_err(ProveError::from)?;
        if recorded.hold.is_some() {
            return Err(ProveError::Hold(recorded.trace.path).into());
        }
        if has_flow == [false; 2] {
            return Err(ProveError::NoFlows(recorded.trace.path).into());
        }
        let onset_s = first_s.unwrap_or(0.0) + ONSET_SHARE * recorded.trace.duration_s;
        let drives = PerLeak::default();
        let mut trial = Self { open, rig, recorded, onset_s, drives, has_flow, bounds: Vec::new() };
        trial.follow(&mut (trial.open)()?).map_err(ProveError::from)?;
        Ok(trial)
    }

    /// Follows pressures and bound through the trace as it was recorded.
    fn follow(&mut self, reader: &mut TraceReader<'_>) -> Result<(), ReplayError> {
        let duration_s = self.recorded.trace.duration_s;
        let mut bound = Bound::new(self.rig, self.onset_s, duration_s);
        let mut record = Record::default();
        let mut next_s = self.onset_s;
        while reader.next_record(&mut record)? {
            bound.add(&record);
            if record.t_s < self.onset_s {
                continue;
            }
            let of_leaks = leak_pressures_pa([record.sample.pa_pa, record.sample.pb_pa]);
            for leak in Leak::ALL {
                self.drives[leak].add(of_leaks[leak]);
            }
            if record.t_s >= next_s {
                let since_s = record.t_s - self.onset_s;
                self.bounds.push((since_s, bound.stds()));
                // Ever more seldom: a share of the time is as good.
                next_s = record.t_s + (SIZE_SHARE * since_s).max(BOUND_STEP_S);
            }
        }
        self.bounds.push((record.t_s - self.onset_s, bound.stds()));
        Ok(())
    }

    /// Mean size of the pressure across a leak since the onset, Pa.
    fn pressure_pa(&self, leak: Leak) -> f64 {
        let drive = &self.drives[leak];
        if drive.gain() > 0.5 { drive.mean_size } else { drive.mean.abs() }
    }

    /// Why no such leak can be put in; none where one can.
    fn hidden(&self, leak: Leak) -> Option<&'static str> {
        let noise_pa = self.rig.sensors().pressure.noise_std;
        let [a, b] = self.has_flow;
        match leak {
            Leak::ExternalA if !a => Some("no flow into chamber A is measured"),
            Leak::ExternalB if !b => Some("no flow into chamber B is measured"),
            _ if self.pressure_pa(leak) < LEAST_PRESSURE * noise_pa => Some("next to no pressure drives it"),
            _ => None,
        }
    }

    /// The trace with a leak of this mean size put in.
    fn with_leak(&self, leak: Leak, size_lpm: f64) -> Result<TraceReader<'a>, E> {
        let coefficient = size_lpm / LPM_PER_M3S / self.pressure_pa(leak).max(1.0);
        let (onset_s, drive) = (self.onset_s, self.drives[leak]);
        let sheets = &self.rig.instruments;
        let full_m3s = [sheets.flow_a.full_scale, sheets.flow_b.full_scale];
        Ok((self.open)()?.with_flows(Box::new(move |t_s, of_chambers, flows| {
            if t_s < onset_s {
                return flows;
            }
            let flow = coefficient * drive.without_noise(leak_pressures_pa(of_chambers)[leak]);
            let added = match leak {
                Leak::Internal => [flow, -flow],
                Leak::ExternalA => [flow, 0.0],
                Leak::ExternalB => [0.0, flow],
            };
            // What the meter read beyond its full scale it still does.
            std::array::from_fn(|side| {
                let most = full_m3s[side].max(flows[side].abs());
                if flows[side].is_nan() {
                    flows[side]
                } else {
                    (flows[side] + added[side]).clamp(-most, most)
                }
            })
        })))
    }

    fn put_in(&self, leak: Leak, size_lpm: f64) -> Result<Case, E> {
        let mut course = Vec::new();
        let report = replay(&mut self.with_leak(leak, size_lpm)?, self.rig, |replay, record, renewed| {
            if renewed {
                course.push((record.t_s, replay.watched_flows_m3s()[leak].value * LPM_PER_M3S));
            }
            Ok::<(), ReplayError>(())
        });
        let report = report.map_err(ProveError::from)?;
        let own = |one: &Leak| *one == leak || self.recorded.verdict.faults.contains(one);
        let raised = report.alarms.iter().find(|alarm| {
            alarm.fault == leak && alarm.state == AlarmState::Raised && alarm.time_s >= self.onset_s
        });
        let flow = report.leakage[leak];
        Ok(Case {
            leak,
            put_in_lpm: size_lpm,
            found: self.is_found(&report, leak, size_lpm),
            status: report.verdict.status,
            wrongly_named: report.verdict.faults.iter().filter(|one| !own(one)).copied().collect(),
            found_lpm: flow.mean_lpm - self.recorded.leakage[leak].mean_lpm,
            std_lpm: flow.std_lpm,
            bound_std_lpm: self.bound_std_lpm(leak),
            alarm_after_s: raised.map(|alarm| alarm.time_s - self.onset_s),
            bound_after_s: self.bound_after_s(leak, size_lpm),
            course,
        })
    }

    /// The verdict names the leak, at its size; where the trace had one before, it is larger for certain.
    fn is_found(&self, report: &ReplayReport, leak: Leak, size_lpm: f64) -> bool {
        let named = |report: &ReplayReport| {
            report.verdict.status == Status::Leak && report.verdict.faults.contains(&leak)
        };
        let [before, now] = [&self.recorded.leakage[leak], &report.leakage[leak]];
        let std_lpm = |flow: &Leakage| flow.std_lpm.unwrap_or(f64::INFINITY);
        let grown_lpm = now.mean_lpm - before.mean_lpm;
        let is_its_size = (grown_lpm - size_lpm).abs() < SIZE_SIGMAS * std_lpm(now).hypot(std_lpm(before));
        let is_grown = !named(&self.recorded) || grown_lpm > SURE * std_lpm(now);
        named(report) && is_its_size && is_grown
    }

    /// The least size that is found, by halving on a scale of ratios.
    fn least(&self, leak: Leak, threshold_lpm: f64, step: &mut impl FnMut()) -> Result<Least, E> {
        let leaks_already = self.recorded.verdict.faults.contains(&leak);
        let std_lpm = self.bound_std_lpm(leak);
        let least_lpm = if leaks_already { 0.0 } else { threshold_lpm };
        let bound_lpm = std_lpm.map(|std| least_lpm + SURE * std);
        let (mut low, mut high) = (bound_lpm.unwrap_or(threshold_lpm) / 2.0, MOST_THRESHOLDS * threshold_lpm);
        let mut found = |size_lpm: f64| {
            step();
            Ok::<bool, E>(self.put_in(leak, size_lpm)?.found)
        };
        // Doubled up to a size that is found: a leak far above it may not be what the meters can read.
        let mut size_lpm = 2.0 * low;
        while !found(size_lpm)? {
            (low, size_lpm) = (size_lpm, 2.0 * size_lpm);
            if size_lpm > high {
                return Ok(Least { lpm: None, bound_lpm, reason: None });
            }
        }
        high = size_lpm;
        while high > (1.0 + SIZE_SHARE) * low {
            let middle = (low * high).sqrt();
            if found(middle)? { high = middle } else { low = middle }
        }
        Ok(Least { lpm: Some(high), bound_lpm, reason: None })
    }

    fn bound_std_lpm(&self, leak: Leak) -> Option<f64> {
        let (_, stds) = self.bounds.last()?;
        stds[leak].map(|std| std * self.pressure_pa(leak) * LPM_PER_M3S)
    }

    /// When the bound is as sure as an alarm has to be, and has been for its hold time.
    fn bound_after_s(&self, leak: Leak, size_lpm: f64) -> Option<f64> {
        let alarms = &self.rig.alarms;
        let before = &self.recorded.leakage[leak];
        let value = (before.mean_lpm.max(0.0) + size_lpm) / LPM_PER_M3S;
        let sure = self.bounds.iter().find(|(_, stds)| {
            let flow = |std: f64| Estimate { value, std: std * self.pressure_pa(leak) };
            stds[leak].is_some_and(|std| alarms.is_evidence(alarms.threshold_m3s[leak], &flow(std)))
        });
        sure.map(|(since_s, _)| since_s + alarms.hold_time_s)
    }
}
