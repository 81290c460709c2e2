//! What a technician acts on where the valve's flows stood for meters.

use super::calibration::LeaksThen;
use super::meter::Taken;
use super::outcome::ValveTest;
use crate::presence::{Found, Wording, told};
use crate::report::{Reason, ReasonId, Status, Verdict, capital, join, with_interval};
use crate::rig::Rig;
use crate::units::readable;
use pitchleak_core::Leak;

/// Leaks below zero by so much contradict it.
const NEGATIVE_SIGMAS: f64 = 5.0;

const LOOK_FOR: &str = "a leak that grows does that, too; else look for a spool whose zero drifts or that sticks, a pressure line that is late or filled with air, and compare [sensors] and [valve] with their data sheets; a hold test needs no valve";

impl ValveTest {
    pub(super) fn verdict(&self, rig: &Rig) -> Verdict {
        let (Some(found), Some(taken)) = (&self.found, &self.taken) else {
            let misfit = self.taken.as_ref().and_then(|taken| self.misfit(taken));
            let status = if misfit.is_some() { Status::Doubtful } else { Status::NotSure };
            return told(status, Vec::new(), vec![misfit.unwrap_or_else(|| self.cannot_tell())], "");
        };
        let wording = Wording {
            teller: "The valve's flows",
            beside: &|leak| {
                let said: Vec<String> = self.grows(leak).into_iter().chain(self.against(leak)).collect();
                (!said.is_empty()).then(|| said.join(" "))
            },
            basis: self.basis(),
            undecided: None,
            open: &|open| self.open(found, open),
        };
        found.verdict(rig, self.contradictions(taken, found, rig), &wording)
    }

    fn cannot_tell(&self) -> Reason {
        let (text, remedy) = match self.unread() {
            Some(name) if self.summary.calibrated.is_none() => (
                format!(
                    "{name} is not measured, and by its data sheet alone the valve does not tell it well enough to find leaks"
                ),
                "measure both chamber pressures, or calibrate the valve while they are (`pitchleak calibrate`)",
            ),
            Some(name) => (
                format!("{name} is not measured, and this trace does not tell it well enough to find leaks"),
                "measure both chamber pressures, or record longer, with the piston moving both ways",
            ),
            None if self.taken.is_some() => (
                "what is not known of the valve has no likeliest values in this trace, by which leaks could be told".to_owned(),
                "record longer, with the piston moving both ways; a hold test needs no valve",
            ),
            None => match self.void() {
                Some(void) => (
                    format!("{void}, and little is left of the trace"),
                    "a leak may have emptied it: look for oil outside",
                ),
                None => (
                    "this trace is too short to tell leaks from the valve's own gains and laps".to_owned(),
                    "record 20 s or more, in motion and both ways",
                ),
            },
        };
        Reason::new(ReasonId::NotIdentifiable, text, remedy)
    }

    /// How a leak grows that goes in a straight line; what may be as steady is not said to.
    fn grows(&self, leak: Leak) -> Option<String> {
        let slope = self.growth_lpm_ps(leak)?.scaled(3600.0);
        let verb = if slope.value > 0.0 { "grows" } else { "falls" };
        let is_told = slope.value.abs() > slope.half_width95();
        let size = with_interval(slope.value.abs(), Some(slope.std));
        is_told.then(|| format!("It {verb} by {size} L/min per hour: figures are those of the trace's end."))
    }

    /// An external leak is told against what the valve's own clearance may leak, or against a calibration.
    fn against(&self, leak: Leak) -> Option<String> {
        let [a, b] = self.summary.clearance_lpm;
        let (edge, clearance_lpm) = match leak {
            Leak::Internal => return None,
            Leak::ExternalA => ("A–T", a),
            Leak::ExternalB => ("B–T", b),
        };
        let Some(since) = self.summary.calibrated else {
            return Some(format!(
                "The valve's {edge} edge would look the same, and its data sheet allows {} L/min: a hold test tells.",
                readable(clearance_lpm, 2)
            ));
        };
        let absolute = match since.leaks {
            LeaksThen::Unknown => {
                format!("It is more than on {}: what leaked then is not in it. ", since.date)
            }
            LeaksThen::Zero if since.has_evidence => String::new(),
            LeaksThen::Zero => {
                format!("That nothing leaked on {}, when the valve was calibrated, is assumed. ", since.date)
            }
        };
        Some(format!(
            "{absolute}The valve's {edge} edge would look the same if it has worn since: a hold test tells."
        ))
    }

    /// What the verdict rests on.
    fn basis(&self) -> String {
        let time = readable(self.summary.usable_s, 3);
        let known = match self.summary.calibrated {
            Some(since) => format!("calibrated on {}", since.date),
            None => "by its data sheet".to_owned(),
        };
        let scatter = self.summary.scatter;
        let noise = if scatter > 1.2 {
            format!(" The readings scatter {scatter:.1} times as declared.")
        } else {
            String::new()
        };
        let since = if self.taken.as_ref().is_some_and(|taken| taken.changes > 0) {
            " since the leaks changed"
        } else {
            ""
        };
        let unread = self.unread().map(|name| format!(" {name} is not measured.")).unwrap_or_default();
        let void =
            self.void().map(|void| format!(" {}, which is left out.", capital(&void))).unwrap_or_default();
        format!("No flow meters: the valve's flows over {time} s{since}, {known}.{noise}{unread}{void}")
    }

    fn unread(&self) -> Option<&'static str> {
        self.summary.unread.map(|name| if name == "pa" { "P_A" } else { "P_B" })
    }

    fn open(&self, found: &Found, open: &[Leak]) -> Reason {
        if found.is_flat(open) {
            return Reason::new(
                ReasonId::NotIdentifiable,
                "the valve's flows do not rule out internal leaks",
                "P_A and P_B are nearly alike, so that hardly any oil passes the piston: record under load",
            );
        }
        let external = open.iter().any(|leak| *leak != Leak::Internal);
        let remedy = match (external, self.summary.calibrated) {
            _ if self.summary.unread.is_some() => "measure both chamber pressures",
            (true, None) => {
                "the valve's clearances may leak as much: shut both ports for ten seconds (a hold test), or calibrate the valve (`pitchleak calibrate`)"
            }
            _ => "record longer, with the piston moving both ways and both pressures changing",
        };
        let leaks = found.leaks();
        let sizes: Vec<String> = open
            .iter()
            .map(|leak| format!("{} up to {} L/min", leak.label(), readable(leaks[*leak].ci95_lpm[1], 2)))
            .collect();
        Reason::new(
            ReasonId::NotIdentifiable,
            format!("the valve's flows do not rule out {} leaks: {}", join(open, "and"), sizes.join(", ")),
            remedy,
        )
    }

    fn contradictions(&self, taken: &Taken, found: &Found, rig: &Rig) -> Vec<Reason> {
        let mut reasons: Vec<_> = self.misfit(taken).into_iter().collect();
        if found.beliefs.negative > NEGATIVE_SIGMAS * NEGATIVE_SIGMAS {
            reasons.push(Reason::new(
                ReasonId::NegativeLeak,
                "more oil stays in the cylinder than the valve lets in",
                "compare areas, rated_flow and rated_drop with the data sheets, and check which way the spool counts: + feeds A",
            ));
        }
        // In calm wind the pressures change by their noise alone, which no flow answers: oil that seems too stiff is no contradiction.
        reasons.extend(found.other_oil(rig, "trace").filter(|_| found.beliefs.kappa.value > 1.0));
        reasons
    }

    /// Where no valve as declared with leaks as leaks are explains the readings.
    fn misfit(&self, taken: &Taken) -> Option<Reason> {
        if taken.is_explained() {
            return None;
        }
        let what = match taken.changes {
            0 => format!(
                "neither constant leaks nor the valve of [valve] explain this trace: parts of it differ by {:.1} times what noise makes of them",
                taken.summary.unlike()
            ),
            1 => "neither a leak that changes nor the valve of [valve] explain this trace".to_owned(),
            times => {
                format!(
                    "no valve as in [valve] explains this trace: its leaks would have changed {times} times"
                )
            }
        };
        let remedy = match self.void() {
            Some(void) => format!("look for oil outside: {void}, and a leak may have emptied it"),
            None => LOOK_FOR.to_owned(),
        };
        Some(Reason::new(ReasonId::ModelDoesNotFit, what, remedy))
    }

    /// That a chamber ran empty, and how long.
    fn void(&self) -> Option<String> {
        let time = readable(self.summary.void_s?, 2);
        Some(format!("a chamber is below the atmosphere for {time} s"))
    }
}
