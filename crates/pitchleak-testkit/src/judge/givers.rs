//! Who gives verdicts: the program's doors, side by side on the same traces.

use super::worlds::Part;
use pitchleak::Rig;
use pitchleak::core::{Leak, PerLeak};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::{Leakage, ReasonId, ReplayReport};
use pitchleak::trace::TraceReader;
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

fn replayed(trace: &[u8], rig: &Rig) -> Result<ReplayReport, ReplayError> {
    let mut reader = TraceReader::from_stream("trace", Box::new(Cursor::new(trace.to_vec())), rig)?;
    replay(&mut reader, rig, |_, _, _| Ok::<_, ReplayError>(()))
}

/// What a word of a program without probabilities is worth: its α is 5 %.
fn worth(word: Word) -> f64 {
    match word {
        Word::Leaks => 0.95,
        Word::Perhaps => 0.5,
        Word::RuledOut => 0.05,
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
    let causes = verdict.reasons.iter().filter(|reason| accuses(reason.id));
    Given {
        sure,
        words,
        probability: words.map(worth),
        mean_lpm: report.leakage.map(|leakage| leakage.mean_lpm),
        std_lpm: report.leakage.map(std),
        interval_lpm: report.leakage.map(interval),
        since_s: report.changed_at_s.unwrap_or(0.0),
        causes: causes.map(|reason| cause(&reason.text)).collect(),
        text: format!("{} {}", verdict.status.word(), verdict.text),
    }
}

/// Whether a reason tells to mend something.
fn accuses(id: ReasonId) -> bool {
    matches!(id, ReasonId::Wiring | ReasonId::SensorError | ReasonId::OffsetOrLeak | ReasonId::Channel(_))
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
