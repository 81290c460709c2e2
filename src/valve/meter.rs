//! Takes the readings of a trace or a stream, and fits them a window at a time: what is known of the valve goes on from one to the next,
//! and the leaks do while they stay the same.

use super::calibration::{self, Calibration, CalibrationError, Since};
use super::course::Course;
use super::edges::{PA, PB, SPOOL, Signals, Spool};
use super::equations::{Known, Node};
use super::fit::{Fit, LEAST_READINGS, Place, Run, fit};
use super::means::Means;
use super::parts::{CHANGED, Likeliest, Summary, likeliest};
use super::unknowns::{Belief, Unknowns};
use super::unread;
use crate::rig::{Rig, ValveSheet};
use crate::signal::Signal;
use crate::trace::Record;
use nalgebra::Matrix3;
use pitchleak_core::Leak;
use serde::{Deserialize, Serialize};

/// A window has so many readings at the most: ten minutes at 100 Hz, 15 MB. Less, and the unknowns of the first are too far from linear.
const MOST_READINGS: usize = 60_000;
/// Leaks change so often in a window at the most: a search that halves it must end.
const MOST_CHANGES: usize = 3;
/// Changes are counted together within so long, s: a window of a file at 100 Hz (chosen).
const CHANGES_COUNT_S: f64 = 600.0;
/// Variance of a leak that is rounding, in its unit's square.
const LEAST_SPREAD: f64 = 1e-12;

/// Leaks that would have to change oftener than this within a window are none (chosen).
const SO_MANY_CHANGES: usize = 1;
/// A pressure so many standard deviations below the atmosphere's is so for certain.
const VOID_SIGMAS: f64 = 3.0;
/// Fewer readings tell nothing.
const LEAST_WINDOW: usize = 50;

/// The flows of a valve as a meter for leaks.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ValveMeter {
    pub(super) rig: Rig,
    pub(super) sheet: ValveSheet,
    /// Before the window.
    before: Belief,
    /// Where the last search ended; none before the first.
    at: Option<Unknowns>,
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

/// What a window said.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Taken {
    pub summary: Summary,
    /// Around which it is linear.
    pub at: Unknowns,
    pub changed_at_s: Option<f64>,
    /// Leaks changed in it, somewhere: what it says of the valve is not believed.
    is_mixed: bool,
    /// Whether the search for it came to an end.
    pub is_settled: bool,
    /// How often they changed.
    pub changes: usize,
    /// Whether noise explains what was before the last change, too.
    pub was_explained: bool,
}

impl Taken {
    /// Whether noise explains what is left, and the leaks change no oftener than leaks do.
    pub fn is_explained(&self) -> bool {
        self.was_explained && self.summary.is_explained() && self.changes <= SO_MANY_CHANGES
    }

    /// With what went before. Changes count for as long as a window of a file is.
    fn after(self, last: &Self, begin_s: f64) -> Self {
        let is_recent = last.changed_at_s.is_none_or(|changed_s| begin_s - changed_s < CHANGES_COUNT_S);
        let before = if is_recent { last.changes } else { last.changes.min(1) };
        if self.changed_at_s.is_some() {
            let changes = if is_recent { before + self.changes } else { self.changes };
            return Self { changes, ..self };
        }
        // A window amid which leaks changed, or whose search came to no end, says nothing of how well the model fits.
        let is_like = last.is_settled && !last.is_mixed;
        let summary = if is_like { self.summary.after(&last.summary) } else { self.summary };
        Self {
            summary,
            changed_at_s: last.changed_at_s,
            changes: before,
            was_explained: last.was_explained || !is_recent,
            ..self
        }
    }
}

/// By how much leaks have moved beyond what was known of them: squares in those of what they may by chance.
fn moved(before: &Belief, after: &Belief) -> Option<f64> {
    let (was, wide) = before.leaks()?;
    let (is, narrow) = after.leaks()?;
    let off = is - was;
    let spread = (wide - narrow).symmetric_part() + Matrix3::identity() * LEAST_SPREAD;
    Some(off.dot(&spread.cholesky()?.solve(&off)))
}

impl ValveMeter {
    /// For a rig with `[valve]`; `before` is what is known of it.
    pub(super) fn with(rig: &Rig, sheet: &ValveSheet, before: Belief, since: Option<Since>) -> Self {
        Self {
            rig: rig.clone(),
            sheet: sheet.clone(),
            before,
            at: None,
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
        self.window().or_else(|| self.last.clone())
    }

    /// What the readings of this window say, and those before.
    fn window(&mut self) -> Option<Taken> {
        if self.count < LEAST_WINDOW {
            return None;
        }
        let start = self.at.unwrap_or(self.before.mean);
        self.runs.retain(|run| run.readings.len() >= LEAST_READINGS);
        let mut taken = self.settled(&self.runs, &self.before, start, MOST_CHANGES)?;
        self.at = Some(taken.at);
        let Some(last) = &self.last else { return Some(taken) };
        let begin_s = self.runs.first()?.readings.first()?.t_s;
        let limit = CHANGED * taken.summary.noise.max(1.0);
        if taken.changes == 0 && moved(&self.before, &taken.summary.belief).is_some_and(|far| far > limit) {
            let before = self.before.with_new_leaks()?;
            taken = self.settled(&self.runs, &before, taken.at, 0)?;
            (taken.changed_at_s, taken.changes, taken.is_mixed) = (Some(begin_s), 1, true);
        }
        Some(taken.after(last, begin_s))
    }

    /// What readings say in the likeliest course: as means, where they may stand for them.
    fn fitted(&self, runs: &[Run], before: &Belief, start: Unknowns) -> Option<(Fit, Summary)> {
        let known = Known::of(&self.rig, &self.sheet);
        let found = Means::of(runs, &known.variances).and_then(|means| {
            let quieter = Known { variances: known.variances / means.count as f64, ..known.clone() };
            self.in_course(&means.runs, before, start, &quieter)
                .filter(|(_, summary)| means.are_white(summary.noise))
        });
        found.or_else(|| self.in_course(runs, before, start, &known))
    }

    /// Where the readings are no noise beside constant leaks, a line is tried, and else all is made linear around leaks that are others in
    /// each part: from there a change looks as it is.
    fn in_course(
        &self,
        runs: &[Run],
        before: &Belief,
        start: Unknowns,
        known: &Known,
    ) -> Option<(Fit, Summary)> {
        let fit_in = |course: Course| {
            let place = Place { unknowns: start, course };
            let fit = fit(runs, before, place, self.sheet.hysteresis, known)?;
            let found = likeliest(&fit.parts, before, &fit.place)?;
            Some((fit, found))
        };
        let (constant, Likeliest { at_once, line }) = fit_in(Course::constant())?;
        if line.is_none() && at_once.since == 0 && at_once.is_explained() {
            return Some((constant, at_once));
        }
        let line = Course::line(&constant.parts).and_then(fit_in);
        let line = line.and_then(|(fit, found)| Some((fit, found.line?)));
        if let Some(told) = line.filter(|(fit, summary)| fit.is_settled && summary.is_explained()) {
            return Some(told);
        }
        // Both sides of a change are fitted anew, wherever this search ended.
        let stairs = fit_in(Course::stairs(&constant.parts)).filter(|(_, found)| found.at_once.since > 0);
        Some(match stairs {
            Some((stairs, found)) => (stairs, found.at_once),
            None => (constant, at_once),
        })
    }

    /// What readings say of the leaks since they changed; what was before the change tells of the valve alone.
    fn settled(&self, runs: &[Run], before: &Belief, start: Unknowns, changes: usize) -> Option<Taken> {
        let (fit, summary) = self.fitted(runs, before, start)?;
        let constant = Taken {
            summary,
            at: fit.place.unknowns,
            changed_at_s: None,
            is_mixed: false,
            is_settled: fit.is_settled,
            changes: 0,
            was_explained: true,
        };
        let since = constant.summary.since;
        if since == 0 || changes == 0 {
            return Some(constant);
        }
        // Within the part before, or in this one, which are left out.
        let begins = |part: usize| fit.parts.get(part).map(|part| part.from_s);
        let changed_at_s = begins(since)?;
        let until_s = begins(since - 1)?;
        let from_s = begins(since + 1).filter(|_| since + 2 < fit.parts.len()).unwrap_or(changed_at_s);
        let part = |from_s: f64, to_s: f64| {
            runs.iter().filter_map(|run| run.between(from_s, to_s)).collect::<Vec<_>>()
        };
        let early = part(f64::NEG_INFINITY, until_s);
        let valve = self.settled(&early, before, before.mean, changes - 1);
        let known = valve.as_ref().map_or(before, |taken| &taken.summary.belief).with_new_leaks()?;
        let now = self.settled(&part(from_s, f64::INFINITY), &known, known.mean, changes - 1)?;
        let was_explained =
            valve.as_ref().is_none_or(|taken| taken.was_explained && taken.summary.is_explained());
        Some(Taken {
            changed_at_s: now.changed_at_s.or(Some(changed_at_s)),
            changes: now.changes + 1 + valve.map_or(0, |taken| taken.changes),
            was_explained: now.was_explained && was_explained,
            ..now
        })
    }

    /// What the window says becomes what was believed before, where the search for it came to an end.
    fn next_window(&mut self) {
        if let Some(taken) = self.window() {
            let tells = taken.is_settled && !taken.is_mixed;
            let known = if tells { None } else { self.before.with_new_leaks() };
            let known = known.unwrap_or_else(|| taken.summary.belief.clone());
            let later = known.later(&self.rig, &self.sheet, self.seconds());
            self.before = later.unwrap_or(known);
            self.at = self.at.filter(|_| tells);
            if taken.is_settled || !taken.is_explained() || self.last.is_none() {
                self.last = Some(taken);
            }
        }
    }
}
