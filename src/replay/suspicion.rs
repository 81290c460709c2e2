//! Does a mistake of wiring explain what was read, which the posterior can't tell?

use super::Replay;
use super::draft::Weighed;
use crate::channels::ChannelFaultKind;
use crate::explain::Decision;
use crate::report::Status;
use crate::rig::ColumnMap;
use crate::wiring::{
    Excerpt, Explanation, Mistake, Recorded, Running, Wiring, exchanged_by_force, explain, unit_by_scatter,
};

impl Weighed {
    /// No wiring explains what such a channel reads.
    fn has_broken_channel(&self) -> bool {
        self.channels.iter().any(|fault| fault.kind != ChannelFaultKind::Coarse)
    }
}

impl Replay {
    /// What an excerpt of the whole trace, whose columns were read by `columns`, tells beside `decision`: units by the
    /// readings' scatter, exchanged pressures by the load force, and, where sensors and rig as declared don't explain the trace, what
    /// is no linear map of the readings: a lost sign.
    pub(super) fn wiring(
        &self,
        decision: Option<&Decision>,
        weighed: &Weighed,
        excerpt: &Excerpt,
        columns: &ColumnMap,
    ) -> Option<Wiring> {
        if weighed.has_broken_channel() {
            return None;
        }
        let found = unit_by_scatter(excerpt, &self.rig).or_else(|| {
            let records = excerpt.records();
            let whole = Recorded::new(&records, &self.rig)?;
            let (is_sure, is_plain) = decision.map_or((false, false), |decision| {
                (decision.status.is_sure(), decision.as_declared && decision.misfit < PLAIN_MISFIT)
            });
            if is_plain && decision.is_some_and(|decision| decision.status != Status::Doubtful) {
                return exchanged_by_force(&whole);
            }
            explain(&whole).filter(|found| !(is_sure && found.mistakes.iter().any(is_lag)))
        });
        found.map(|found: Explanation| found.wiring(columns, &self.rig))
    }

    /// What a stream's evidence so far tells.
    pub(super) fn wiring_so_far(&self, weighed: &Weighed, evidence: &Running) -> Option<Wiring> {
        if weighed.has_broken_channel() {
            return None;
        }
        evidence.explanation(&self.rig).map(|found| found.wiring(&self.rig.columns, &self.rig))
    }
}

/// Below this noise scale sensors and rig as declared explain a trace. A guess.
const PLAIN_MISFIT: f64 = 1.2;

/// A lag is weighed by the posterior.
fn is_lag(mistake: &Mistake) -> bool {
    matches!(mistake, Mistake::Late(..))
}
