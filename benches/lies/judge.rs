//! What an operator would believe after the replay, and whether it is so.

use crate::lie::Lie;
use crate::plant::{Leaking, rig};
use pitchleak::core::{Leak, Sample, Sensors};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::ReplayReport;
use pitchleak::simulate::{
    Biases, Reading, Row, Sensing, SensorFault, SensorFaults, TraceLayout, TraceWriter, Truth,
};
use pitchleak::trace::TraceReader;
use pitchleak::units::LPM_PER_M3S;
use std::io::Cursor;

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Judgement {
    /// Sure, and so it is.
    Right,
    /// The report doubts, cannot tell, or the trace is refused.
    InDoubt,
    /// Sure, and it is not so.
    ConfidentlyWrong,
}

/// A stated figure may be off by this much, or by its own 3 σ, L/min.
const FIGURE_LPM: f64 = 0.1;

pub fn judge(report: &ReplayReport, leaking: Leaking, truths: &[Truth]) -> Judgement {
    let right_place = report.verdict.faults.iter().copied().eq(leaking);
    let right_size = report.verdict.faults.iter().all(|leak| is_size(report, *leak, truths));
    match (report.verdict.status.is_sure(), right_place && right_size) {
        (false, _) => Judgement::InDoubt,
        (true, true) => Judgement::Right,
        (true, false) => Judgement::ConfidentlyWrong,
    }
}

/// Whether the mean flow of a leak is the one stated.
fn is_size(report: &ReplayReport, leak: Leak, truths: &[Truth]) -> bool {
    let since_s = report.changed_at_s.unwrap_or(0.0);
    let flows = truths.iter().filter(|truth| truth.t_s >= since_s).map(|truth| truth.leaks_m3s[leak].abs());
    let (sum, count) = flows.fold((0.0, 0.0), |(sum, count), flow| (sum + flow, count + 1.0));
    let stated = report.leakage[leak];
    let off_lpm = (stated.mean_lpm - LPM_PER_M3S * sum / f64::max(count, 1.0)).abs();
    off_lpm <= FIGURE_LPM.max(3.0 * stated.std_lpm.unwrap_or(0.0))
}

/// The judgement of a replay of what the sensors of `accuracy` show of `truths`, with a lie, and whether that is named.
pub fn ask(truths: &[Truth], leaking: Leaking, lie: &Lie, accuracy: f64, seed: u64) -> (Judgement, bool) {
    let Ok((report, shown)) = replayed(truths, lie, accuracy, seed) else {
        return (Judgement::InDoubt, false);
    };
    (judge(&report, leaking, shown), names(&report, lie))
}

/// Whether the report says what the lie is.
fn names(report: &ReplayReport, lie: &Lie) -> bool {
    let Some([id, words]) = lie.named else { return false };
    report.verdict.reasons.iter().any(|reason| reason.id.name() == id && reason.text.contains(words))
}

/// The report on it, and the truth as far as it was recorded.
pub fn replayed<'a>(
    truths: &'a [Truth],
    lie: &Lie,
    accuracy: f64,
    seed: u64,
) -> Result<(ReplayReport, &'a [Truth]), ReplayError> {
    let rig = rig(accuracy);
    let (text, shown) = recorded(truths, lie, rig.sensors(), seed);
    let mut reader = TraceReader::from_stream("trace", Box::new(Cursor::new(text)), &rig)?;
    let report = replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(()))?;
    Ok((report, shown))
}

/// The trace as CSV, as users have it, and the truth up to its last row.
fn recorded<'a>(truths: &'a [Truth], lie: &Lie, noise: Sensors<f64>, seed: u64) -> (Vec<u8>, &'a [Truth]) {
    let rig = rig(1e-2);
    let faults: Vec<SensorFault> = lie.faults.iter().map(|text| text.parse().expect("a fault")).collect();
    let mut faults = SensorFaults::new(&faults, &rig.instruments, rig.cylinder.stroke_m, seed);
    let mut sensing = Sensing::new(noise, Biases::default(), seed);
    let mut writer = TraceWriter::new(Vec::new(), TraceLayout::default()).expect("memory takes it");
    let mut shown_rows = 0;
    for (index, truth) in truths.iter().enumerate() {
        let sample: Sample<f64> = sensing.read(&truth.sample);
        let shown = faults.show(&Reading::at(truth, sample)).filter(|_| index % lie.every == 0);
        if let Some(shown) = shown {
            shown_rows = index + 1;
            writer.row(&Row::new(truth, shown)).expect("memory takes it");
        }
    }
    (writer.into_inner(), truths.get(..shown_rows).unwrap_or_default())
}
