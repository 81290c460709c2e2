//! What a hold test found, and its report.

use super::fit::{Fit, fit, usable};
use super::recorder::{EndedBy, Held, Reading, Recorder};
use crate::presence::{self, FoundLeak};
use crate::report::{ReplayReport, Status, TraceSummary};
use crate::rig::Rig;
use pitchleak_core::PerLeak;
use serde::Serialize;

/// How much of a trace was a hold test, and what it could find.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HoldSummary {
    /// Usable time, of all holds of the trace together, s.
    pub usable_s: f64,
    /// What ended the longest of them.
    pub ended_by: EndedBy,
    /// How many there are.
    pub holds: usize,
    /// Each leak; none where nothing was usable.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaks: Option<PerLeak<FoundLeak>>,
}

/// A finished hold test.
#[derive(Clone, Debug)]
pub struct HoldTest {
    pub(super) summary: HoldSummary,
    pub(super) fit: Option<Fit>,
    /// P_A and P_B never change by a digit.
    pub(super) frozen: [bool; 2],
}

impl Recorder {
    /// The hold test of a trace of this rig; none where the ports were never shut.
    pub fn finish(self, rig: &Rig) -> Option<HoldTest> {
        HoldTest::of(&self.holds(), rig)
    }

    /// The hold test that has ended since this was asked last; none where none did.
    pub fn ended(&mut self, rig: &Rig) -> Option<HoldTest> {
        HoldTest::of(&std::mem::take(&mut self.done), rig)
    }
}

impl HoldTest {
    fn of(holds: &[Held], rig: &Rig) -> Option<Self> {
        let longest = holds.iter().max_by(|a, b| a.usable_s().total_cmp(&b.usable_s()))?;
        let usable = usable(holds);
        let fit = fit(rig, &usable).filter(|_| !usable.is_empty());
        let summary = HoldSummary {
            usable_s: fit.as_ref().map_or(0.0, |fit| fit.usable_s),
            ended_by: longest.ended_by,
            holds: holds.len(),
            leaks: fit.as_ref().map(|fit| fit.found.leaks()),
        };
        Some(Self { summary, frozen: frozen(&usable), fit })
    }

    /// How much of it was usable, and what it could find.
    pub fn summary(&self) -> &HoldSummary {
        &self.summary
    }

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

/// So many equal readings are no chance.
const FROZEN_READINGS: usize = 50;

/// Whether each pressure sensor, or its recorder, seems to stand still: real ones flicker in their last digit. A position of many digits
/// need not, as the piston stands.
#[allow(clippy::float_cmp)]
fn frozen(holds: &[&Held]) -> [bool; 2] {
    let is_long = holds.iter().map(|held| held.readings.len()).sum::<usize>() >= FROZEN_READINGS;
    let pressures: [fn(&Reading) -> f64; 2] = [|r| r.pa_pa, |r| r.pb_pa];
    pressures.map(|pressure| {
        let same = |held: &&Held| {
            let [first, rest @ ..] = held.readings.as_slice() else { return true };
            rest.iter().all(|r| pressure(r) == pressure(first))
        };
        is_long && holds.iter().all(same)
    })
}
