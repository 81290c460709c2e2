//! What a technician acts on after a hold test.

use super::outcome::{Found, HoldTest};
use super::recorder::EndedBy;
use crate::channels::ChannelFaultKind;
use crate::report::{Reason, ReasonId, Status, Verdict, advice, capital, join, with_interval};
use crate::rig::Rig;
use crate::units::{LPM_PER_M3S, readable};
use pitchleak_core::{Leak, PerLeak};

/// Misfits beyond so many standard deviations of chance contradict the model …
const CHANCE_SIGMAS: f64 = 5.0;
/// … where the residuals' squares are as large beside the declared noise's: sensors are a little worse than declared now and then.
const LEAST_MISFIT: f64 = 1.5;
/// A compressibility off by so many of the rig file's standard deviations contradicts it.
const BULK_MODULUS_SIGMAS: f64 = 3.0;
/// A leak is ruled out at no less than this pressure: at none, none flows, Pa.
const LEAST_DRIVING_PA: f64 = 20e5;

/// Below this mean |P_L| zeros of the pressure sensors decide which way oil would pass the piston, Pa.
const LEAST_LOAD_PA: f64 = 2e5;

/// What a hold test says of each leak.
struct Sorted {
    found: Vec<Leak>,
    excluded: Vec<Leak>,
    open: Vec<Leak>,
}

impl HoldTest {
    pub(super) fn verdict(&self, rig: &Rig) -> Verdict {
        let threshold_lpm = rig.alarms.threshold_m3s.map(|flow| flow * LPM_PER_M3S);
        let Some(found) = &self.found else {
            return told(Status::NotSure, Vec::new(), vec![self.too_short()], "");
        };
        let sure = 1.0 - rig.decision.alpha;
        let sorted = found.sorted(&threshold_lpm, sure);
        let contradictions = self.contradictions(found, rig);
        if !contradictions.is_empty() {
            let apparent = found.apparent(&sorted.found);
            return told(Status::Doubtful, sorted.found, contradictions, &apparent);
        }
        let usable = self.usable();
        let mut sentences: Vec<String> =
            sorted.found.iter().map(|leak| found.leak(*leak, threshold_lpm[*leak])).collect();
        sentences.extend(found.none_above(&sorted.excluded, &threshold_lpm));
        if !sorted.found.is_empty() {
            sentences.extend(cannot_tell(&sorted.open));
        }
        sentences.push(usable);
        let text = sentences.join(" ");
        if !sorted.found.is_empty() {
            told(Status::Leak, sorted.found, Vec::new(), &text)
        } else if found.beliefs.any > sure {
            told(Status::NotSure, Vec::new(), vec![found.which_way()], &text)
        } else if sorted.open.is_empty() {
            told(Status::Sound, Vec::new(), Vec::new(), &text)
        } else {
            told(Status::NotSure, Vec::new(), vec![found.too_little(&sorted.open)], &text)
        }
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

    fn contradictions(&self, found: &Found, rig: &Rig) -> Vec<Reason> {
        let frozen = || {
            Reason::new(
                ReasonId::Channel(ChannelFaultKind::Stuck),
                "position and pressures do not change by a single digit while the ports are shut",
                "check that the recorder runs: sensors flicker in their last digit",
            )
        };
        let mut reasons: Vec<Reason> = self.is_frozen.then(frozen).into_iter().collect();
        reasons.extend(found.misfit());
        reasons.extend(found.negative());
        reasons.extend(found.other_oil(rig));
        reasons
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

impl Found {
    fn sorted(&self, threshold_lpm: &PerLeak<f64>, sure: f64) -> Sorted {
        let is_driven = |leak: Leak| leak != Leak::Internal || self.fit.pressures_pa.internal > LEAST_LOAD_PA;
        let is_found = |leak: &Leak| is_driven(*leak) && self.beliefs.leaks[*leak].probability >= sure;
        let (found, others): (Vec<_>, Vec<_>) = Leak::ALL.into_iter().partition(is_found);
        let (excluded, open) = others
            .into_iter()
            .partition(|leak| is_driven(*leak) && self.at_most_lpm(*leak) < threshold_lpm[*leak]);
        Sorted { found, excluded, open }
    }

    /// Upper end of a leak's interval, at the pressure that drives it or the least that counts, L/min.
    fn at_most_lpm(&self, leak: Leak) -> f64 {
        let driving_pa = self.fit.pressures_pa[leak].max(LEAST_DRIVING_PA);
        self.beliefs.leaks[leak].interval[1] * driving_pa * LPM_PER_M3S
    }

    fn flow(&self, leak: Leak) -> String {
        let to_lpm = self.fit.pressures_pa[leak] * LPM_PER_M3S;
        let belief = &self.beliefs.leaks[leak];
        with_interval(belief.mean * to_lpm, Some(belief.std * to_lpm))
    }

    fn leak(&self, leak: Leak, threshold_lpm: f64) -> String {
        let (flow, bar) = (self.flow(leak), self.fit.pressures_pa[leak] / 1e5);
        let most = self.beliefs.leaks[leak].interval[1] * self.fit.pressures_pa[leak] * LPM_PER_M3S;
        let small = if most < threshold_lpm {
            format!(" It is below the alarm threshold of {threshold_lpm:.2} L/min.")
        } else {
            String::new()
        };
        format!("{} leak of {flow} L/min at {bar:.0} bar: {}.{small}", capital(leak.label()), advice(leak))
    }

    fn none_above(&self, excluded: &[Leak], threshold_lpm: &PerLeak<f64>) -> Option<String> {
        let most = excluded.iter().map(|leak| self.at_most_lpm(*leak)).fold(0.0, f64::max);
        let threshold = excluded.iter().map(|leak| threshold_lpm[*leak]).fold(0.0, f64::max);
        // Rounded up: nothing above it is left.
        let step = 10f64.powf(most.max(1e-4).log10().floor() - 1.0);
        let bound = readable(((most / step).ceil() * step).max(1e-4).min(threshold), 2);
        (!excluded.is_empty()).then(|| format!("No {} leak above {bound} L/min.", join(excluded, "or")))
    }

    fn apparent(&self, leaks: &[Leak]) -> String {
        let each = |leak: &Leak| format!("{} of {} L/min", leak.label(), self.flow(*leak));
        let named: Vec<_> = leaks.iter().map(each).collect();
        if named.is_empty() {
            String::new()
        } else {
            format!("Until then these apparent leaks stay in doubt: {}.", named.join(", "))
        }
    }

    fn misfit(&self) -> Option<Reason> {
        let misfit = &self.fit.misfit;
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
        (self.beliefs.negative > CHANCE_SIGMAS * CHANCE_SIGMAS).then(|| {
            Reason::new(
                ReasonId::NegativeLeak,
                "the pressures rise as if oil came in while the ports are shut",
                "check that both ports were shut all the time, and that the oil was not being warmed",
            )
        })
    }

    fn other_oil(&self, rig: &Rig) -> Option<Reason> {
        let (declared, std) = (rig.fluid.bulk_modulus_pa, rig.fluid.bulk_modulus_std_pa);
        let kappa = self.beliefs.kappa_ppa.value;
        let off = (kappa * declared - 1.0).abs() * declared;
        (off > BULK_MODULUS_SIGMAS * std && std > 0.0).then(|| {
            Reason::new(
                ReasonId::BulkModulusImpossible,
                format!(
                    "the hold asks for a bulk modulus of {:.2} GPa, and the rig file says {:.2} ± {:.2} GPa",
                    1e-9 / kappa,
                    declared / 1e9,
                    std / 1e9
                ),
                "compare [cylinder] with its drawing, dead volumes included, and look for air in the oil",
            )
        })
    }

    fn which_way(&self) -> Reason {
        Reason::new(
            ReasonId::Undecided,
            "oil leaks, but the hold does not tell which way",
            "hold longer, or again under another load",
        )
    }

    fn too_little(&self, open: &[Leak]) -> Reason {
        let flat = open.contains(&Leak::Internal)
            && self.fit.pressures_pa.internal < LEAST_DRIVING_PA
            && open.len() == 1;
        let suggestion = if flat {
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

fn cannot_tell(open: &[Leak]) -> Option<String> {
    (!open.is_empty()).then(|| format!("This hold cannot tell about {} leaks.", join(open, "and")))
}

/// First why it is in doubt, if it is, then what was found.
fn told(status: Status, faults: Vec<Leak>, reasons: Vec<Reason>, found: &str) -> Verdict {
    let sentence = |text: &str| capital(text) + ".";
    let why = reasons.iter().take(1).flat_map(|reason| {
        std::iter::once(sentence(&reason.text)).chain(reason.suggestion.as_deref().map(sentence))
    });
    let text: Vec<String> = why.chain((!found.is_empty()).then(|| found.to_owned())).collect();
    Verdict { status, faults, text: text.join(" "), reasons, probability: None, explanations: Vec::new() }
}
