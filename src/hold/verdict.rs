//! What a technician acts on after a hold test, or where there is neither that nor a flow meter.

use super::fit::Fit;
use super::outcome::HoldTest;
use super::recorder::EndedBy;
use crate::channels::ChannelFaultKind;
use crate::presence::{Wording, told};
use crate::report::{Reason, ReasonId, ReplayReport, Status, Verdict, capital, join};
use crate::rig::Rig;
use crate::trace::TraceQuality;
use crate::units::readable;
use pitchleak_core::Leak;

/// Misfits beyond so many standard deviations of chance contradict the model …
const CHANCE_SIGMAS: f64 = 5.0;
/// … where the residuals' squares are as large beside the declared noise's: sensors are a little worse than declared now and then.
const LEAST_MISFIT: f64 = 1.5;

impl HoldTest {
    pub(super) fn verdict(&self, rig: &Rig) -> Verdict {
        let Some(fit) = &self.fit else {
            return told(Status::NotSure, Vec::new(), vec![self.too_short()], "");
        };
        let leaks_somehow = fit.found.beliefs.any > 1.0 - rig.decision.alpha;
        let which_way = |open: &[Leak]| fit.which_way(open);
        let wording = Wording {
            teller: "This hold",
            beside: &|_| None,
            basis: self.usable(),
            undecided: leaks_somehow.then_some(&which_way),
            open: &|open| fit.too_little(open),
        };
        fit.found.verdict(rig, self.contradictions(fit, rig), &wording)
    }

    fn too_short(&self) -> Reason {
        let (text, suggestion) = match self.summary.ended_by {
            EndedBy::Pressure => (
                "a chamber is below 5 bar as soon as the ports are shut",
                "shut them while both chambers are under 20 bar or more; where they are, a leak of litres a minute empties one: look for oil outside",
            ),
            EndedBy::Motion => (
                "the piston moves by 2 mm at once",
                "check that the valves are shut, and that the column `shut` is 1 only while they are",
            ),
            _ => ("the ports were shut for too few readings", "hold them shut for 10 s"),
        };
        Reason::new(ReasonId::NotIdentifiable, text, suggestion)
    }

    fn contradictions(&self, fit: &Fit, rig: &Rig) -> Vec<Reason> {
        let mut reasons: Vec<Reason> = self.stuck().into_iter().collect();
        reasons.extend(fit.misfit());
        reasons.extend(fit.negative());
        reasons.extend(fit.found.other_oil(rig, "hold"));
        reasons
    }

    fn stuck(&self) -> Option<Reason> {
        let who = match self.frozen {
            [true, true] => "both pressures do",
            [true, false] => "P_A does",
            [false, true] => "P_B does",
            [false, false] => return None,
        };
        Some(Reason::new(
            ReasonId::Channel(ChannelFaultKind::Stuck),
            format!("{who} not change by a single digit while the ports are shut"),
            "check that the recorder runs, and the sensor: sensors flicker in their last digit",
        ))
    }

    /// How much of the hold counts.
    fn usable(&self) -> String {
        let summary = &self.summary;
        let until = match summary.ended_by {
            EndedBy::Trace => "the trace ended",
            EndedBy::Pressure => "a chamber fell to 5 bar",
            EndedBy::Motion => "the piston had moved by 2 mm",
            EndedBy::Opened => "a port was opened",
            EndedBy::Enough => "there were readings enough",
        };
        let time = readable(summary.usable_s, 3);
        match summary.holds {
            1 => format!("Hold test: {time} s were usable, until {until}."),
            holds => {
                format!("Hold test: {time} s of {holds} holds were usable; the longest lasted until {until}.")
            }
        }
    }
}

impl Fit {
    fn misfit(&self) -> Option<Reason> {
        let misfit = &self.misfit;
        let worst = misfit.readings.max(misfit.course);
        (misfit.sigmas > CHANCE_SIGMAS * misfit.of_leak && worst > LEAST_MISFIT * misfit.of_leak).then(|| {
            Reason::new(
                ReasonId::ModelDoesNotFit,
                format!(
                    "constant leaks and the declared noise do not explain the hold: the residuals are {:.1} times the noise",
                    worst.sqrt()
                ),
                "check that both ports were shut all the time and that the oil had settled, and compare [sensors] with the data sheets",
            )
        })
    }

    fn negative(&self) -> Option<Reason> {
        (self.found.beliefs.negative > CHANCE_SIGMAS * CHANCE_SIGMAS).then(|| {
            Reason::new(
                ReasonId::NegativeLeak,
                "by the balance of the hold, oil came in while the ports were shut",
                "check that both ports were shut all the time, that the oil was not being warmed, and that the piston stood",
            )
        })
    }

    fn which_way(&self, open: &[Leak]) -> Reason {
        let (text, suggestion) = if self.found.is_flat(open) {
            (
                "oil leaks past the piston, but P_A and P_B are too nearly alike to tell how much",
                "hold under load",
            )
        } else {
            ("oil leaks, but the hold does not tell which way", "hold longer, or again under another load")
        };
        Reason::new(ReasonId::Undecided, text, suggestion)
    }

    fn too_little(&self, open: &[Leak]) -> Reason {
        let suggestion = if self.found.is_flat(open) {
            "P_A and P_B are nearly alike, so that hardly any oil passes the piston: hold under load"
        } else {
            "hold longer, and under more pressure"
        };
        Reason::new(
            ReasonId::NotIdentifiable,
            format!("the hold does not rule out {} leaks", join(open, "and")),
            suggestion,
        )
    }
}

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
