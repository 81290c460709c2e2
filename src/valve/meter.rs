//! Takes the readings of a trace or a stream, and fits them a window at a time: what is known of the valve goes on from one to the next,
//! and the leaks do while they stay the same.

use super::calibration::{self, Calibration, CalibrationError, Since};
use super::course::Course;
use super::edges::{PA, PB, SPOOL, Signals, Spool};
use super::equations::{Known, Node};
use super::fit::{Fit, LEAST_READINGS, Place, Run, fit};
use super::means::Means;
use super::parts::{CHANGED, LEAST_IN_COURSE, Part, Summary, likeliest};
use super::unknowns::Belief;
use super::unread;
use crate::rig::{Rig, ValveSheet};
use crate::signal::Signal;
use crate::trace::Record;
use pitchleak_core::Leak;
use serde::{Deserialize, Serialize};

/// A window has so many readings at the most: ten minutes at 100 Hz, 15 MB. Less, and the unknowns of the first are too far from linear.
const MOST_READINGS: usize = 60_000;
/// What was read longer ago than this, s, says nothing of now: a window of a file at 100 Hz (chosen).
const KEPT_S: f64 = 600.0;
/// Leaks of a trace may change every so many seconds.
const PART_S: f64 = 5.0;
/// The likeliest course is found anew around itself so often at the most; numerical.
const MOST_COURSES: usize = 4;
/// A pressure so many standard deviations below the atmosphere's is so for certain.
const VOID_SIGMAS: f64 = 3.0;
/// Fewer readings tell nothing.
const LEAST_WINDOW: usize = 50;

/// The flows of a valve as a meter for leaks.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ValveMeter {
    pub(super) rig: Rig,
    pub(super) sheet: ValveSheet,
    /// Before any reading.
    pub(super) before: Belief,
    /// What the windows that have ended said, linear around that.
    parts: Vec<Part>,
    /// … of the last seconds, so many.
    pub(super) kept_s: f64,
    /// Leaks may change every so many seconds.
    pub(super) part_s: f64,
    runs: Vec<Run>,
    count: usize,
    /// … and spans so many seconds at the most.
    pub(super) window_s: f64,
    /// Least and greatest spool.
    spool_range: [f64; 2],
    /// So long part of a chamber was void, s.
    #[serde(default)]
    pub(super) void_s: f64,
    /// The chamber whose pressure is not measured.
    unread: Option<usize>,
    /// The calibration that it goes by.
    pub(super) since: Option<Since>,
    /// What the windows that have ended said.
    pub(super) last: Option<Taken>,
}

/// What the readings so far said.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Taken {
    pub summary: Summary,
    /// Whether the search came to an end.
    pub is_settled: bool,
}

impl ValveMeter {
    /// For a rig with `[valve]`; `before` is what is known of it.
    pub(super) fn with(rig: &Rig, sheet: &ValveSheet, before: Belief, since: Option<Since>) -> Self {
        Self {
            rig: rig.clone(),
            sheet: sheet.clone(),
            before,
            parts: Vec::new(),
            kept_s: KEPT_S,
            part_s: PART_S,
            runs: Vec::new(),
            count: 0,
            window_s: f64::INFINITY,
            spool_range: [f64::INFINITY, f64::NEG_INFINITY],
            void_s: 0.0,
            unread: None,
            since,
            last: None,
        }
    }

    /// For a rig with `[valve]`, by its calibration or else its data sheet; none for a rig without.
    ///
    /// # Errors
    /// Where the calibration cannot be read, or is of another rig.
    pub fn of(rig: &Rig) -> Result<Option<Self>, CalibrationError> {
        let Some(sheet) = rig.valve.as_ref() else { return Ok(None) };
        let calibration = calibration::of_rig(rig, sheet)?;
        let belief = calibration.as_ref().and_then(|found| found.belief(rig, sheet));
        let before = belief.unwrap_or_else(|| Belief::of_sheet(rig, sheet));
        Ok(Some(Self::with(rig, sheet, before, calibration.as_ref().map(Calibration::since))))
    }

    /// Least and greatest position of the spool; none where it was never read.
    pub(super) fn spool_range(&self) -> Option<[f64; 2]> {
        self.spool_range[0].is_finite().then_some(self.spool_range)
    }

    /// Goes on without the pressure of a chamber.
    #[inline]
    fn lose(&mut self, chamber: Option<usize>) {
        self.unread = self.unread.or(chamber);
        let Some(leak) = chamber.and(self.untold()) else { return };
        if let Some(before) = self.before.clone().without_pressure_at(leak, &self.rig) {
            self.before = before;
        }
    }

    /// Whether what it says of leaks is worth anything: where the search settled, without one of the pressures a calibrated valve's.
    pub(super) fn can_tell(&self, taken: &Taken) -> bool {
        taken.is_settled && (self.unread.is_none() || self.since.is_some())
    }

    /// The leak at the chamber whose pressure is not measured, which nothing tells of.
    pub(super) fn untold(&self) -> Option<Leak> {
        self.unread.map(|chamber| if chamber == PA { Leak::ExternalA } else { Leak::ExternalB })
    }

    /// The chamber pressure that is not measured.
    pub(super) fn unread(&self) -> Option<Signal> {
        self.unread.map(|chamber| if chamber == PA { Signal::PressureA } else { Signal::PressureB })
    }

    /// Takes in a record of a rig that may have a valve; with the first flow of a meter it has no say any more.
    #[inline]
    pub fn record(meter: &mut Option<Self>, record: &Record) {
        if record.has_flow() {
            *meter = None;
        }
        if let Some(valve) = meter {
            valve.push(record);
        }
    }

    /// Takes in a record, and says whether it was one of the valve's: with a spool and a supply pressure, the ports open.
    pub fn push(&mut self, record: &Record) -> bool {
        let node = self.node(record).filter(|_| record.shut != Some(true));
        let is_void = node.as_ref().is_some_and(|node| self.is_void(node));
        let is_apart = record.after_gap || record.shut == Some(true) || is_void;
        if is_apart || self.runs.is_empty() {
            self.runs.retain(|run| run.readings.len() >= LEAST_READINGS);
            self.runs.push(Run::default());
        }
        let Some(node) = node else { return false };
        let [least, most] = self.spool_range;
        self.spool_range = [least.min(node.signals[SPOOL]), most.max(node.signals[SPOOL])];
        if is_void {
            self.void_s += if record.after_gap { 0.0 } else { record.dt_s };
            return true;
        }
        if self.unread.is_none() {
            self.lose(unread::chamber(&node.signals));
        }
        if let Some(run) = self.runs.last_mut() {
            run.readings.push(node);
            self.count += 1;
        }
        let is_timed = self.window_s.is_finite();
        if self.count >= MOST_READINGS || is_timed && self.seconds() >= self.window_s {
            self.next_window();
            (self.runs, self.count) = (vec![Run { readings: vec![node] }], 1);
        }
        true
    }

    /// Time that the window's readings span, s.
    fn seconds(&self) -> f64 {
        self.runs.iter().map(Run::seconds).sum()
    }

    /// Whether a window ended with the last reading.
    pub(super) fn has_ended(&self) -> bool {
        self.count == 1 && self.last.is_some()
    }

    /// Whether a chamber is below the atmosphere for certain: part of it is void, and takes up what flows in at no pressure.
    fn is_void(&self, node: &Node) -> bool {
        let least_pa = -VOID_SIGMAS * self.rig.instruments.pressure.spread().noise_std;
        [PA, PB].into_iter().any(|chamber| node.signals[chamber] < least_pa)
    }

    fn node(&self, record: &Record) -> Option<Node> {
        let valve = record.valve?;
        let supply_pa = valve.supply_pa.or(self.sheet.supply_pa)?;
        let sample = &record.sample;
        Some(Node {
            t_s: record.t_s,
            signals: Signals::from([sample.x_m, sample.pa_pa, sample.pb_pa, valve.spool, supply_pa]),
            spool: Spool { tank_pa: valve.tank_pa.unwrap_or(self.sheet.tank_pa), ..Spool::default() },
        })
    }

    /// What the readings so far say; none where they are too few, or no finite number comes out.
    pub(super) fn taken(&mut self) -> Option<Taken> {
        self.window().map(|(_, taken)| taken).or_else(|| self.last.clone())
    }

    /// The parts of this window and of those before, and what they say together; where no valve as believed explains the window, what
    /// that says alone.
    fn window(&mut self) -> Option<(Vec<Part>, Taken)> {
        if self.count < LEAST_WINDOW {
            return None;
        }
        self.runs.retain(|run| run.readings.len() >= LEAST_READINGS);
        let is_sure = |taken: &&Taken| taken.summary.parts >= LEAST_IN_COURSE && taken.summary.is_explained();
        let last = self.last.as_ref().filter(is_sure);
        let known = last.and_then(|taken| taken.summary.belief.with_new_leaks());
        let (fit, alone) = self.fitted(&self.runs, known.as_ref().unwrap_or(&self.before))?;
        if !fit.is_settled {
            return Some((Vec::new(), Taken { summary: alone, is_settled: false }));
        }
        let far = (fit.place.unknowns - self.before.mean).fixed_resize(0.0);
        let now: Vec<Part> = fit.flat_parts().iter().map(|part| part.around(&far)).collect();
        let end_s = now.last()?.until_s();
        let recent = self.parts.iter().filter(|part| end_s - part.from_s <= self.kept_s);
        let parts: Vec<Part> = recent.cloned().chain(now).collect();
        let drifted = |part: &Part| {
            part.before_drift(&self.before.drift(&self.rig, &self.sheet, end_s - part.until_s()))
        };
        let told = parts.iter().map(drifted).collect::<Option<Vec<Part>>>()?;
        let (_, summary) = likeliest(&told, &[], &self.before, &self.before.mean)?;
        Some((parts, Taken { summary, is_settled: true }))
    }

    /// What readings say in the likeliest course: as means, where they may stand for them.
    fn fitted(&self, runs: &[Run], before: &Belief) -> Option<(Fit, Summary)> {
        let known = Known { part_s: self.part_s, ..Known::of(&self.rig, &self.sheet) };
        let found = Means::of(runs, &known.variances).and_then(|means| {
            let quieter = Known { variances: known.variances / means.count as f64, ..known.clone() };
            self.in_course(&means.runs, before, &quieter)
                .filter(|(_, summary)| means.are_white(summary.noise))
        });
        found.or_else(|| self.in_course(runs, before, &known))
    }

    /// Where the readings are no noise beside constant leaks, all is made linear around the likeliest course, and around the one that is
    /// likeliest from there.
    fn in_course(&self, runs: &[Run], before: &Belief, known: &Known) -> Option<(Fit, Summary)> {
        let fit_in = |course: Course| {
            let jumps = course.jumps();
            let runs: Vec<Run> = runs.iter().flat_map(|run| run.without(&jumps)).collect();
            let place = Place { unknowns: before.mean, course };
            let fit = fit(&runs, before, place, self.sheet.hysteresis, known)?;
            let (course, summary) = likeliest(&fit.flat_parts(), &jumps, before, &fit.place.unknowns)?;
            Some((fit, course, summary))
        };
        let refined = |mut course: Course| {
            let mut found = None;
            for _ in 0..MOST_COURSES {
                let next = fit_in(course.clone()).filter(|(fit, ..)| fit.is_settled);
                let Some((fit, next, summary)) = next else { break };
                found = Some((fit, summary));
                if next.is_like(&std::mem::replace(&mut course, next.clone())) {
                    break;
                }
            }
            found
        };
        let (constant, course, summary) = fit_in(Course::constant())?;
        let line = Course::line(&constant.parts);
        if constant.parts.len() < LEAST_IN_COURSE {
            let line = fit_in(line).filter(|(fit, ..)| fit.is_settled);
            let line = line.filter(|(fit, ..)| fit.squares() + CHANGED < constant.squares());
            return Some(line.map_or((constant, summary), |(fit, _, summary)| (fit, summary)));
        }
        if course.is_constant() {
            return Some((constant, summary));
        }
        let is_explained = |(_, summary): &(Fit, Summary)| summary.is_explained();
        let found = refined(course);
        if found.as_ref().is_some_and(is_explained) {
            return found;
        }
        refined(line).filter(is_explained).or(found).or(Some((constant, summary)))
    }

    /// What the window says is kept, where the search for it came to an end.
    fn next_window(&mut self) {
        if let Some((parts, taken)) = self.window() {
            if taken.is_settled {
                self.parts = parts;
            }
            if taken.is_settled || !taken.summary.is_explained() || self.last.is_none() {
                self.last = Some(taken);
            }
        }
    }
}
