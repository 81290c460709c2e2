//! What verdicts are worth, beside the truth.

use super::Case;
use super::givers::{Given, Word};
use pitchleak::core::{Leak, PerLeak};
use std::fmt::Write;

/// Above it a leak is one; the rig file's default, L/min at the paper's size.
pub const THRESHOLD_LPM: f64 = 0.1;
/// A leak that is named must be at least this large, and one that is ruled out smaller than this: 0.2 L/min, of which the pilot runs miss up to a tenth.
const NAMED_LPM: f64 = 0.05;
const RULED_OUT_LPM: f64 = 0.18;
/// A stated size may be off by so many standard deviations, or by this share.
const SIZE_SIGMAS: f64 = 3.0;
const SIZE_SHARE: f64 = 0.05;
/// No probability is further from the truth than this: one word can't cost more than 9.2.
const LEAST_PROBABILITY: f64 = 1e-4;

/// What happened, in L/min of the paper's size.
#[derive(Clone, Debug)]
pub struct Truth {
    /// At the end, and the mean over the last ten seconds: both, for leaks that come and go.
    pub now: PerLeak<[f64; 2]>,
    /// Whether a leak's coefficient was the same all the time.
    pub steady: bool,
    /// Time and size of the flows of every row.
    pub rows: Vec<(f64, PerLeak<f64>)>,
}

impl Truth {
    /// Mean flow of a leak from a time on.
    fn since(&self, leak: Leak, from_s: f64) -> f64 {
        let own = self.rows.iter().filter(|(t, _)| *t >= from_s);
        let (sum, count) = own.fold((0.0, 0.0), |(sum, count), (_, flows)| (sum + flows[leak], count + 1.0));
        sum / f64::max(count, 1.0)
    }

    /// What a stated size is held against: of a leak that changes its mean flow or that of its end, whichever is nearer.
    fn size(&self, leak: Leak, from_s: f64, stated: f64) -> f64 {
        let (mean, end) = (self.since(leak, from_s), self.now[leak][0]);
        if self.steady || (stated - mean).abs() < (stated - end).abs() { mean } else { end }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Judgement {
    Right,
    Open,
    Wrong,
}

impl Judgement {
    pub fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Open => "open",
            Self::Wrong => "wrong",
        }
    }
}

/// All that is counted of one verdict on one trace.
#[derive(Clone, Debug)]
pub struct Scored {
    pub judgement: Judgement,
    /// Why it is wrong.
    pub why: String,
    /// −ln of the probability given to what is so, mean over the three leaks.
    pub log_loss: f64,
    /// Larger of p and 1 − p, and whether what it stands for is so.
    pub statements: Vec<(f64, bool)>,
    /// Whether the 95 % interval of a steady leak that is named holds the truth, and its half width, L/min.
    pub covered: Vec<(bool, f64)>,
    /// A cause is named that is one.
    pub named: bool,
    /// A sound part is told to be mended, and nothing that is wrong stands beside it.
    pub blamed: bool,
    pub causes: String,
    pub text: String,
}

pub fn score(case: &Case, truth: &Truth, given: &Given) -> Scored {
    let why = mistakes(truth, given);
    let hidden = Leak::ALL.iter().any(|leak| given.words[*leak] == Word::Perhaps && is_large(truth, *leak));
    let judgement = match (given.sure, why.is_empty()) {
        (false, _) => Judgement::Open,
        (true, false) => Judgement::Wrong,
        (true, true) if hidden => Judgement::Open,
        (true, true) => Judgement::Right,
    };
    let fault = case.world.at_fault;
    let is_cause = |parts: &[_]| parts.iter().any(|part| fault.contains(part));
    let causes: Vec<_> = given.causes.iter().map(|cause| cause.text.replace([',', '\n'], ";")).collect();
    let statements: Vec<_> = Leak::ALL.iter().filter_map(|leak| statement(truth, given, *leak)).collect();
    let losses: Vec<f64> = Leak::ALL.iter().filter_map(|leak| loss(truth, given, *leak)).collect();
    Scored {
        judgement,
        why: if given.sure { why } else { String::new() },
        log_loss: losses.iter().sum::<f64>() / losses.len().max(1) as f64,
        statements,
        covered: covered(truth, given),
        named: given.causes.iter().any(|cause| is_cause(&cause.accused)),
        blamed: given
            .causes
            .iter()
            .any(|cause| !cause.accused.is_empty() && !is_cause(&cause.accused) && !is_cause(&cause.or)),
        causes: causes.join(" | "),
        text: given.text.replace([',', '\n'], ";"),
    }
}

fn is_large(truth: &Truth, leak: Leak) -> bool {
    truth.now[leak].iter().all(|lpm| *lpm >= RULED_OUT_LPM)
}

/// What a sure verdict has wrong, if anything.
fn mistakes(truth: &Truth, given: &Given) -> String {
    let mut why = Vec::new();
    for leak in Leak::ALL {
        let name = leak.id();
        match given.words[leak] {
            Word::Leaks if truth.now[leak].iter().all(|lpm| *lpm < NAMED_LPM) => {
                why.push(format!("{name} named {:.3}; is {:.3}", given.mean_lpm[leak], truth.now[leak][0]));
            }
            Word::Leaks => {
                let stated = given.mean_lpm[leak];
                let is = truth.size(leak, given.since_s, stated);
                let off = (stated - is).abs();
                if off > SIZE_SIGMAS * given.std_lpm[leak] && off > SIZE_SHARE * is {
                    let std = given.std_lpm[leak];
                    why.push(format!("{name} is {is:.3}; stated {stated:.3}+-{std:.4}"));
                }
            }
            Word::RuledOut if is_large(truth, leak) => {
                why.push(format!("{name} of {:.3} ruled out", truth.now[leak][0]));
            }
            _ => {}
        }
    }
    why.join("; ")
}

/// Whether a leak is above the threshold; none where it comes and goes across it.
fn is_above(truth: &Truth, leak: Leak) -> Option<bool> {
    let [now, lately] = truth.now[leak].map(|lpm| lpm > THRESHOLD_LPM);
    (now == lately).then_some(now)
}

fn loss(truth: &Truth, given: &Given, leak: Leak) -> Option<f64> {
    let above = is_above(truth, leak)?;
    let p = given.probability[leak];
    Some(-(if above { p } else { 1.0 - p }).max(LEAST_PROBABILITY).ln())
}

fn statement(truth: &Truth, given: &Given, leak: Leak) -> Option<(f64, bool)> {
    let above = is_above(truth, leak)?;
    let p = given.probability[leak];
    // A verdict in doubt states nothing.
    given.sure.then_some(if p >= 0.5 { (p, above) } else { (1.0 - p, !above) })
}

fn covered(truth: &Truth, given: &Given) -> Vec<(bool, f64)> {
    let named = |leak: &&Leak| given.sure && truth.steady && given.words[**leak] == Word::Leaks;
    let holds = |leak: &Leak| {
        let is = truth.since(*leak, given.since_s);
        let [low, high] = given.interval_lpm[*leak];
        (low <= is && is <= high, 0.5 * (high - low))
    };
    Leak::ALL.iter().filter(named).map(holds).collect()
}

/// Sums over some traces.
#[derive(Clone, Default)]
pub struct Sum {
    pub runs: usize,
    pub right: usize,
    pub open: usize,
    pub wrong: usize,
    pub named: usize,
    pub blamed: usize,
    log_loss: f64,
    intervals: usize,
    holding: usize,
    widths: Vec<f64>,
    /// Of statements with 0.9 to 0.99, and with more: all, and those that are so.
    likely: [usize; 2],
    surely: [usize; 2],
}

impl Sum {
    pub fn of<'a>(all: impl Iterator<Item = &'a Scored>) -> Self {
        let mut sum = Self::default();
        for one in all {
            sum.runs += 1;
            match one.judgement {
                Judgement::Right => sum.right += 1,
                Judgement::Open => sum.open += 1,
                Judgement::Wrong => sum.wrong += 1,
            }
            sum.named += usize::from(one.named);
            sum.blamed += usize::from(one.blamed);
            sum.log_loss += one.log_loss;
            for (holds, width) in &one.covered {
                sum.intervals += 1;
                sum.holding += usize::from(*holds);
                sum.widths.push(*width);
            }
            for (p, so) in one.statements.iter().filter(|(p, _)| *p >= 0.9) {
                let bin = if *p < 0.99 { &mut sum.likely } else { &mut sum.surely };
                bin[0] += 1;
                bin[1] += usize::from(*so);
            }
        }
        sum.widths.sort_by(f64::total_cmp);
        sum
    }

    /// Head of the columns that [`Self::cells`] fills.
    pub const HEAD: &'static str = "runs | right / open / wrong % | log loss | intervals hold % of | half width L/min | \
                                    so at 0.9 to 0.99, % of | so above, % of | cause named | sound part blamed";

    /// Right / open / wrong, %; nothing where there are no runs.
    pub fn shares(&self) -> String {
        if self.runs == 0 {
            return String::new();
        }
        let [right, open, wrong] = [self.right, self.open, self.wrong].map(|n| percent(n, self.runs));
        format!("{right:.0} / {open:.0} / {wrong:.1}")
    }

    pub fn cells(&self) -> String {
        let of = |part: usize, whole: usize| match whole {
            0 => "-".to_owned(),
            _ => format!("{:.0} of {whole}", percent(part, whole)),
        };
        let mut out = format!("{} | {} | ", self.runs, self.shares());
        let width = self.widths.get(self.widths.len() / 2).map_or("-".into(), |w| format!("{w:.3}"));
        let _ = write!(
            out,
            "{:.3} | {} | {width} | {} | {} | {} | {}",
            self.log_loss / self.runs.max(1) as f64,
            of(self.holding, self.intervals),
            of(self.likely[1], self.likely[0]),
            of(self.surely[1], self.surely[0]),
            self.named,
            self.blamed,
        );
        out
    }
}

fn percent(part: usize, whole: usize) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}
