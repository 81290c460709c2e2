//! What to do where there is neither a flow meter nor a hold.

use crate::report::{ReasonId, ReplayReport, capital};
use crate::trace::TraceQuality;

const ADVICE: &str = "no flow is recorded: shut both ports for ten seconds and record it in a column `shut` (a hold test), or record the flow into a chamber";

/// A trace without any flow tells nothing of leaks, however long it is: says so, and what would.
pub fn advise(report: &mut ReplayReport, quality: &TraceQuality) {
    let has_flow = quality.flow_rests.iter().any(|rests| *rests < quality.rows);
    if has_flow || report.hold.is_some() {
        return;
    }
    let told = |advice: &str| capital(advice) + ".";
    let verdict = &mut report.verdict;
    for reason in verdict.reasons.iter_mut().filter(|reason| reason.id == ReasonId::NotIdentifiable) {
        if let Some(before) = reason.suggestion.replace(ADVICE.to_owned()) {
            verdict.text = verdict.text.replace(&told(&before), &told(ADVICE));
        }
    }
}
