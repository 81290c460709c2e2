//! What to do where there is neither a flow meter nor a hold.

use crate::report::{ReasonId, ReplayReport, capital};
use crate::rig::Rig;
use crate::trace::TraceQuality;

const ADVICE: &str = "no flow is recorded: shut both ports for ten seconds and record it in a column `shut` (a hold test), record the valve's spool and the supply pressure (docs/valve.md), or the flow into a chamber";
const DECLARE: &str = "no flow is recorded, but a valve's spool is: declare the valve in the rig file ([valve] with rated_flow and rated_drop), or shut both ports for ten seconds and record it in a column `shut` (a hold test)";
const SUPPLY: &str = "no flow is recorded, and the valve's spool tells nothing without its supply pressure: record it (`ps_bar`), or declare it ([valve] supply); a stream also needs the valve calibrated (`pitchleak calibrate`)";

/// A trace without any flow tells nothing of leaks, however long it is: says so, and what would.
pub fn advise(report: &mut ReplayReport, quality: &TraceQuality, has_spool: bool, rig: &Rig) {
    let advice = match (has_spool, &rig.valve) {
        (false, _) => ADVICE,
        (true, None) => DECLARE,
        (true, Some(_)) => SUPPLY,
    };
    let has_flow = quality.flow_rests.iter().any(|rests| *rests < quality.rows);
    if has_flow || report.hold.is_some() {
        return;
    }
    let told = |advice: &str| capital(advice) + ".";
    let verdict = &mut report.verdict;
    for reason in verdict.reasons.iter_mut().filter(|reason| reason.id == ReasonId::NotIdentifiable) {
        if let Some(before) = reason.suggestion.replace(advice.to_owned()) {
            verdict.text = verdict.text.replace(&told(&before), &told(advice));
        }
    }
}
