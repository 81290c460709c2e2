//! Position and pressures that come on clocks of their own: a row for each reading of the one that is read most seldom, with the
//! others on the straight lines between their own readings around it.
//!
//! No reading is counted as two: a flow stands in the first such row after it was read, and in no other, so that the noise is
//! that of its own readings. Flows that are missing beside a whole position and whole pressures stay missing, and the estimator
//! waits for them ([`Clocks`](pitchleak_core::continuity::Clocks)).
//!
//! Files of one recording, each with some of its channels and a clock of their own, as one source of rows in the order of time.

use super::clock::is_same;
use super::columns::{Layout, REQUIRED};
use super::error::{TraceError, TraceFault};
use super::format::{self, Rows};
use super::row::{NEEDED, Next, Row, RowSource};
use super::validator::missing;
use crate::rig::Rig;
use crate::signal::Signal;
use std::collections::VecDeque;
use std::fs::File;
use std::path::Path;

/// So many rows are looked at ahead (chosen): 300 kB, and two readings of a channel a thousand times slower than another.
const AHEAD: usize = 2048;
/// A channel without a reading for so many of its own steps is not measured there (chosen).
const MOST_STEPS: f64 = 5.0;
/// Steps over which the usual one is a mean (chosen).
const STEPS: f64 = 64.0;

/// The own clock of a signal.
#[derive(Clone, Copy, Default)]
struct OwnClock {
    /// The last reading before the rows held: its time, s, and value.
    last: Option<(f64, f64)>,
    /// Whether it stands in a row already.
    given: bool,
    /// Time of the last reading among the rows held, s.
    newest_s: Option<f64>,
    steps: f64,
    usual_s: f64,
}

impl OwnClock {
    fn read_at(&mut self, t_s: f64) {
        if let Some(newest_s) = self.newest_s.replace(t_s) {
            let step_s = t_s - newest_s;
            self.steps = (self.steps + 1.0).min(STEPS);
            // What is missing for long makes no step usual.
            let longest_s = if self.steps > 1.0 { 2.0 * MOST_STEPS * self.usual_s } else { step_s };
            self.usual_s += (step_s.min(longest_s) - self.usual_s) / self.steps;
        }
    }

    /// Whether readings that are so far apart are neighbours, s.
    fn is_near(&self, step_s: f64) -> bool {
        step_s < MOST_STEPS * self.usual_s
    }
}

/// Rows of a source, each with its position and both pressures.
pub(super) struct OwnClocks<'a> {
    source: Box<dyn RowSource + Send + 'a>,
    /// The pressure that is not measured.
    unread: Option<Signal>,
    /// The last row that was whole as it was read.
    before: Row,
    /// Rows read ahead, in the order of time; none where all before was whole.
    held: VecDeque<Row>,
    /// Of these, how many have each needed reading.
    counts: [usize; NEEDED.len()],
    clocks: [OwnClock; Signal::ALL.len()],
    /// The first row behind those held that goes back in time.
    behind: Option<Row>,
    /// What ended the source.
    then: Option<Result<Next, TraceFault>>,
}

impl<'a> OwnClocks<'a> {
    pub(super) fn of(source: Box<dyn RowSource + Send + 'a>) -> Self {
        let clocks = [OwnClock::default(); Signal::ALL.len()];
        let (before, held) = (Row::empty(), VecDeque::new());
        let unread = source.layout().unread();
        Self { source, unread, before, held, counts: [0; NEEDED.len()], clocks, behind: None, then: None }
    }

    #[inline(always)]
    fn read(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        let next = self.source.next_row(row);
        row.stand_in(self.unread);
        next
    }

    /// Begins to look ahead: at the first row that lacks a reading.
    #[cold]
    fn begin(&mut self, row: Row) {
        let before = std::mem::replace(&mut self.before, Row::empty());
        for (clock, value) in self.clocks.iter_mut().zip(before.cells) {
            if !value.is_nan() {
                *clock = OwnClock {
                    last: Some((before.get(Signal::Time), value)),
                    given: true,
                    newest_s: Some(before.get(Signal::Time)),
                    ..*clock
                };
            }
        }
        self.push(row);
    }

    /// The next row where some were read ahead, or the last one read lacks a reading.
    #[cold]
    fn next_held(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        loop {
            if let Some(bad) = self.look_ahead() {
                return Ok(bad);
            }
            let Some(read) = self.pop() else {
                let Some(first) = self.behind.take() else {
                    return self.then.take().unwrap_or(Ok(Next::End));
                };
                // The clock was set back: nothing before it is near.
                self.clocks = [OwnClock::default(); Signal::ALL.len()];
                self.push(first);
                continue;
            };
            row.clone_from(&read);
            let next = self.whole(row);
            self.keep(&read, matches!(next, Some(Next::Row)).then_some(row));
            if let Some(next) = next {
                return Ok(next);
            }
        }
    }

    /// Reads ahead, as long as a row lacks a reading; a bad row, where there is one on the way.
    fn look_ahead(&mut self) -> Option<Next> {
        while self.held.len() < AHEAD && self.then.is_none() && self.behind.is_none() {
            if !self.held.is_empty() && self.all_whole() {
                break;
            }
            let mut row = Row::empty();
            match self.read(&mut row) {
                Ok(Next::Row) => self.push(row),
                Ok(Next::Bad(bad)) => return Some(Next::Bad(bad)),
                end => self.then = Some(end),
            }
        }
        None
    }

    fn all_whole(&self) -> bool {
        self.counts.iter().all(|count| *count == self.held.len())
    }

    fn push(&mut self, mut row: Row) {
        let t_s = row.get(Signal::Time);
        match self.held.back().map(|back| (back.get(Signal::Time), back.has_needed())) {
            Some((back_s, _)) if t_s < back_s && !is_same(t_s, back_s) => {
                self.behind = Some(row);
                return;
            }
            // Readings of one moment may stand in rows of their own.
            Some((back_s, is_whole)) if is_same(t_s, back_s) && !(is_whole && row.has_needed()) => {
                if let Some(back) = self.held.pop_back() {
                    self.count(&back, -1);
                    row.fill(&back);
                }
            }
            _ => {}
        }
        self.count(&row, 1);
        for (clock, value) in self.clocks.iter_mut().zip(row.cells) {
            if !value.is_nan() && !clock.newest_s.is_some_and(|newest_s| is_same(newest_s, t_s)) {
                clock.read_at(t_s);
            }
        }
        self.held.push_back(row);
    }

    fn pop(&mut self) -> Option<Row> {
        let front = self.held.pop_front()?;
        self.count(&front, -1);
        Some(front)
    }

    fn count(&mut self, row: &Row, by: isize) {
        for (count, signal) in self.counts.iter_mut().zip(NEEDED) {
            if !row.get(signal).is_nan() {
                *count = count.saturating_add_signed(by);
            }
        }
    }

    /// Makes the row in front whole, or says that it is bad; none where it is passed over.
    fn whole(&self, row: &mut Row) -> Option<Next> {
        if self.all_whole() && row.has_needed() {
            return Some(Next::Row);
        }
        let readings = |(signal, held): (Signal, usize)| held + usize::from(!row.get(signal).is_nan());
        let lead =
            NEEDED.into_iter().zip(self.counts).min_by_key(|of| readings(*of)).map(|(lead, _)| lead)?;
        if row.get(lead).is_nan() {
            return (!self.is_near(row, lead)).then(|| self.bad(row, lead));
        }
        for signal in NEEDED {
            if row.get(signal).is_nan() {
                match self.between(row, signal) {
                    Some(value) => row.set(signal, value),
                    None if self.is_near(row, signal) => return None,
                    None => return Some(self.bad(row, signal)),
                }
            }
        }
        for signal in Signal::ALL {
            // A port is shut or open until it is said not to be.
            let is_new = row.get(signal).is_nan() && !self.clock(signal).given && signal != Signal::Shut;
            if let Some(value) = is_new.then(|| self.between(row, signal)).flatten() {
                row.set(signal, value);
            }
        }
        if let Some((_, shut)) = self.clock(Signal::Shut).last.filter(|_| row.get(Signal::Shut).is_nan()) {
            row.set(Signal::Shut, shut);
        }
        Some(Next::Row)
    }

    fn bad(&self, row: &Row, signal: Signal) -> Next {
        Next::Bad(missing(row, self.source.layout(), signal))
    }

    fn clock(&self, signal: Signal) -> OwnClock {
        self.clocks.get(signal as usize).copied().unwrap_or_default()
    }

    /// The next reading behind the row in front: its time, s, and value.
    fn next_of(&self, signal: Signal) -> Option<(f64, f64)> {
        let next = self.held.iter().find(|held| !held.get(signal).is_nan())?;
        Some((next.get(Signal::Time), next.get(signal)))
    }

    /// Whether a signal was read shortly before or behind a row.
    fn is_near(&self, row: &Row, signal: Signal) -> bool {
        let (clock, t_s) = (self.clock(signal), row.get(Signal::Time));
        let is_near =
            |read: Option<(f64, f64)>| read.is_some_and(|(at_s, _)| clock.is_near((t_s - at_s).abs()));
        is_near(clock.last) || is_near(self.next_of(signal))
    }

    /// On the straight line between the readings around `row`; none where they are too far apart.
    fn between(&self, row: &Row, signal: Signal) -> Option<f64> {
        let clock = self.clock(signal);
        let (last_s, last) = clock.last?;
        let (next_s, next) = self.next_of(signal)?;
        let step_s = next_s - last_s;
        let share = (row.get(Signal::Time) - last_s) / step_s;
        (step_s > 0.0 && clock.is_near(step_s)).then_some(last + share * (next - last))
    }

    /// Keeps what was read with a row that became `given`, or was passed over.
    fn keep(&mut self, read: &Row, given: Option<&mut Row>) {
        let t_s = read.get(Signal::Time);
        for (place, clock) in self.clocks.iter_mut().enumerate() {
            let is_given =
                given.as_ref().and_then(|given| given.cells.get(place)).is_some_and(|cell| !cell.is_nan());
            match read.cells.get(place).filter(|value| !value.is_nan()) {
                Some(value) => (clock.last, clock.given) = (Some((t_s, *value)), is_given),
                None => clock.given |= is_given,
            }
        }
    }
}

impl RowSource for OwnClocks<'_> {
    fn layout(&self) -> &Layout {
        self.source.layout()
    }

    fn epoch_ns(&self) -> Option<i64> {
        self.source.epoch_ns()
    }

    fn count_from(&mut self, rows: u64) {
        self.source.count_from(rows);
    }

    #[inline]
    fn next_row(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        if self.held.is_empty() && self.behind.is_none() && self.then.is_none() {
            match self.read(row)? {
                Next::Row if row.has_needed() => {
                    self.before.clone_from(row);
                    return Ok(Next::Row);
                }
                Next::Row => self.begin(row.clone()),
                next => return Ok(next),
            }
        }
        self.next_held(row)
    }
}

const NS_PER_S: f64 = 1e9;

/// One of the files.
struct Part {
    rows: Rows,
    /// Its next row, in the recording's time.
    next: Option<Row>,
    ended: bool,
}

/// All of them.
pub(super) struct Joined {
    parts: Vec<Part>,
    layout: Layout,
    /// From which the recording's seconds count, where the files have stamps.
    epoch_ns: Option<i64>,
}

impl Joined {
    /// Opens the files; together they must have what a trace has.
    pub(super) fn open(paths: &[impl AsRef<Path>], rig: &Rig) -> Result<Self, TraceError> {
        let open = |path: &Path| Part::open(path, rig).map_err(|fault| fault.of(&path.display().to_string()));
        let parts = paths.iter().map(|path| open(path.as_ref())).collect::<Result<Vec<_>, _>>()?;
        let whole = |fault: TraceFault| fault.of("the files together");
        let layout = Layout::joined(parts.iter().map(|part| part.rows.layout()));
        layout.check(&rig.columns, &REQUIRED).map_err(whole)?;
        let mut joined = Self { parts, layout, epoch_ns: None };
        joined.begin().map_err(whole)?;
        Ok(joined)
    }

    /// Reads the first rows, and puts all clocks on one.
    fn begin(&mut self) -> Result<(), TraceFault> {
        for part in &mut self.parts {
            // What stands before the first good row is told where rows are asked for.
            while !part.ended && part.next.is_none() {
                part.read(None)?;
            }
        }
        let epochs: Vec<Option<i64>> = self.parts.iter().map(|part| part.rows.epoch_ns()).collect();
        self.epoch_ns = epochs.iter().flatten().min().copied();
        if self.epoch_ns.is_some() && epochs.iter().any(Option::is_none) {
            return Err(TraceFault::Ambiguous {
                what: "some of the files have dates, others seconds".to_owned(),
                settle: "export all with the same clock".to_owned(),
            });
        }
        let epoch_ns = self.epoch_ns;
        for part in &mut self.parts {
            let since_s = part.since_s(epoch_ns);
            if let Some(row) = &mut part.next {
                row.set(Signal::Time, row.get(Signal::Time) + since_s);
            }
        }
        Ok(())
    }
}

impl Part {
    fn open(path: &Path, rig: &Rig) -> Result<Self, TraceFault> {
        let mut rig = rig.clone();
        rig.csv.part = Some(path.file_stem().unwrap_or_default().to_string_lossy().into_owned());
        let file = File::open(path).map_err(TraceFault::Open)?;
        let again = file.try_clone().ok();
        Ok(Self { rows: format::open(Box::new(file), again, &rig)?, next: None, ended: false })
    }

    /// How much later than the recording its own seconds begin, s.
    fn since_s(&self, epoch_ns: Option<i64>) -> f64 {
        let own = self.rows.epoch_ns().zip(epoch_ns);
        own.map_or(0.0, |(own, epoch)| (own - epoch) as f64 / NS_PER_S)
    }

    /// Reads its next row; what is none is given back.
    fn read(&mut self, epoch_ns: Option<i64>) -> Result<Option<Next>, TraceFault> {
        let mut row = Row::empty();
        let next = self.rows.next_row(&mut row)?;
        self.ended = matches!(next, Next::End | Next::CutOff(_));
        match next {
            Next::Row => {
                row.set(Signal::Time, row.get(Signal::Time) + self.since_s(epoch_ns));
                self.next = Some(row);
                Ok(None)
            }
            Next::End => Ok(None),
            other => Ok(Some(other)),
        }
    }
}

impl RowSource for Joined {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn epoch_ns(&self) -> Option<i64> {
        self.epoch_ns
    }

    fn next_row(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        for part in &mut self.parts {
            while !part.ended && part.next.is_none() {
                if let Some(other) = part.read(self.epoch_ns)? {
                    return Ok(other);
                }
            }
        }
        let times = self.parts.iter().filter_map(|part| part.next.as_ref().map(|row| row.get(Signal::Time)));
        let Some(first_s) = times.min_by(f64::total_cmp) else { return Ok(Next::End) };
        let is_now = |next: &mut Row| is_same(next.get(Signal::Time), first_s);
        let now = self.parts.iter_mut().filter_map(|part| part.next.take_if(is_now));
        *row = Row::empty();
        for part in now {
            row.line = part.line;
            row.fill(&part);
        }
        Ok(Next::Row)
    }
}
