//! What a trace tells of mistakes of wiring beside the continuity equations, in constant memory: its load force, flows that
//! are never negative, and how far its readings reach.

mod block;
mod force;
mod signs;

pub(crate) use block::Gatherer;
pub use force::ForceBalance;
pub(crate) use force::{ForceSums, Scaled};

use crate::rig::Rig;
use crate::signal::Signal;
use crate::trace::Record;
use block::Block;
use serde::{Deserialize, Serialize};
use signs::SignSums;

/// Of a whole trace, or of the last minute or two of a stream.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Beside {
    gatherer: Gatherer,
    /// The stretch that goes on, and the one before it.
    now: Stretch,
    before: Stretch,
    /// Blocks of a stretch.
    most_blocks: u32,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Stretch {
    blocks: u32,
    force: ForceSums,
    signs: SignSums,
    extremes: [Option<[f64; 2]>; CHANNELS.len()],
}

/// In the order of [`Sample::readings`](pitchleak_core::Sample::readings).
pub(crate) const CHANNELS: [Signal; 5] =
    [Signal::Position, Signal::PressureA, Signal::PressureB, Signal::FlowA, Signal::FlowB];
/// A minute, or longer where samples come so slowly that a block does.
const STRETCH_BLOCKS: u32 = 240;

impl Default for Beside {
    fn default() -> Self {
        Self {
            gatherer: Gatherer::default(),
            now: Stretch::default(),
            before: Stretch::default(),
            most_blocks: u32::MAX,
        }
    }
}

impl Beside {
    /// Of a stream: forgets what is longer ago than two minutes.
    #[must_use]
    pub fn forgetting(self) -> Self {
        Self { most_blocks: STRETCH_BLOCKS, ..self }
    }

    /// Takes in the next record.
    #[inline]
    pub fn add(&mut self, record: &Record, rig: &Rig) {
        if let Some(block) = self.gatherer.add(record) {
            self.take(&block, rig);
        }
    }

    fn take(&mut self, block: &Block, rig: &Rig) {
        if self.now.blocks >= self.most_blocks {
            self.before = std::mem::take(&mut self.now);
        }
        self.now.add(block, rig);
    }

    /// So far.
    pub fn told(&self, rig: &Rig) -> Told {
        let (now, before) = (&self.now, &self.before);
        let extremes = std::array::from_fn(|channel| {
            let both = [now.extremes[channel], before.extremes[channel]];
            both.into_iter().flatten().reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
        });
        Told {
            force: now.force.with(&before.force).balance(rig),
            extremes,
            signs: now.signs.with(&before.signs).found(),
        }
    }
}

impl Stretch {
    fn add(&mut self, block: &Block, rig: &Rig) {
        self.blocks = self.blocks.saturating_add(1);
        self.force.add(block);
        self.signs.add(block, rig);
        for (extremes, mean) in self.extremes.iter_mut().zip(block.means) {
            if let Some(mean) = mean {
                let [least, most] = extremes.unwrap_or([mean; 2]);
                *extremes = Some([least.min(mean), most.max(mean)]);
            }
        }
    }
}

/// What was told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Told {
    /// The balance of the load force, where it was measured.
    pub force: Option<ForceBalance>,
    /// Least and largest mean over a block of x, P_A, P_B, Q_A and Q_B, SI; none of what was not read.
    pub extremes: [Option<[f64; 2]>; CHANNELS.len()],
    /// Of Q_A and Q_B.
    pub signs: [Unsigned; 2],
}

/// Whether a flow may be one of which the size alone was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unsigned {
    /// It was read, and never negative.
    pub is_unsigned: bool,
    /// ln of how much likelier it is as the size of the piston's flow than as that flow; none where the piston did not move
    /// both ways, or the flow was negative.
    pub ln_lost: Option<f64>,
}
