//! Do model and declared noise explain what was read? Means of ν²/S over the whole trace: about 1 where they do.

use pitchleak_core::Innovation;
use serde::{Deserialize, Serialize};

/// An innovation larger than this, in its own variance, counts as this: one spike is no misfit.
const LARGEST: f64 = 16.0;
/// Renewals of a stretch, after which channels are judged anew: ten minutes, or longer where samples come so slowly that a
/// renewal does.
const STRETCH_RENEWALS: u32 = 1200;

/// Sums over the trace, a few instructions per block.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Consistency {
    balance: Mean,
    position: Mean,
    restarts: u64,
    /// Of this stretch.
    renewals: u32,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Mean {
    sum: f64,
    count: u64,
}

impl Mean {
    fn add(&mut self, ratio: f64) {
        self.sum += ratio.min(LARGEST);
        self.count += 1;
    }

    fn value(&self) -> f64 {
        if self.count > 0 { self.sum / self.count as f64 } else { 0.0 }
    }
}

impl Consistency {
    /// Takes an innovation of the flow balance.
    pub fn balance(&mut self, Innovation { value, variance }: Innovation<f64>) {
        self.balance.add(value * value / variance);
    }

    /// Takes the position equation's ν²/S as the estimator has it after a renewal.
    pub fn position(&mut self, ratio: f64) {
        self.position.add(ratio);
    }

    /// Counts a renewal; says whether it is the first of the next stretch.
    pub fn is_next_stretch(&mut self) -> bool {
        let is_full = self.renewals >= STRETCH_RENEWALS;
        self.renewals = if is_full { 1 } else { self.renewals + 1 };
        is_full
    }

    /// The estimates began anew.
    pub fn restarted(&mut self) {
        self.restarts += 1;
    }

    /// How often they did.
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// Of the flow balance and of the position.
    pub fn ratios(&self) -> [f64; 2] {
        [self.balance.value(), self.position.value()]
    }
}
