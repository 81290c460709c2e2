//! What blocks make of the segments, and nothing else does: the same blocks make the same segments, to the last bit.

use super::block_sums::Block;
use super::change::SEGMENT_BLOCKS;
use super::gram::{AGED, Segment};
use super::statistic::ContinuityStatistic;
use crate::Real;

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
