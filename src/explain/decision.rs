//! What the posterior says of the leaks, and what an operator acts on.

use super::hypothesis::{LeakCourse, State};
use super::leak_sample::Weighed;
use super::marginal::Marginal;
use super::pass::{Pass, Tables};
use super::posterior::{Posterior, has_enough, weigh};
use super::raw_products::{RawProducts, Statistic};
use super::readings::{Mistake, Of};
use super::scales::with_scales;
use super::sizes::{is_usual_direction, mended, sentence};
use super::table::{Entry, explanations};
use crate::report::Status;
use crate::rig::Rig;
use crate::signal::Signal;
use crate::told::Told;
use crate::units::LPM_PER_M3S;
use pitchleak_core::{Estimate, Leak, PerLeak};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Mass of mistakes of wiring above which the readings can't be trusted: as likely as not.
pub const WIRING_DOUBT: f64 = 0.5;
/// Zeros that wander with such a mass hide a leak that comes and goes. A guess.
const WANDER_DOUBT: f64 = 0.3;
/// A noise scale of so many times the readings' own scatter contradicts what is said of sensors and rig. Where they are as
/// declared it widens the leaks' intervals, and is a doubt where those are open.
const MISFIT_DOUBT: f64 = 3.0;
/// What takes sizes of so many standard deviations of what sensors and rigs are off by is no explanation, but the nearest that the
/// table has. Derived: one of two million is so large.
const MOST_STRAIN: f64 = 5.0;
/// A leak that has a course with this probability has it: as likely as not.
const COURSE_DOUBT: f64 = 0.5;
/// From here on it is told. A guess.
pub const MISFIT_TOLD: f64 = 2.0;
/// Explanations below this probability are not listed.
const LEAST_LISTED: f64 = 0.01;

/// What is believed of a leak at the trace's end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Belief {
    /// Mean flow, L/min.
    pub mean_lpm: f64,
    /// Standard deviation of the mixture, L/min.
    pub std_lpm: f64,
    /// Quantiles of 2.5, 50 and 97.5 %, L/min.
    pub quantiles_lpm: [f64; 3],
    /// Where there is such a leak, it is smaller than this with 97.5 %, L/min.
    pub below_lpm: f64,
}

impl Belief {
    /// Mean and standard deviation, L/min.
    pub fn estimate_lpm(&self) -> Estimate<f64> {
        Estimate { value: self.mean_lpm, std: self.std_lpm }
    }
}

/// An explanation that is left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Explained {
    /// Ids of what it is made of, joined by `+`.
    pub id: String,
    /// Posterior probability.
    pub probability: f64,
    /// In words, leaks first.
    pub text: String,
    /// What is off beside the leaks, in words; empty where nothing is.
    pub cause: String,
    /// Whether it is a mistake of wiring, sign or unit.
    pub wiring: bool,
    /// Which mistake; none where it is none, and of what was read back.
    #[serde(skip)]
    pub mistake: Option<Mistake>,
    /// Sensors that err where it is true.
    pub sensors: Vec<Signal>,
    /// What to do about it.
    pub remedy: Option<String>,
    /// Lines for `[columns]` or the rig file that mend it.
    pub columns: Vec<String>,
    /// Ids that no trace of these readings tells it from.
    pub cannot_be_told_from: Vec<String>,
    /// Mean leaks under it, L/min.
    pub leakage: PerLeak<f64>,
}

/// Something of sensors, rig or wiring that is not as declared, whatever the leaks are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Note {
    /// Of the likeliest entry.
    pub id: String,
    /// That it or one of those that it cannot be told from is so.
    pub probability: f64,
    /// In words.
    pub text: String,
    /// Others of its kind that this trace leaves, and entries that no trace tells it from.
    pub cannot_be_told_from: Vec<String>,
}

/// The verdict of the posterior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// In a word.
    pub status: Status,
    /// Leaks that are above their threshold.
    pub faults: Vec<Leak>,
    /// Leaks that are below it.
    pub ruled_out: Vec<Leak>,
    /// That each leak is above its threshold at the trace's end.
    pub probability: PerLeak<f64>,
    /// That there is each leak, or was along the trace, of whatever size.
    pub present: PerLeak<f64>,
    /// How large each leak is, since it changed last.
    pub leakage: PerLeak<Belief>,
    /// How long before the end a leak last changed at once, s, pauses not counted; none where none did.
    pub changed_ago_s: Option<f64>,
    /// Mean size of the pressures across the leaks since then, Pa: a leak's coefficient is its flow over it.
    pub pressures_pa: PerLeak<f64>,
    /// Best first.
    pub explanations: Vec<Explained>,
    /// Whether the likeliest explanation has sensors and rig as declared.
    pub as_declared: bool,
    /// What is not as declared, for certain.
    pub notes: Vec<Note>,
    /// Noise scale over the readings' own scatter.
    pub misfit: f64,
    /// The sizes that it takes are beyond those of sensors and rigs, as likely as not.
    #[serde(default)]
    pub strained: bool,
    /// Probability that zeros wander.
    pub wander: f64,
    /// Probability of a mistake of wiring, sign or unit.
    pub wiring: f64,
    /// Size of the residual in standard deviations of the declared noise, under the best explanation with the wiring as
    /// declared and under the best without; none where there is none.
    pub residuals: [Option<f64>; 2],
}

/// Explains a trace; `None` where there is too little of it. Leaks are uncertain by `doubts_m3s` beside what the trace
/// leaves open.
pub fn explain(statistic: &Statistic, rig: &Rig, doubts_m3s: PerLeak<f64>, told: &Told) -> Option<Decision> {
    let mut statistic = Box::new(statistic.clone());
    statistic.close();
    if !has_enough(&statistic) {
        return None;
    }
    let products = RawProducts::of(&statistic, rig);
    let tables = Tables::new(&rig.decision.odds);
    let mistakes = with_scales(&Pass::new(&statistic, &products, rig, &tables, PerLeak::default(), told));
    let tables = Tables { mistakes, ..tables };
    let Posterior { weighed, residuals } = weigh(&statistic, products, rig, &tables, doubts_m3s, told)?;
    let decision = Decision { residuals, ..decide(&weighed, &tables, rig) };
    let decision = decision.with_sizes(&tables, told);
    Some(match told.lost_sign() {
        Some((of, ln_ratio)) => decision.with_lost_sign(&tables, of, ln_ratio),
        None => decision,
    })
}

impl Decision {
    /// Whether too much remains under every explanation for the leaks to be told.
    pub fn fits_nothing(&self) -> bool {
        (self.misfit > MISFIT_DOUBT || self.strained) && !self.status.is_sure()
    }

    /// Whether it names a leak or rules it out.
    pub(crate) fn tells(&self, leak: Leak) -> bool {
        self.ruled_out.contains(&leak) || self.status.is_sure() && self.faults.contains(&leak)
    }

    /// Whether it rules out a leak of which an alarm stands: not where that comes and goes.
    pub(crate) fn rules_out_alarm(&self, leak: Leak) -> bool {
        self.ruled_out.contains(&leak) && !self.is_away(leak)
    }

    /// Whether a leak comes and goes, as likely as not, and is away.
    pub(crate) fn is_away(&self, leak: Leak) -> bool {
        self.ruled_out.contains(&leak) && self.goes_on(leak, &[LeakCourse::Wandering])
    }

    /// Whether a leak changes little by little, as likely as not.
    pub(crate) fn is_drifting(&self, leak: Leak) -> bool {
        self.goes_on(leak, &[LeakCourse::Growing, LeakCourse::Accelerating, LeakCourse::Creeping])
    }

    /// Whether a leak has one of these courses, as likely as not.
    fn goes_on(&self, leak: Leak, courses: &[LeakCourse]) -> bool {
        let is_one = |course: &str| courses.iter().any(|one| one.id() == course);
        self.probability_where(|part| {
            part.split_once(':').is_some_and(|(id, course)| id == leak.id() && is_one(course))
        }) > COURSE_DOUBT
    }

    /// Probability of the explanations one of whose parts `is` so, as far as they are listed.
    pub(crate) fn probability_where(&self, is: impl Fn(&str) -> bool) -> f64 {
        let so = self.explanations.iter().filter(|one| one.id.split('+').any(&is));
        so.map(|one| one.probability).sum()
    }

    /// A flow that seems to count the other way and is never negative may as well have lost its sign.
    fn with_sizes(mut self, tables: &Tables, told: &Told) -> Self {
        for at in 0..self.explanations.len() {
            let one = &mut self.explanations[at];
            let Some(Mistake::Sign(of)) = one.mistake else { continue };
            let lost = [of, Of::Flows].into_iter().filter(|lost| told.is_unsigned(*lost));
            let lost: BTreeSet<Of> = lost.collect();
            one.probability /= (1 + lost.len()) as f64;
            let probability = one.probability;
            self.explanations.extend(lost.into_iter().filter_map(|of| lost_sign(tables, of, probability)));
        }
        self
    }

    /// Beside the explanation that flows lost their signs, so many times likelier than that they have them.
    fn with_lost_sign(mut self, tables: &Tables, of: Of, ln_ratio: f64) -> Self {
        let Some(found) = lost_sign(tables, of, 1.0) else { return self };
        let share =
            tables.mistakes.iter().find(|entry| entry.mistake == found.mistake).map_or(0.0, |e| e.share);
        let probability = 1.0 / (1.0 + (-share.ln() - ln_ratio).exp());
        let left = 1.0 - probability;
        self.explanations.iter_mut().for_each(|one| one.probability *= left);
        self.notes.iter_mut().for_each(|note| note.probability *= left);
        self.explanations.push(Explained { probability, ..found });
        self.explanations.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        self.explanations.retain(|one| one.probability >= LEAST_LISTED);
        self.wiring = probability + left * self.wiring;
        if self.wiring > WIRING_DOUBT {
            self.status = Status::Doubtful;
        }
        self
    }
}

/// Flows that lost their signs, so probable.
fn lost_sign(tables: &Tables, of: Of, probability: f64) -> Option<Explained> {
    let mistake = Some(Mistake::LostSign(of));
    let entry = tables.mistakes.iter().find(|entry| entry.mistake == mistake)?;
    Some(Explained {
        id: entry.id.to_owned(),
        probability,
        text: entry.text.to_owned(),
        cause: entry.text.to_owned(),
        wiring: true,
        mistake,
        sensors: entry.sensors(),
        remedy: Some(entry.remedy.to_owned()),
        columns: Vec::new(),
        cannot_be_told_from: Vec::new(),
        leakage: PerLeak::default(),
    })
}

fn decide(weighed: &[Weighed<'_>], tables: &Tables, rig: &Rig) -> Decision {
    let mass = |is: &dyn Fn(&Weighed<'_>) -> bool| {
        weighed.iter().filter(|one| is(one)).fold(0.0, |sum, one| sum + one.probability).min(1.0)
    };
    let threshold_m3s = rig.alarms.threshold_m3s;
    let alpha = rig.decision.alpha;
    let beliefs = PerLeak::from_fn(|leak| Marginal::of(weighed, tables, leak));
    let probability = PerLeak::from_fn(|leak| beliefs[leak].above(threshold_m3s[leak]));
    let wiring = mass(&|one| one.hypothesis.wiring.is_some());
    let wander = mass(&|one| one.hypothesis.state.wander.0 > 0.0);
    let misfit = weighed.iter().map(|one| one.probability * one.misfits[0].max(one.misfits[1])).sum();
    let is_ruled_out = |leak: &Leak| {
        wander < WANDER_DOUBT && beliefs[*leak].above_at_even_odds(threshold_m3s[*leak]) <= alpha
    };
    let faults: Vec<Leak> = Leak::ALL.into_iter().filter(|leak| probability[*leak] >= 1.0 - alpha).collect();
    let ruled_out: Vec<Leak> = Leak::ALL.into_iter().filter(is_ruled_out).collect();
    let as_declared =
        weighed.first().is_some_and(|best| found(best).iter().flatten().all(|entry| is_usual(entry.id)));
    let strained = mass(&|one| one.strain > MOST_STRAIN) > 0.5;
    let misfits = misfit > MISFIT_DOUBT || strained;
    // Where what is said of sensors and rig leaves as much, it is not so, and no leak beside it is.
    let status = if wiring > WIRING_DOUBT || misfits && !as_declared {
        Status::Doubtful
    } else if !faults.is_empty() {
        Status::Leak
    } else if ruled_out.len() == Leak::ALL.len() {
        Status::Sound
    } else if misfits {
        Status::Doubtful
    } else {
        Status::NotSure
    };
    Decision {
        status,
        faults,
        ruled_out,
        probability,
        present: PerLeak::from_fn(|leak| mass(&|one| one.hypothesis.leaks[leak as usize].is_some())),
        leakage: beliefs.map(|marginal| marginal.belief()),
        changed_ago_s: weighed.first().and_then(|best| best.changed_ago_s),
        pressures_pa: weighed.first().map_or_else(PerLeak::default, |best| best.pressures_pa),
        explanations: listed(weighed, rig),
        as_declared,
        notes: notes(weighed, rig),
        misfit,
        strained,
        wander,
        wiring,
        residuals: [None; 2],
    }
}

/// What is not usual with probability 1 − α, of each kind.
fn notes(weighed: &[Weighed<'_>], rig: &Rig) -> Vec<Note> {
    (0..3).filter_map(|kind| note(weighed, kind, rig)).collect()
}

fn note(weighed: &[Weighed<'_>], kind: usize, rig: &Rig) -> Option<Note> {
    let alpha = rig.decision.alpha;
    let mut masses: Vec<(&Entry, f64)> = Vec::new();
    for one in weighed {
        let Some(entry) = found(one)[kind].filter(|entry| !is_usual(entry.id)) else { continue };
        match masses.iter_mut().find(|(known, _)| known.id == entry.id) {
            Some((_, mass)) => *mass += one.probability,
            None => masses.push((entry, one.probability)),
        }
    }
    masses.sort_by(|a, b| b.1.total_cmp(&a.1));
    let probability = masses.iter().map(|(_, mass)| mass).sum();
    let (best, _) = *masses.first().filter(|_| probability >= 1.0 - alpha)?;
    let likeliest = weighed.iter().find(|one| found(one)[kind].is_some_and(|entry| entry.id == best.id));
    if likeliest.is_some_and(|one| is_usual_direction(best, &one.found)) {
        return None;
    }
    let others = masses.iter().skip(1).filter(|(_, mass)| *mass > alpha).map(|(entry, _)| entry.id);
    let rivals: BTreeSet<&str> = others.chain(best.alike.iter().copied()).collect();
    let text = likeliest.map_or_else(|| best.text.to_owned(), |one| sentence(best, &one.found, rig));
    let table = explanations();
    let words = table.iter().filter(|entry| rivals.contains(entry.id)).map(|entry| entry.text);
    Some(Note {
        id: best.id.to_owned(),
        probability,
        text: std::iter::once(text.as_str()).chain(words).collect::<Vec<_>>().join(", or "),
        cannot_be_told_from: rivals.into_iter().map(str::to_owned).collect(),
    })
}

/// What an explanation is made of: leaks, their courses, state, wiring.
fn listed(weighed: &[Weighed<'_>], rig: &Rig) -> Vec<Explained> {
    let mut out: Vec<Explained> = Vec::new();
    for one in weighed {
        let id = id(one);
        let at = |leak: usize| {
            if one.hypothesis.leaks[leak].is_none() {
                return 0.0;
            }
            let mean = one
                .leaks_m3s
                .iter()
                .zip(&one.weights)
                .map(|(flows, weight)| flows[leak] * weight)
                .sum::<f64>();
            LPM_PER_M3S * mean
        };
        let leakage = PerLeak { internal: at(0), external_a: at(1), external_b: at(2) };
        let mistake = one.hypothesis.wiring.and_then(|entry| entry.mistake);
        match out.iter_mut().find(|known| known.id == id && known.mistake == mistake) {
            Some(known) => {
                let sum = known.probability + one.probability;
                known.leakage = known
                    .leakage
                    .zip(leakage)
                    .map(|(old, new)| (old * known.probability + new * one.probability) / sum);
                known.probability = sum;
            }
            None => out.push(explained(id, one, leakage, rig)),
        }
    }
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out.retain(|one| one.probability >= LEAST_LISTED);
    for one in &mut out {
        one.text = with_leaks(&one.text, &one.leakage);
    }
    out
}

fn explained(id: String, one: &Weighed<'_>, leakage: PerLeak<f64>, rig: &Rig) -> Explained {
    let hypothesis = &one.hypothesis;
    let parts = found(one);
    let unusual = || parts.iter().flatten().filter(|entry| !is_usual(entry.id));
    let mut words: Vec<String> = unusual().map(|entry| sentence(entry, &one.found, rig)).collect();
    if hypothesis.state.wander.0 > 0.0 {
        words.push("the flow meters' zeros wander".to_owned());
    }
    let remedies: Vec<&str> = unusual().map(|entry| entry.remedy).filter(|text| !text.is_empty()).collect();
    Explained {
        id,
        probability: one.probability,
        text: words.join(", and "),
        cause: words.join(", and "),
        wiring: hypothesis.wiring.is_some(),
        mistake: hypothesis.wiring.and_then(|entry| entry.mistake),
        sensors: unusual().flat_map(|entry| entry.sensors()).collect::<BTreeSet<_>>().into_iter().collect(),
        remedy: (!remedies.is_empty()).then(|| remedies.join(" ")),
        columns: unusual().flat_map(|entry| mended(entry, &one.found, rig)).collect(),
        cannot_be_told_from: unusual().flat_map(|entry| entry.alike).map(|id| (*id).to_owned()).collect(),
        leakage,
    }
}

/// What is found to be off. Mistakes of wiring are weighed beside zeros slightly off alone, which is no finding then.
fn found<'a>(one: &Weighed<'a>) -> [Option<&'a Entry>; 3] {
    let State { zeros, departure, .. } = one.hypothesis.state;
    match one.hypothesis.wiring {
        Some(wiring) => [Some(wiring), None, None],
        None => [None, Some(zeros), Some(departure)],
    }
}

fn with_leaks(rest: &str, leakage: &PerLeak<f64>) -> String {
    let mut parts: Vec<String> = leakage
        .iter()
        .filter(|(_, lpm)| **lpm > 0.0)
        .map(|(leak, lpm)| format!("{} leak of {lpm:.3} L/min", leak.label()))
        .collect();
    if parts.is_empty() {
        parts.push("no leak".to_owned());
    }
    if !rest.is_empty() {
        parts.push(rest.to_owned());
    }
    parts.join(", and ")
}

fn is_usual(id: &str) -> bool {
    matches!(id, "zeros_usual" | "as_declared")
}

fn id(one: &Weighed<'_>) -> String {
    let hypothesis = &one.hypothesis;
    let mut parts: Vec<String> = Vec::new();
    for (leak, course) in Leak::ALL.iter().zip(hypothesis.leaks) {
        parts.extend(course.map(|course| match course {
            LeakCourse::Constant => leak.id().to_owned(),
            course => format!("{}:{}", leak.id(), course.id()),
        }));
    }
    parts.extend(
        found(one).iter().flatten().map(|entry| entry.id).filter(|id| !is_usual(id)).map(str::to_owned),
    );
    if hypothesis.state.wander.0 > 0.0 {
        parts.push("wandering_zeros".to_owned());
    }
    if parts.is_empty() { "sound".to_owned() } else { parts.join("+") }
}
