//! What an operator would believe at a door of the program, whether it is so, and the tables of `docs/bench/lies.md`.

use super::{Family, LEAKING, LIES, Leaking, Lie, leak_name, rig, truths};
use pitchleak::core::{Leak, PerLeak, Sample};
use pitchleak::live::{EstimateEvent, Event, LineFormat, LiveConfig, LiveLeakage, Watch};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::{Reason, ReasonId, ReplayReport, Status};
use pitchleak::simulate::{
    Biases, Reading, Sensing, SensorFault, SensorFaults, TraceLayout, TraceWriter, Truth,
};
use pitchleak::trace::TraceReader;
use pitchleak::units::LPM_PER_M3S;
use pitchleak::wind::WindCase;
use rayon::prelude::*;
use std::fmt::Write;
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

/// Where samples come in and a verdict comes out.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Door {
    /// `pitchleak replay`, of the whole file.
    Replay,
    /// `pitchleak watch` and the gateway, line by line: what they say last.
    Watch,
}

impl Door {
    pub const ALL: [Self; 2] = [Self::Replay, Self::Watch];

    pub fn name(self) -> &'static str {
        match self {
            Self::Replay => "replay",
            Self::Watch => "watch",
        }
    }

    /// What it says of a trace; the words alone where it refuses it.
    fn said(self, trace: Vec<u8>, accuracy: f64) -> Result<Said, String> {
        match self {
            Self::Replay => replayed(trace, accuracy).map(Said::from).map_err(|error| error.to_string()),
            Self::Watch => watched(&trace, accuracy).map(Said::from),
        }
    }
}

/// What a door says.
pub struct Said {
    status: Status,
    faults: Vec<Leak>,
    leakage: PerLeak<LiveLeakage>,
    changed_at_s: Option<f64>,
    reasons: Vec<Reason>,
    /// Id of the likeliest.
    explanation: Option<String>,
}

impl From<ReplayReport> for Said {
    fn from(report: ReplayReport) -> Self {
        Self {
            status: report.verdict.status,
            faults: report.verdict.faults,
            leakage: report.leakage.map(LiveLeakage::from),
            changed_at_s: report.changed_at_s,
            reasons: report.verdict.reasons,
            explanation: report.verdict.explanations.first().map(|best| best.id.clone()),
        }
    }
}

impl From<EstimateEvent> for Said {
    fn from(last: EstimateEvent) -> Self {
        let EstimateEvent { status, faults, leakage, changed_at_s, reasons, explanation, .. } = last;
        Self { status, faults, leakage, changed_at_s, reasons, explanation }
    }
}

pub fn replayed(trace: Vec<u8>, accuracy: f64) -> Result<ReplayReport, ReplayError> {
    let rig = rig(accuracy);
    let mut reader = TraceReader::from_stream("trace", Box::new(Cursor::new(trace)), &rig)?;
    replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(()))
}

/// All that a stream says, line by line.
pub fn events(trace: &[u8], accuracy: f64) -> Vec<Event> {
    let mut events = Vec::new();
    let mut watch = Watch::new(LiveConfig::of(rig(accuracy)), Some(LineFormat::Csv));
    trace.split(|byte| *byte == b'\n').for_each(|line| watch.take(line, &mut events));
    watch.finish(&mut events);
    events
}

/// The last estimate, else the last notice.
fn watched(trace: &[u8], accuracy: f64) -> Result<EstimateEvent, String> {
    let mut last = Err(String::new());
    for event in events(trace, accuracy) {
        last = match (event, last) {
            (Event::Estimate(estimate), _) => Ok(*estimate),
            (Event::Notice(notice), Err(_)) => Err(notice.text),
            (_, last) => last,
        };
    }
    last
}

/// A stated figure may be off by this much, or by its own 3 σ, L/min.
const FIGURE_LPM: f64 = 0.1;

pub fn judge(said: &Said, leaking: Leaking, truths: &[Truth]) -> Judgement {
    let right_place = said.faults.iter().copied().eq(leaking);
    let right_size = said.faults.iter().all(|leak| is_size(said, *leak, truths));
    match (said.status.is_sure(), right_place && right_size) {
        (false, _) => Judgement::InDoubt,
        (true, true) => Judgement::Right,
        (true, false) => Judgement::ConfidentlyWrong,
    }
}

/// Whether the mean flow of a leak is the one stated.
fn is_size(said: &Said, leak: Leak, truths: &[Truth]) -> bool {
    let since_s = said.changed_at_s.unwrap_or(0.0);
    let flows = truths.iter().filter(|truth| truth.t_s >= since_s).map(|truth| truth.leaks_m3s[leak].abs());
    let (sum, count) = flows.fold((0.0, 0.0), |(sum, count), flow| (sum + flow, count + 1.0));
    let stated = said.leakage[leak];
    let off_lpm = (stated.mean_lpm - LPM_PER_M3S * sum / f64::max(count, 1.0)).abs();
    off_lpm <= FIGURE_LPM.max(3.0 * stated.std_lpm.unwrap_or(0.0))
}

/// What a door makes of a trace.
#[derive(Clone, Copy)]
pub struct Judged {
    pub judgement: Judgement,
    /// The lie is named.
    pub named: bool,
    /// A mistake of wiring is named that it is not.
    pub misnamed: bool,
}

/// At each door, of what the sensors of `accuracy` show of `truths`, with a lie.
pub fn ask(truths: &[Truth], leaking: Leaking, lie: &Lie, accuracy: f64, seed: u64) -> [Judged; 2] {
    let (trace, shown) = recorded(truths, lie, accuracy, seed);
    Door::ALL.map(|door| match door.said(trace.clone(), accuracy) {
        Err(words) => {
            Judged { judgement: Judgement::InDoubt, named: has_words(&words, lie), misnamed: false }
        }
        Ok(said) => {
            let named = names(&said, lie);
            let accused = said.reasons.iter().any(|reason| reason.id == ReasonId::Wiring);
            Judged { judgement: judge(&said, leaking, shown), named, misnamed: accused && !named }
        }
    })
}

/// Whether it is said what the lie is.
fn names(said: &Said, lie: &Lie) -> bool {
    let Some([id, words]) = lie.named else { return false };
    if id == "explanation" {
        return said.explanation.as_ref().is_some_and(|best| best.contains(words));
    }
    said.reasons.iter().any(|reason| reason.id.name() == id && has_any(&reason.text, words))
}

fn has_any(text: &str, words: &str) -> bool {
    words.split('|').any(|words| text.contains(words))
}

/// Whether the message that refuses a trace names the fault.
fn has_words(said: &str, lie: &Lie) -> bool {
    lie.named.is_some_and(|[_, words]| has_any(said, words))
}

/// The trace as CSV, as users have it, and the truth up to its last row.
pub fn recorded<'a>(truths: &'a [Truth], lie: &Lie, accuracy: f64, seed: u64) -> (Vec<u8>, &'a [Truth]) {
    let noise = rig(accuracy).sensors();
    let rig = rig(1e-2);
    let faults: Vec<SensorFault> = lie.faults.iter().map(|text| text.parse().expect("a fault")).collect();
    let mut faults = SensorFaults::new(&faults, &rig.instruments, rig.cylinder.stroke_m, seed);
    let mut sensing = Sensing::new(noise, Biases::default(), seed);
    let mut writer = TraceWriter::new(Vec::new(), TraceLayout::default()).expect("memory takes it");
    let mut shown_rows = 0;
    for (index, truth) in truths.iter().enumerate() {
        let sample: Sample<f64> = sensing.read(&truth.sample);
        let shown = faults.show(&Reading::at(truth, &sample, None)).filter(|_| index % lie.every == 0);
        if let Some(shown) = shown {
            shown_rows = index + 1;
            writer.row(&shown).expect("memory takes it");
        }
    }
    (writer.into_inner(), truths.get(..shown_rows).unwrap_or_default())
}

/// One row of the bench, over its seeds.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    pub door: Door,
    pub lie: &'static Lie,
    pub leaking: Leaking,
    pub accuracy: f64,
    pub wind: WindCase,
    pub right: usize,
    pub in_doubt: usize,
    pub confidently_wrong: usize,
    /// Those in doubt with the lie among the reasons.
    pub named: usize,
    /// Those with another mistake of wiring among them.
    pub misnamed: usize,
}

impl Outcome {
    pub fn runs(&self) -> usize {
        self.right + self.in_doubt + self.confidently_wrong
    }
}

/// Every lie × leak × accuracy × wind at each door, `seeds` times each; the order and the seeds don't depend on the cores.
/// Of the leaks of a wind each mistake is seen with one in `every`, of the next wind with the next one.
pub fn sweep(accuracies: &[f64], winds: &[WindCase], seeds: u64, every: usize) -> Vec<Outcome> {
    let of_wind = |(place, wind)| (0..LEAKING.len()).map(move |leak| (place + leak, wind, LEAKING[leak]));
    let cylinders: Vec<_> = winds.iter().enumerate().flat_map(of_wind).collect();
    let of_cylinder = |(place, wind, leaking): &(usize, &WindCase, Leaking)| {
        let truths = truths(**wind, *leaking);
        let is_seen = |(index, lie): &(usize, &'static Lie)| {
            lie.family != Family::Mistake || (index + place).is_multiple_of(every)
        };
        let lies: Vec<_> = LIES.iter().enumerate().filter(is_seen).map(|(_, lie)| lie).collect();
        let cases: Vec<_> = accuracies.iter().flat_map(|a| lies.iter().map(move |lie| (*a, *lie))).collect();
        let outcomes = |(accuracy, lie): &(f64, &'static Lie)| {
            let asked: Vec<_> =
                (1..=seeds).map(|seed| ask(&truths, *leaking, lie, *accuracy, seed)).collect();
            Door::ALL.map(|door| {
                let judged = || asked.iter().map(|doors| doors[door as usize]);
                let count = |which| judged().filter(|one| one.judgement == which).count();
                Outcome {
                    door,
                    lie,
                    leaking: *leaking,
                    accuracy: *accuracy,
                    wind: **wind,
                    right: count(Judgement::Right),
                    in_doubt: count(Judgement::InDoubt),
                    confidently_wrong: count(Judgement::ConfidentlyWrong),
                    named: judged().filter(|one| one.named).count(),
                    misnamed: judged().filter(|one| one.misnamed).count(),
                }
            })
        };
        cases.par_iter().flat_map_iter(outcomes).collect::<Vec<_>>()
    };
    cylinders.par_iter().map(of_cylinder).collect::<Vec<_>>().concat()
}

pub const HEADER: &str =
    "door,family,lie,leak,accuracy,wind,right,in_doubt,confidently_wrong,named,misnamed\n";

/// What a row of the bench is about, as the first cells of its line.
pub fn key(outcome: &Outcome) -> String {
    let Outcome { door, lie, leaking, accuracy, wind, .. } = outcome;
    let (door, family, leak) = (door.name(), lie.family.name(), leak_name(*leaking));
    format!("{door},{family},{},{leak},{accuracy},{}", lie.name, wind.mean_mps())
}

/// Every row.
pub fn csv(outcomes: &[Outcome]) -> String {
    let line = |one: &Outcome| {
        let Outcome { right, in_doubt, confidently_wrong, named, misnamed, .. } = one;
        format!("{},{right},{in_doubt},{confidently_wrong},{named},{misnamed}\n", key(one))
    };
    HEADER.to_owned() + &outcomes.iter().map(line).collect::<String>()
}

/// Runs, and those right, in doubt, confidently wrong, named, misnamed, of the outcomes that match.
fn sums(outcomes: &[Outcome], matches: impl Fn(&Outcome) -> bool) -> [usize; 6] {
    outcomes.iter().filter(|one| matches(one)).fold(
        [0; 6],
        |[runs, right, doubt, wrong, named, misnamed], one| {
            [
                runs + one.runs(),
                right + one.right,
                doubt + one.in_doubt,
                wrong + one.confidently_wrong,
                named + one.named,
                misnamed + one.misnamed,
            ]
        },
    )
}

fn line(out: &mut String, name: &str, [runs, right, doubt, wrong, named, misnamed]: [usize; 6]) {
    let _ = writeln!(out, "| {name} | {runs} | {right} | {doubt} | {named} | {misnamed} | {wrong} |");
}

/// The tables for people, door by door.
pub fn summary(outcomes: &[Outcome]) -> String {
    let of_door = |door: Door| {
        let own: Vec<Outcome> = outcomes.iter().filter(|one| one.door == door).copied().collect();
        tables(door, &own)
    };
    Door::ALL.map(of_door).join("\n")
}

fn tables(door: Door, outcomes: &[Outcome]) -> String {
    let mut out = String::new();
    let head = |out: &mut String, title: &str, what: &str| {
        let _ = write!(
            out,
            "## `{}`: {title}\n\n| {what} | runs | right | in doubt | of these named | misnamed | confidently wrong |\n|---|---|---|---|---|---|---|\n",
            door.name()
        );
    };
    head(&mut out, "by family", "family");
    for family in Family::ALL {
        line(&mut out, family.name(), sums(outcomes, |one| one.lie.family == family));
    }
    out.push('\n');
    for (title, what, families) in [
        ("right and sure is asked", "accuracy, wind", &[Family::Honest, Family::Harmless][..]),
        ("right or in doubt is asked", "accuracy, wind", &[Family::Offset, Family::Mistake][..]),
    ] {
        head(&mut out, title, what);
        let mut conditions: Vec<_> = outcomes.iter().map(|one| (one.accuracy, one.wind)).collect();
        conditions.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        conditions.dedup();
        for (accuracy, wind) in conditions {
            let same = |one: &Outcome| one.accuracy.to_bits() == accuracy.to_bits() && one.wind == wind;
            let name = format!("{:.1} %, {} m/s", 100.0 * accuracy, wind.mean_mps());
            line(&mut out, &name, sums(outcomes, |one| families.contains(&one.lie.family) && same(one)));
        }
        out.push('\n');
    }
    head(&mut out, "by lie", "lie");
    for lie in LIES {
        let name = format!("{} ({})", lie.name, lie.family.name());
        line(&mut out, &name, sums(outcomes, |one| one.lie.name == lie.name));
    }
    out
}
