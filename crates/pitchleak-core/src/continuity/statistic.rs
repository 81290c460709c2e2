//! The sufficient statistic of the continuity equations: Gram matrices of their whitened rows, by segments of the trace.
//!
//! Whatever is linear in the raw sums can be asked of them afterwards: a zero, gain, lag or area set free, an exchange of
//! columns. Memory is constant: where all segments are full, those two neighbours become one that differ least.
//!
//! What blocks make of the segments, and nothing else does: the same blocks make the same segments, to the last bit.

use super::block_sums::{Block, BlockSums};
use super::change::{SEGMENT_BLOCKS, Waiting};
use super::clocks::{self, Clocks, Next, Readings};
use super::gram::{AGED, Segment};
use super::noise::Scatter;
use super::whitening::Whitener;
use crate::number::Filled;
use crate::{Cylinder, Fluid, PerLeak, Real, Sample, Sensors, signed_root};

/// The statistic, in at most `S` segments.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub struct ContinuityStatistic<T, const S: usize> {
    clocks: Clocks<T>,
    /// The last row, and its step, s.
    last: Option<Sample<T>>,
    step_s: T,
    blocks: BlockSums<T>,
    pub(super) waiting: Waiting<T>,
    pub(super) whitener: Whitener<T>,
    pub(super) segments: Filled<Segment<T>, S>,
    /// Blocks that were taken in.
    pub(super) taken: u64,
    /// What is longer ago than this may be forgotten, s.
    horizon_s: T,
    scatter: [Scatter<T>; CHANNELS],
    time_s: T,
    roots: PerLeak<T>,
}

/// A flow without a reading for so long rests, until its own step is known; as long as two blocks. Chosen.
const LONGEST_SILENCE_S: f64 = 0.5;

/// Channels whose scatter is watched: position, P_A, P_B, Q_A, Q_B.
pub const CHANNELS: usize = 5;

impl<T: Real, const S: usize> ContinuityStatistic<T, S> {
    /// No reading yet.
    pub fn new(cylinder: &Cylinder<T>, fluid: &Fluid<T>, sensors: &Sensors<T>) -> Self {
        Self {
            clocks: Clocks::new(T::lit(LONGEST_SILENCE_S)),
            last: None,
            step_s: T::zero(),
            blocks: BlockSums::new(cylinder, fluid),
            waiting: Waiting::new(cylinder, sensors),
            whitener: Whitener::new(cylinder, fluid, sensors),
            segments: Filled::new(),
            taken: 0,
            horizon_s: T::max_value(),
            scatter: [Scatter::default(); CHANNELS],
            time_s: T::zero(),
            roots: PerLeak::default(),
        }
    }

    /// Of a stream: forgets what is longer ago than `horizon_s`, as soon as its place is needed.
    #[must_use]
    pub fn forgetting(self, horizon_s: T) -> Self {
        Self { horizon_s, ..self }
    }

    /// Takes in a reading that comes `dt_s` after the one before, or after a pause where that is not positive.
    pub fn push(&mut self, dt_s: T, sample: &Sample<T>) {
        self.push_each(dt_s, sample, &mut |_| ());
    }

    /// The same; `each` gets the blocks that it ends, as the segments take them in.
    pub fn push_each(&mut self, dt_s: T, sample: &Sample<T>, each: &mut impl FnMut(&Block<T>)) {
        let after_gap = dt_s <= T::zero();
        for (scatter, reading) in self.scatter.iter_mut().zip(sample.readings()) {
            scatter.add(reading, after_gap);
        }
        if !after_gap {
            let pressures = PerLeak {
                internal: sample.load_pressure_pa(),
                external_a: sample.pa_pa,
                external_b: sample.pb_pa,
            };
            self.time_s += dt_s;
            self.roots = self.roots.zip(pressures).map(|(sum, p)| sum + dt_s * signed_root(p).abs());
        }
        self.place(dt_s, sample, each);
    }

    /// Brings flows that are not read with every sample to the samples' times.
    fn place(&mut self, dt_s: T, sample: &Sample<T>, each: &mut impl FnMut(&Block<T>)) {
        if dt_s <= T::zero() {
            self.clocks.begin_anew();
            self.step_s = T::zero();
        } else if !self.clocks.is_empty() || self.waits_for(sample) {
            if let Some(last) = self.last.filter(|_| self.clocks.is_empty()) {
                self.clocks.go_on_after(&last, Some(self.step_s).filter(|step_s| *step_s > T::zero()));
            }
            self.step_s = T::zero();
            self.clocks.push(dt_s, &Readings::from(sample));
            return self.take_waiting(each);
        } else {
            // A flow that was not read before has another step than the rows.
            self.step_s = if self.follows(sample) { dt_s } else { T::zero() };
        }
        self.take_row(&clocks::Row::read(dt_s, sample), each);
    }

    /// Whether a flow has no reading after one that had.
    fn waits_for(&self, now: &Sample<T>) -> bool {
        let is_missing = |last: Option<T>, now: Option<T>| last.is_some() && now.is_none();
        self.last
            .is_some_and(|last| is_missing(last.qa_m3s, now.qa_m3s) || is_missing(last.qb_m3s, now.qb_m3s))
    }

    /// Whether each flow that is read was read with the row before, too.
    fn follows(&self, now: &Sample<T>) -> bool {
        let follows = |last: Option<T>, now: Option<T>| last.is_some() || now.is_none();
        self.last.is_some_and(|last| follows(last.qa_m3s, now.qa_m3s) && follows(last.qb_m3s, now.qb_m3s))
    }

    #[cold]
    fn take_waiting(&mut self, each: &mut impl FnMut(&Block<T>)) {
        loop {
            match self.clocks.pop() {
                Next::Waits => return,
                Next::Gap => self.last = None,
                Next::Row(row) => self.take_row(&row, each),
            }
        }
    }

    fn take_row(&mut self, row: &clocks::Row<T>, each: &mut impl FnMut(&Block<T>)) {
        self.last = Some(row.sample);
        if let Some(block) = self.blocks.push(row) {
            self.take(&block);
            each(&block);
        }
    }

    /// Mean root of that size, √Pa.
    pub fn mean_roots(&self) -> PerLeak<T> {
        self.roots.map(|sum| sum / self.time_s)
    }

    /// Standard deviation of each channel's readings as their third differences tell it; the motion's share in those is
    /// small but for slow sampling.
    pub fn scatter(&self) -> [Option<T>; CHANNELS] {
        self.scatter.map(|scatter| scatter.std())
    }
}

impl<T: Real, const S: usize> ContinuityStatistic<T, S> {
    /// The segments so far, oldest first.
    pub fn segments(&self) -> &[Segment<T>] {
        self.segments.all()
    }

    /// How many blocks were taken in.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Exchanges the segments, and the blocks that wait for theirs, with those of another statistic.
    pub fn swap_segments(&mut self, other: &mut Self) {
        core::mem::swap(&mut self.waiting, &mut other.waiting);
        core::mem::swap(&mut self.whitener, &mut other.whitener);
        core::mem::swap(&mut self.segments, &mut other.segments);
        core::mem::swap(&mut self.taken, &mut other.taken);
    }

    /// Length of all segments but the first.
    fn later_s(&self) -> T {
        self.segments().iter().skip(1).fold(T::zero(), |sum, segment| sum + segment.time_s())
    }

    /// Takes in the next block.
    pub fn take(&mut self, block: &Block<T>) {
        self.taken = self.taken.saturating_add(1);
        if block.begins_at.is_some() {
            self.close();
        }
        self.waiting.add(block);
        if self.waiting.is_full() {
            match self.waiting.change() {
                // The block in which a flow changed is of neither level.
                Some(at) => self.end_segment(at, 1),
                None => self.end_segment(SEGMENT_BLOCKS, 0),
            }
        }
    }

    /// Takes the blocks that still wait for their segment into one, for a verdict: of a statistic that goes on, close a copy.
    pub fn close(&mut self) {
        if let Some(at) = self.waiting.change() {
            self.end_segment(at, 1);
        }
        self.end_segment(self.waiting.blocks().len(), 0);
    }

    /// Makes a segment of the oldest waiting blocks; of some that follow only the time counts.
    fn end_segment(&mut self, blocks: usize, left_out: usize) {
        if blocks == 0 {
            return;
        }
        self.begin_segment();
        for place in 0..blocks + left_out {
            let Some(block) = self.waiting.blocks().get(place).copied() else { break };
            if place < blocks {
                self.add(&block);
            } else if let Some(segment) = self.segments.last_mut() {
                segment.pass(&block);
            }
        }
        self.waiting.release(blocks + left_out);
    }

    fn add(&mut self, block: &Block<T>) {
        let mut block = *block;
        let Some(segment) = self.segments.last_mut() else { return };
        for (aged, plain) in AGED {
            block.sums[aged as usize] += segment.time_s() * block.sums[plain as usize];
        }
        segment.add(&self.whitener.push(&block), &block);
    }

    /// Makes room where there is none; a segment's noise is independent of that of those before.
    fn begin_segment(&mut self) {
        if self.segments.is_full() && self.later_s() >= self.horizon_s {
            self.segments.remove(0, 1);
        }
        if self.segments.is_full() {
            self.merge_cheapest();
        }
        self.segments.push(Segment::default());
        self.whitener.begin_anew();
    }

    fn merge_cheapest(&mut self) {
        let neighbours = self.segments().iter().zip(self.segments().iter().skip(1)).enumerate();
        let (place, _, next) = neighbours.map(|(place, (one, next))| (place, one.cost(next), next)).fold(
            (0, T::infinity(), None),
            |best, (place, cost, next)| {
                if cost < best.1 || best.2.is_none() { (place, cost, Some(*next)) } else { best }
            },
        );
        if let (Some(one), Some(next)) = (self.segments.get_mut(place), next) {
            one.append(&next);
            self.segments.remove(place + 1, 1);
        }
    }
}
