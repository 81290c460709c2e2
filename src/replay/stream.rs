use super::state::{self, RestoreError};
use super::{Replay, ReplayError};
use crate::explain::{Decision, SEGMENTS, Statistic};
use crate::hold::{self, Recorder};
use crate::report::{Alarm, ReplayReport, TraceSummary};
use crate::rig::{ColumnMap, Rig};
use crate::times::{Clock, TimeFormat};
use crate::trace::{
    BadRow, BadRows, LineLayout, LineRead, Record, RowValidator, TraceError, TraceFault, TraceReader,
    read_line,
};
use crate::valve::ValveStream;
use crate::wiring::{Refused, Wiring};
use pitchleak_core::continuity::{Block, Segment};
use serde::{Deserialize, Serialize};

/// So many fresh blocks take as much memory as the segments: beyond them those are as soon written.
pub(super) const MOST_FRESH: usize = SEGMENTS * size_of::<Segment<f64>>() / size_of::<Block<f64>>();

/// What a saved stream lacks: the blocks that came since, in their order. Segments follow from blocks alone and are a hundred
/// times larger, so that a checkpoint need not hold them.
#[derive(Serialize, Deserialize)]
pub(crate) struct Fresh {
    /// How many came before them.
    before: u64,
    blocks: Vec<Block<f64>>,
}

/// What became of a line.
#[derive(Clone, Debug, PartialEq)]
pub enum Taken {
    /// It is in the estimates; says whether they are new.
    Good {
        /// Whether the estimates are new.
        renewed: bool,
    },
    /// It was counted and left out.
    Bad(BadRow),
}

/// A replay whose trace comes in parts, as in live operation: the parts together give what the whole trace
/// would, to the last bit.
#[derive(Clone, Serialize, Deserialize)]
pub struct Stream {
    replay: Replay,
    validator: Option<RowValidator>,
    bad_rows: BadRows,
    /// While rows are refused as out of range.
    #[serde(default)]
    refused: Option<Box<Refused>>,
    /// From the first shut port on.
    #[serde(default)]
    holds: Option<Recorder>,
    /// Of a rig whose valve is calibrated, until a flow is read.
    #[serde(default)]
    valve: Option<ValveStream>,
    /// Whether a valve's spool was ever read.
    #[serde(default)]
    has_spool: bool,
    /// Where time stamps count from, ns since 1970, for a caller that reads them: it is saved with the rest.
    pub epoch_ns: Option<i64>,
}

impl Stream {
    /// All that the stream knows, to the last bit, rig included, and a checksum.
    ///
    /// # Errors
    /// None in practice: every part has its form.
    pub fn save(&self) -> Result<Vec<u8>, RestoreError> {
        state::write(self)
    }

    /// The stream that [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// [`RestoreError`], where a single bit is another, too.
    pub fn restore(bytes: &[u8]) -> Result<Self, RestoreError> {
        let stream: Self = state::read(bytes)?;
        if stream.replay.fits_its_rig() && stream.validator_fits() {
            Ok(stream)
        } else {
            Err(RestoreError::Content("its parts don't fit each other".to_owned()))
        }
    }

    /// Goes on from a saved state where its rig is this one, by whatever name.
    ///
    /// # Errors
    /// [`RestoreError`].
    pub fn restore_for(bytes: &[u8], rig: &Rig) -> Result<Self, RestoreError> {
        let stream = Self::restore(bytes)?;
        if stream.rig().to_toml() == rig.to_toml() {
            return Ok(stream);
        }
        Err(RestoreError::Rig { saved: stream.rig().name.clone(), wanted: rig.name.clone() })
    }

    /// How many blocks came, those that are fresh left out, and with them.
    pub(crate) fn blocks(&self) -> [u64; 2] {
        let taken = self.replay.statistic.taken();
        [taken.saturating_sub(self.replay.fresh.len() as u64), taken]
    }

    /// Begins to gather blocks anew: a checkpoint has those so far.
    pub(crate) fn forget_fresh(&mut self) {
        self.replay.fresh = Vec::new();
    }

    /// Leaves it without segments; what they lack that were there before the fresh blocks.
    pub(crate) fn take_fresh(&mut self) -> Fresh {
        let [before, _] = self.blocks();
        let rig = self.rig();
        let mut none = Box::new(Statistic::new(&rig.cylinder, &rig.fluid, &rig.sensors()));
        self.replay.statistic.swap_segments(&mut none);
        Fresh { before, blocks: std::mem::take(&mut self.replay.fresh) }
    }

    /// Takes these blocks in, for its segments alone; says whether they are the next.
    pub(crate) fn take_blocks(&mut self, fresh: &Fresh) -> bool {
        let are_next = self.replay.statistic.taken() == fresh.before;
        if are_next {
            fresh.blocks.iter().for_each(|block| self.replay.statistic.take(block));
        }
        are_next
    }

    /// Gives it the segments that another one's blocks have made.
    pub(crate) fn adopt_segments(&mut self, mut from: Self) {
        self.replay.statistic.swap_segments(&mut from.replay.statistic);
    }

    /// Whether rows are held against what this rig may read.
    fn validator_fits(&self) -> bool {
        self.validator.as_ref().is_none_or(|validator| validator.is_for(self.rig()))
    }

    /// The rig that the stream runs for.
    pub fn rig(&self) -> &Rig {
        self.replay.rig()
    }

    /// A stream for a rig.
    ///
    /// # Errors
    /// As [`Replay::new`], and where the calibration of the rig's valve cannot be used.
    pub fn new(rig: &Rig, bad_rows: BadRows) -> Result<Self, ReplayError> {
        Ok(Self {
            replay: Replay::new(rig)?.forgetting(),
            validator: None,
            bad_rows,
            refused: None,
            holds: None,
            valve: ValveStream::of(rig).map_err(Box::new)?,
            has_spool: false,
            epoch_ns: None,
        })
    }

    /// What becomes of bad rows.
    pub fn bad_rows(&self) -> BadRows {
        self.bad_rows
    }

    /// Takes in the next part of the trace; says how often the estimates were renewed.
    ///
    /// # Errors
    /// Where a bad row is fatal, or the part cannot be read on: what came before it is taken in. A part
    /// without a good row is no error.
    pub fn extend(&mut self, part: TraceReader<'_>) -> Result<u64, TraceError> {
        let mut reader = match self.validator.take() {
            Some(before) => part.resuming(before),
            None => part.with_bad_rows(self.bad_rows),
        };
        let mut record = Record::default();
        let mut renewals = 0;
        let columns = reader.columns(&self.rig().columns);
        let ended = loop {
            match reader.next_record_or(&mut record, |row| self.refuse(row, |_| columns.clone())) {
                Ok(true) => renewals += u64::from(self.push(&record)),
                Ok(false) | Err(TraceError { fault: TraceFault::NoRows { .. }, .. }) => break Ok(renewals),
                Err(error) => break Err(error),
            }
        };
        self.validator = Some(reader.into_validator());
        ended
    }

    /// Takes in one record; says whether the estimates are new.
    fn push(&mut self, record: &Record) -> bool {
        let renewed = self.replay.push(record);
        let judged = ValveStream::record(&mut self.valve, record, &self.replay.rig, &mut self.replay.alarms);
        self.has_spool |= record.valve.is_some();
        Recorder::record(&mut self.holds, record, &self.replay.rig);
        self.holds.iter_mut().for_each(Recorder::keep_last);
        if self.refused.as_ref().is_some_and(|refused| refused.is_over(record.t_s)) {
            self.refused = None;
        }
        if let Some(refused) = &mut self.refused {
            refused.add(record);
        }
        renewed || judged
    }

    /// Takes in one line of a live feed, the `line`th: its cells, as `layout` names them.
    ///
    /// # Errors
    /// Where a bad row is fatal.
    pub fn take_line(
        &mut self,
        layout: &LineLayout,
        line: u64,
        cells: &[&[u8]],
    ) -> Result<Taken, TraceFault> {
        let (rig, bad_rows) = (self.replay.rig(), self.bad_rows);
        let validator = self.validator.get_or_insert_with(|| layout.validator(rig, bad_rows));
        let mut record = Record::default();
        Ok(match read_line(layout, line, cells, &mut self.epoch_ns, validator, &mut record)? {
            LineRead::Good => Taken::Good { renewed: self.push(&record) },
            LineRead::Bad(bad, row) => {
                row.iter().for_each(|row| self.refuse(row, |map| layout.columns(map)));
                Taken::Bad(bad)
            }
        })
    }

    /// Keeps what a row that was refused as out of range says of its unit.
    #[cold]
    fn refuse(&mut self, row: &Record, columns: impl Fn(&ColumnMap) -> ColumnMap) {
        let rig = self.replay.rig();
        let none = || Box::new(Refused::new(rig, &columns(&rig.columns)));
        self.refused.get_or_insert_with(none).add_refused(row);
    }

    /// The unit, or the slipped decimal point, that brings within range what rows are refused for.
    pub fn refused_for(&self) -> Option<Wiring> {
        self.refused.as_ref()?.wiring()
    }

    /// Time of the last row, also of one out of range, s.
    pub(crate) fn seen_s(&self) -> Option<f64> {
        let refused_s = self.refused.as_ref().and_then(|refused| refused.last_s());
        [self.time_s(), refused_s].into_iter().flatten().reduce(f64::max)
    }

    /// Time of the last good row, s; none before the first.
    pub fn time_s(&self) -> Option<f64> {
        self.validator.as_ref().and_then(RowValidator::time_s)
    }

    /// The alarms so far; they and all but the last episodes of each leak are dropped: a stream without end would grow with them.
    pub(crate) fn take_alarms(&mut self) -> Vec<Alarm> {
        self.replay.take_alarms()
    }

    /// The running replay.
    pub fn replay(&self) -> &Replay {
        &self.replay
    }

    /// The report on the last [hold test](crate::hold) that has ended since this was asked last; none where none did.
    pub fn ended_hold(&mut self, name: &str) -> Option<ReplayReport> {
        let hold = self.holds.as_mut()?.ended(&self.replay.rig)?;
        Some(hold.report(self.summary(name)?, self.rig()))
    }

    /// The same of the hold that goes on, as far as it is.
    pub fn hold_so_far(&self, name: &str) -> Option<ReplayReport> {
        let holds = self.holds.as_ref().filter(|_| self.replay.rests)?;
        let hold = holds.clone().finish(self.rig())?;
        Some(hold.report(self.summary(name)?, self.rig()))
    }

    /// What explains the last twenty minutes or so; none where they say too little.
    pub fn decision(&self) -> Option<Decision> {
        self.replay.decision().map(|decision| decision.read_by(&self.rig().columns, self.rig()))
    }

    /// Weighs the same anew where that is due.
    pub(crate) fn renew(&mut self) {
        if let Some(t_s) = self.time_s() {
            self.replay.renew(t_s);
        }
    }

    /// As it was weighed last, …
    pub(crate) fn weighed(&self) -> Option<&Decision> {
        self.replay.weighing.decision.as_ref()
    }

    /// … and when, s.
    pub(crate) fn weighed_s(&self) -> Option<f64> {
        self.replay.weighing.at_s
    }

    /// The report as it stands, its verdict held against the last twenty minutes or so; `name` is the trace's. None before the
    /// first part.
    pub fn report(&self, name: &str) -> Option<ReplayReport> {
        self.report_as(name, self.decision().as_ref())
    }

    /// The report with a decision that was made before.
    pub(crate) fn report_as(&self, name: &str, decision: Option<&Decision>) -> Option<ReplayReport> {
        let (summary, quality) = (self.summary(name)?, self.validator.as_ref()?.quality());
        if let Some(test) = self.valve.as_ref().and_then(|valve| valve.test(self.rig())) {
            let report = test.report(summary, self.rig());
            return Some(ReplayReport { alarms: self.replay.alarms.clone(), ..report });
        }
        let weighed = self.replay.last_stretch();
        let refused = self.refused_for().filter(|_| quality.is_mostly_bad());
        let wiring = refused.or_else(|| weighed.wiring(decision, &self.rig().columns, self.rig()));
        let mut report = self.replay.report_with(summary, weighed, decision, wiring);
        hold::advise(&mut report, quality, self.has_spool, self.rig());
        Some(report)
    }

    fn summary(&self, name: &str) -> Option<TraceSummary> {
        let quality = self.validator.as_ref()?.quality();
        let begins = self.epoch_ns.and_then(|first_ns| Clock::new(first_ns, &TimeFormat::default()));
        Some(TraceSummary { begins, ..TraceSummary::new(name, quality) })
    }
}
