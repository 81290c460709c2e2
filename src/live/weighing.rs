//! When a stream's verdict is weighed anew: at once where an alarm was raised or cleared, and soon after; ever more
//! seldom as long as nothing happens.

use crate::explain::Decision;
use crate::replay::Stream;
use serde::{Deserialize, Serialize};

/// After so large a share of the time since something happened the posterior can have changed. Chosen.
const SHARE: f64 = 0.2;
/// At least, and at most, s. Chosen.
const BOUNDS_S: (f64, f64) = (1.0, 60.0);

/// The last decision on a stream.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Weighing {
    decision: Option<Decision>,
    /// Times of it, and of the first sample or the last alarm, s.
    at_s: Option<f64>,
    since_s: Option<f64>,
}

impl Weighing {
    /// The decision as it stands.
    pub fn decision(&self) -> Option<&Decision> {
        self.decision.as_ref()
    }

    /// Decides anew where that is due.
    pub fn renew(&mut self, stream: &Stream) {
        let Some(t_s) = stream.time_s() else { return };
        let since_s = *self.since_s.get_or_insert(t_s);
        let (least_s, most_s) = BOUNDS_S;
        let pause_s = (SHARE * (t_s - since_s)).clamp(least_s, most_s);
        if self.at_s.is_none_or(|at_s| !(0.0..pause_s).contains(&(t_s - at_s))) {
            self.weigh(stream, t_s);
        }
    }

    /// Decides anew after something happened.
    pub fn renew_now(&mut self, stream: &Stream) {
        let Some(t_s) = stream.time_s() else { return };
        self.since_s = Some(t_s);
        self.weigh(stream, t_s);
    }

    /// Whether the decision is of the last sample.
    pub fn is_of_now(&self, stream: &Stream) -> bool {
        self.at_s == stream.time_s()
    }

    fn weigh(&mut self, stream: &Stream, t_s: f64) {
        self.decision = stream.decision();
        self.at_s = Some(t_s);
    }
}
