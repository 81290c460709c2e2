//! When the posterior is weighed anew while records come.

use crate::explain::Decision;
use serde::{Deserialize, Serialize};

/// After so large a share of the time since something happened the posterior can have changed. Chosen.
const SHARE: f64 = 0.2;
/// At least, and at most, s. Chosen.
const BOUNDS_S: (f64, f64) = (1.0, 60.0);

/// The last decision: weighed anew at once where an alarm was raised or cleared, and soon after; ever more seldom as long as nothing happens.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Weighing {
    /// As it stands.
    pub decision: Option<Decision>,
    /// Times of it, and of the first record or the last alarm, s.
    pub at_s: Option<f64>,
    since_s: Option<f64>,
}

impl Weighing {
    /// Something happened now.
    pub fn alarmed(&mut self, t_s: f64) {
        (self.at_s, self.since_s) = (None, Some(t_s));
    }

    /// Whether to decide anew.
    pub fn is_due(&mut self, t_s: f64) -> bool {
        let since_s = *self.since_s.get_or_insert(t_s);
        let (least_s, most_s) = BOUNDS_S;
        let pause_s = (SHARE * (t_s - since_s)).clamp(least_s, most_s);
        self.at_s.is_none_or(|at_s| !(0.0..pause_s).contains(&(t_s - at_s)))
    }

    /// Keeps what was decided now.
    pub fn set(&mut self, t_s: f64, decision: Option<Decision>) {
        (self.decision, self.at_s) = (decision, Some(t_s));
    }
}
