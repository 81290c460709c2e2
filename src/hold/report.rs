//! A hold test as a replay's report.

use super::outcome::HoldTest;
use crate::presence;
use crate::report::{ReplayReport, TraceSummary};
use crate::rig::Rig;

impl HoldTest {
    /// The report on a trace that is a hold test.
    pub fn report(&self, trace: TraceSummary, rig: &Rig) -> ReplayReport {
        let found = self.fit.as_ref().map(|fit| &fit.found);
        presence::report(trace, rig, found, self.verdict(rig), Some(self.summary))
    }
}
