//! A hold test as a replay's report.

use super::outcome::HoldTest;
use crate::presence;
use crate::report::{ReplayReport, Status, TraceSummary};
use crate::rig::Rig;

impl HoldTest {
    /// Whether a report on holds is worth telling: where the spool shuts the ports by itself it often rests, and mostly too shortly.
    pub(crate) fn tells(report: &ReplayReport, rig: &Rig) -> bool {
        report.verdict.status != Status::NotSure
            || rig.valve.as_ref().is_none_or(|valve| valve.shut_below.is_none())
    }

    /// The report on a trace that is a hold test.
    pub fn report(&self, trace: TraceSummary, rig: &Rig) -> ReplayReport {
        let found = self.fit.as_ref().map(|fit| &fit.found);
        presence::report(trace, rig, found, self.verdict(rig), Some(self.summary))
    }
}
