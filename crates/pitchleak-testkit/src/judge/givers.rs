//! Who gives verdicts: the program's doors, side by side on the same traces.

use super::worlds::Part;
use pitchleak::Rig;
use pitchleak::core::{Leak, PerLeak};
use pitchleak::explain::{Decision, Explained, Statistic, explain};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::{Leakage, ReasonId, ReplayReport};
use pitchleak::told::Beside;
use pitchleak::trace::{Record, TraceError, TraceReader};
use std::io::Cursor;

/// Reads a trace and says what it makes of it.
pub trait VerdictGiver: Sync {
    /// As in the tables.
    fn name(&self) -> &'static str;
    /// Of a trace as CSV.
    fn judge(&self, trace: &[u8], rig: &Rig) -> Given;
}

/// What is said of one leak.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Word {
    Leaks,
    Perhaps,
    RuledOut,
}

/// What is named as the cause of what does not fit.
#[derive(Clone, Debug)]
pub struct Cause {
    pub text: String,
    pub accused: Vec<Part>,
    /// What it is said to be no better than.
    pub or: Vec<Part>,
}

/// A verdict.
#[derive(Clone, Debug)]
pub struct Given {
    /// LEAK or SOUND.
    pub sure: bool,
    pub words: PerLeak<Word>,
    /// That each leak is above its threshold now.
    pub probability: PerLeak<f64>,
    /// Mean flows since `since_s`, L/min: figure, its standard deviation, 95 % interval.
    pub mean_lpm: PerLeak<f64>,
    pub std_lpm: PerLeak<f64>,
    pub interval_lpm: PerLeak<[f64; 2]>,
    pub since_s: f64,
    pub causes: Vec<Cause>,
    pub text: String,
}

impl Given {
    /// With all flows times a factor.
    pub fn scaled(self, factor: f64) -> Self {
        let scale = |lpm: f64| lpm * factor;
        Self {
            mean_lpm: self.mean_lpm.map(scale),
            std_lpm: self.std_lpm.map(scale),
            interval_lpm: self.interval_lpm.map(|ends| ends.map(scale)),
            ..self
        }
    }

    /// Of a trace that is refused.
    fn refused(text: String) -> Self {
        let all = |value| PerLeak { internal: value, external_a: value, external_b: value };
        Self {
            sure: false,
            words: PerLeak::from_fn(|_| Word::Perhaps),
            probability: all(0.5),
            mean_lpm: all(0.0),
            std_lpm: all(f64::INFINITY),
            interval_lpm: PerLeak::from_fn(|_| [f64::NEG_INFINITY, f64::INFINITY]),
            since_s: 0.0,
            causes: vec![],
            text,
        }
    }
}

/// `pitchleak replay`.
pub struct Replay;

impl VerdictGiver for Replay {
    fn name(&self) -> &'static str {
        "replay"
    }

    fn judge(&self, trace: &[u8], rig: &Rig) -> Given {
        match replayed(trace, rig) {
            Ok(report) => of_report(&report),
            Err(error) => Given::refused(error.to_string()),
        }
    }
}

/// The report of `pitchleak replay`.
///
/// # Errors
///
/// Where the trace can't be read.
pub fn replayed(trace: &[u8], rig: &Rig) -> Result<ReplayReport, ReplayError> {
    let mut reader = TraceReader::from_stream("trace", Box::new(Cursor::new(trace.to_vec())), rig)?;
    replay(&mut reader, rig, |_, _, _| Ok::<_, ReplayError>(()))
}

/// The posterior over explanations.
pub struct Explain;

/// From this probability on an explanation tells to mend something: it is likelier than all else together.
const ACCUSES: f64 = 0.5;

impl VerdictGiver for Explain {
    fn name(&self) -> &'static str {
        "explain"
    }

    fn judge(&self, trace: &[u8], rig: &Rig) -> Given {
        match explained(trace, rig) {
            Ok(Some((decision, end_s))) => of_decision(&decision, end_s),
            Ok(None) => Given::refused("too little to explain".into()),
            Err(error) => Given::refused(error.to_string()),
        }
    }
}

fn explained(trace: &[u8], rig: &Rig) -> Result<Option<(Decision, f64)>, TraceError> {
    let mut statistic = Box::new(Statistic::new(&rig.cylinder, &rig.fluid, &rig.sensors()));
    let mut evidence = Beside::default();
    let mut reader = TraceReader::from_stream("trace", Box::new(Cursor::new(trace.to_vec())), rig)?;
    let mut record = Record::default();
    while reader.next_record(&mut record)? {
        statistic.push(record.step_s(), &record.sample);
        evidence.add(&record, rig);
    }
    let decision = explain(&statistic, rig, PerLeak::default(), &evidence.told(rig));
    Ok(decision.map(|decision| (decision, record.t_s)))
}

fn of_decision(decision: &Decision, end_s: f64) -> Given {
    let sure = decision.status.is_sure();
    let words = PerLeak::from_fn(|leak: Leak| match leak {
        _ if !sure => Word::Perhaps,
        _ if decision.faults.contains(&leak) => Word::Leaks,
        _ if decision.ruled_out.contains(&leak) => Word::RuledOut,
        _ => Word::Perhaps,
    });
    let best = decision.explanations.first();
    Given {
        sure,
        words,
        probability: decision.probability,
        mean_lpm: decision.leakage.map(|belief| belief.mean_lpm),
        std_lpm: decision.leakage.map(|belief| belief.std_lpm),
        interval_lpm: decision.leakage.map(|belief| [belief.quantiles_lpm[0], belief.quantiles_lpm[2]]),
        since_s: decision.changed_ago_s.map_or(0.0, |ago_s| end_s - ago_s),
        causes: accused(&decision.explanations),
        text: format!(
            "{} {:?} {:?} misfit {:.2} wander {:.2}: {}",
            decision.status.word(),
            decision.probability,
            decision.leakage.map(|belief| belief.quantiles_lpm),
            decision.misfit,
            decision.wander,
            best.map_or(String::new(), |best| format!("{:.2} {} = {}", best.probability, best.id, best.text)),
        ),
    }
}

/// What explanations are made of, beside leaks, where they have most of the probability together.
fn accused(explanations: &[Explained]) -> Vec<Cause> {
    let mut masses: Vec<(&str, f64)> = Vec::new();
    for one in explanations {
        for id in one.id.split('+').filter(|id| !parts_of(id).is_empty()) {
            match masses.iter_mut().find(|(known, _)| *known == id) {
                Some((_, mass)) => *mass += one.probability,
                None => masses.push((id, one.probability)),
            }
        }
    }
    let alike = |id: &str| {
        let own = explanations.iter().filter(|one| one.id.split('+').any(|part| part == id));
        own.flat_map(|one| one.cannot_be_told_from.iter().flat_map(|id| parts_of(id))).collect()
    };
    let cause = |(id, mass): &(&str, f64)| Cause {
        text: format!("{id} {mass:.2}"),
        accused: parts_of(id),
        or: alike(id),
    };
    masses.iter().filter(|(_, mass)| *mass >= ACCUSES).map(cause).collect()
}

/// What an id of the table of explanations accuses.
fn parts_of(id: &str) -> Vec<Part> {
    use Part::{MeterA, MeterB, Position, PressureA, PressureB, Rig};
    let both = |a: Part, b: Part| match id.rsplit('_').next() {
        Some("a" | "qa" | "pa") => vec![a],
        Some("b" | "qb" | "pb") => vec![b],
        _ => vec![a, b],
    };
    match id {
        _ if id.contains("external") || id.contains("internal") => vec![],
        "exchanged_chambers" => vec![MeterA, MeterB, PressureA, PressureB],
        "other_end" | "unit_x" => vec![Position],
        _ if id.contains("pressure") || id.ends_with("_pa") || id.ends_with("_pb") => {
            both(PressureA, PressureB)
        }
        _ if id.contains("position") => vec![Position],
        _ if ["area", "volume", "bulk", "stroke"].iter().any(|word| id.contains(word)) => vec![Rig],
        _ if ["flow", "zeros", "_qa", "_qb"].iter().any(|word| id.contains(word)) => both(MeterA, MeterB),
        _ => vec![],
    }
}

fn of_report(report: &ReplayReport) -> Given {
    let verdict = &report.verdict;
    let sure = verdict.status.is_sure();
    // The text alone says of which leaks a sure verdict says nothing.
    let open = verdict.text.split(". ").find(|sentence| sentence.starts_with("This trace cannot tell about"));
    let words = PerLeak::from_fn(|leak: Leak| match leak {
        _ if !sure => Word::Perhaps,
        _ if verdict.faults.contains(&leak) => Word::Leaks,
        _ if open.is_some_and(|open| open.contains(leak.label())) => Word::Perhaps,
        _ => Word::RuledOut,
    });
    let std = |leakage: Leakage| leakage.std_lpm.unwrap_or(0.0);
    let interval = |leakage: Leakage| [-1.96, 1.96].map(|z| leakage.mean_lpm + z * std(leakage));
    let accused_by_reasons = verdict.reasons.iter().filter(|reason| accuses(reason.id));
    let mut causes: Vec<Cause> = accused_by_reasons.map(|reason| cause(&reason.text)).collect();
    causes.extend(accused(&verdict.explanations));
    let unknown = PerLeak::from_fn(|_| 0.5);
    Given {
        sure,
        words,
        probability: verdict.probability.unwrap_or(unknown),
        mean_lpm: report.leakage.map(|leakage| leakage.mean_lpm),
        std_lpm: report.leakage.map(std),
        interval_lpm: report.leakage.map(interval),
        since_s: report.changed_at_s.unwrap_or(0.0),
        causes,
        text: format!(
            "{} {} {:?}: {}",
            verdict.status.word(),
            verdict.text,
            report.leakage.map(|leakage| (leakage.mean_lpm, leakage.std_lpm)),
            verdict.explanations.first().map_or("", |best| &best.id)
        ),
    }
}

/// Whether a reason tells to mend something.
fn accuses(id: ReasonId) -> bool {
    matches!(id, ReasonId::Wiring | ReasonId::Channel(_))
}

/// A cause by the columns that its sentence names, before and after "cannot be told apart".
fn cause(text: &str) -> Cause {
    let (own, or) = text.split_once("cannot be told apart").unwrap_or((text, ""));
    Cause { text: text.to_owned(), accused: parts(own), or: parts(or) }
}

fn parts(text: &str) -> Vec<Part> {
    const NAMES: [(&str, Part); 5] = [
        ("qa", Part::MeterA),
        ("qb", Part::MeterB),
        ("pa", Part::PressureA),
        ("pb", Part::PressureB),
        ("x", Part::Position),
    ];
    let words: Vec<&str> = text.split(|letter: char| !letter.is_alphanumeric()).collect();
    NAMES.iter().filter(|(name, _)| words.contains(name)).map(|(_, part)| *part).collect()
}
