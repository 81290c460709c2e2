//! What a saved replay lacks: the blocks that came since. Segments follow from blocks alone and are a hundred times larger,
//! so that a checkpoint need not hold them.

use super::Replay;
use crate::explain::{SEGMENTS, Statistic};
use pitchleak_core::continuity::{Block, Segment};
use serde::{Deserialize, Serialize};

/// So many take as much memory as the segments: beyond them those are as soon written.
pub(super) const MOST: usize = SEGMENTS * size_of::<Segment<f64>>() / size_of::<Block<f64>>();

/// Blocks in their order.
#[derive(Serialize, Deserialize)]
pub(crate) struct Fresh {
    /// How many came before them.
    before: u64,
    blocks: Vec<Block<f64>>,
}

impl Replay {
    /// How many blocks came, those that are fresh left out, and with them.
    pub(super) fn blocks(&self) -> [u64; 2] {
        let taken = self.statistic.taken();
        [taken.saturating_sub(self.fresh.len() as u64), taken]
    }

    /// Begins to gather blocks anew: somebody has those so far.
    pub(super) fn forget_fresh(&mut self) {
        self.fresh = Vec::new();
    }

    /// Leaves it without segments; what they lack that were there before the fresh blocks.
    pub(super) fn take_fresh(&mut self) -> Fresh {
        let [before, _] = self.blocks();
        let mut none = Box::new(Statistic::new(&self.rig.cylinder, &self.rig.fluid, &self.rig.sensors()));
        self.statistic.swap_segments(&mut none);
        Fresh { before, blocks: std::mem::take(&mut self.fresh) }
    }

    /// Takes these blocks in, for its segments alone; says whether they are the next.
    pub(super) fn take_blocks(&mut self, fresh: &Fresh) -> bool {
        let are_next = self.statistic.taken() == fresh.before;
        if are_next {
            fresh.blocks.iter().for_each(|block| self.statistic.take(block));
        }
        are_next
    }

    /// Gives it the segments that another one's blocks have made.
    pub(super) fn adopt_segments(&mut self, mut from: Self) {
        self.statistic.swap_segments(&mut from.statistic);
    }
}
