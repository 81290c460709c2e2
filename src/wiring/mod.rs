//! Mistakes of wiring, sign and unit, each scored by the likelihood of what the columns would then say.
//!
//! Nothing is ever mended in silence: [`explain`] names the mistake that explains what the declared wiring does not, with
//! its evidence and the lines of `[columns]` that mend it. docs/channels-and-wiring.md says what can't be told.

mod blocks;
mod candidates;
mod continuity;
mod contradiction;
mod equations;
mod excerpt;
mod explanation;
mod fit;
mod force;
mod mistake;
mod noise;
mod priors;
mod readings;
mod refused;
mod running;
mod running_median;
mod signs;

pub use continuity::Recorded;
pub use excerpt::Excerpt;
pub(crate) use explanation::HOW_WIRED;
pub use explanation::{Evidence, Explanation, Wiring};
pub use mistake::{Exchange, Mistake};
pub use readings::Readings;
pub use refused::Refused;
pub use running::Running;

use crate::rig::Rig;
use crate::signal::Signal;
use crate::trace::Record;
use contradiction::{Declared, is_near};
use fit::Fit;
use force::ForceBalance;
use noise::{ScatterRatios, Verdict};
use priors::Priors;
use rayon::prelude::*;

/// The declared wiring's mean square residual must be this many times the mistake's.
const CONTRAST: f64 = 4.0;
/// χ² that a mistake must explain at the least, and that parts two mistakes that can be told apart.
const LEAST_DROP: f64 = 60.0;
const APART: f64 = 25.0;
/// More mistakes than this that cannot be told apart explain nothing.
const MOST_ALIKE: usize = 4;
/// A lost sign must have turned so many readings.
const LEAST_TURNED: u64 = 30;
/// Range of readings that have more in them than noise, in standard deviations of it.
const CONTENT_SIGMAS: f64 = 12.0;
/// Share of the readings that must be possible on the rig.
const POSSIBLE_SHARE: f64 = 0.99;

const EXCHANGED_PRESSURES: [Mistake; 2] =
    [Mistake::Exchanged(Exchange::Pressures), Mistake::Exchanged(Exchange::Chambers)];

/// Rows that show a sensor's scatter to a percent or two.
const SCATTER_ROWS: usize = 3000;

/// A mistake, and how well it explains the trace.
#[derive(Clone, Copy, Debug)]
struct Scored {
    mistake: Mistake,
    fit: Fit,
    scatter: Verdict,
}

/// The exchange of pressures that the force balance tells, alone or with that of the flows, whatever the flows say; two where
/// those don't tell which.
pub(crate) fn exchanged_by_force(stretch: &Recorded<'_>) -> Option<Explanation> {
    exchanged_by(&stretch.force_balance()?, stretch)
}

fn exchanged_by(balance: &ForceBalance, stretch: &Recorded<'_>) -> Option<Explanation> {
    let [before, after] = balance.holds_exchanged()?;
    let (records, rig) = (stretch.records, stretch.rig());
    let score = |mistake: Mistake| {
        let fit = Recorded::new(&mistake.mend(records, rig), rig)?.fit(&Priors::declared(rig))?;
        Some(Scored { mistake, fit, scatter: Verdict::Silent })
    };
    let found: Vec<Scored> = EXCHANGED_PRESSURES.into_iter().filter_map(score).collect();
    let rows = found.first()?.fit.row_count();
    let mistakes = best(found, rows).iter().map(|one| one.mistake).collect();
    Some(Explanation { mistakes, evidence: Evidence::Force { before, after } })
}

/// Exchanged pressures of a stream, which keeps no records to exchange the flows in.
pub(crate) fn exchanged_so_far(balance: &ForceBalance) -> Option<Explanation> {
    let [before, after] = balance.holds_exchanged()?;
    Some(Explanation { mistakes: EXCHANGED_PRESSURES.into(), evidence: Evidence::Force { before, after } })
}

/// The mistake of wiring, sign or unit that explains the records where the declared wiring does not; `None` where that
/// does, or nothing explains them, or too much.
pub fn explain(stretch: &Recorded<'_>) -> Option<Explanation> {
    let (records, rig) = (stretch.records, stretch.rig());
    let balance = stretch.force_balance();
    if let Some(exchanged) = balance.as_ref().and_then(|balance| exchanged_by(balance, stretch)) {
        return Some(exchanged);
    }
    let contradicted = Declared::by_each_law(stretch);
    if contradicted.is_empty() || sensor_errors_explain(stretch) {
        return None;
    }
    if let Some((readings, turned)) = signs::lost(records, rig) {
        let evidence = Evidence::Motion(turned);
        return Some(Explanation { mistakes: readings.into_iter().map(Mistake::Size).collect(), evidence });
    }
    let ratios = ScatterRatios::of(records, rig);
    let mut candidates = candidates::candidates();
    if balance.is_some_and(|balance| balance.holds()) {
        candidates.retain(|mistake| !EXCHANGED_PRESSURES.contains(mistake));
    }
    let possible = |mistake: Mistake| {
        let mended = mistake.mend(records, rig);
        let lossy = matches!(mistake, Mistake::Size(_))
            && !(is_wanted(mistake, records) && turns_many(&mended, records));
        let scatter = ratios.verdict(mistake);
        let out = lossy || !is_possible(&mended, rig) || has_vanished(mistake, &mended, rig);
        (!out && scatter != Verdict::Against).then_some((mended, scatter))
    };
    let score = |mistake: &Mistake| {
        let (mended, scatter) = possible(*mistake)?;
        let mended = Recorded::new(&mended, rig)?;
        let by_law = |declared: &Declared| {
            let fit = mended.fit(&declared.priors)?;
            let explained = declared.is_explained_by(*mistake, &fit);
            explained.then_some(Scored { mistake: *mistake, fit, scatter })
        };
        Some(contradicted.iter().map(by_law).collect::<Vec<_>>())
    };
    let scored: Vec<_> = candidates.par_iter().filter_map(score).collect();
    contradicted.iter().enumerate().find_map(|(law, declared)| {
        let found = scored.iter().filter_map(|by_law| *by_law.get(law)?).collect();
        let alike = best(found, declared.fit.row_count());
        let first = alike.first()?.fit;
        (alike.len() <= MOST_ALIKE).then(|| Explanation {
            mistakes: with_lost_signs(alike.iter().map(|one| one.mistake).collect(), records),
            evidence: Evidence::Residual { before: declared.fit.worst().sqrt(), after: first.worst().sqrt() },
        })
    })
}

/// The unit that flows are recorded in, where they were read in another one, by their scatter alone: at rest the equations
/// don't tell. Only where the channels that are not mistaken scatter as declared, and those that are by just the
/// factor between two units.
pub fn unit_by_scatter(excerpt: &Excerpt, rig: &Rig) -> Option<Explanation> {
    unit_betrayed(&ScatterRatios::of(&excerpt.first_records(SCATTER_ROWS), rig))
}

fn unit_betrayed(ratios: &ScatterRatios) -> Option<Explanation> {
    let found =
        candidates::flow_units().into_iter().find_map(|mistake| Some((mistake, ratios.betrays(mistake)?)))?;
    let (mistake, ratio) = found;
    Some(Explanation { mistakes: vec![mistake], evidence: Evidence::Scatter(ratio) })
}

/// Mean squares of the normalised residual of the flow balance and of the position against the flows, over all the
/// records; none of an equation without rows, or of too few records.
pub fn misfit(records: &[Record], rig: &Rig) -> [Option<f64>; 2] {
    let fit = Recorded::new(records, rig).and_then(|stretch| stretch.fit(&Priors::declared(rig)));
    fit.map_or([None; 2], |fit| fit.ratios)
}

/// Offsets and gains of a few percent are commoner than mistakes of wiring: where they explain as much, they do.
fn sensor_errors_explain(stretch: &Recorded<'_>) -> bool {
    let fit = stretch.fit(&Priors::with_sensor_errors(stretch.rig()));
    fit.is_some_and(|fit| is_near(&fit) && fit.is_possible())
}

/// A size is never negative: only such readings can be sizes.
fn is_wanted(mistake: Mistake, records: &[Record]) -> bool {
    let Mistake::Size(readings) = mistake else { return true };
    let positive = |flow: Option<f64>, wanted: bool| !wanted || flow.is_none_or(|flow| flow >= 0.0);
    let (a, b) = (readings != Readings::FlowB, readings != Readings::FlowA);
    records.iter().all(|r| positive(r.sample.qa_m3s, a) && positive(r.sample.qb_m3s, b))
}

/// Whether a factor leaves nothing but noise of the readings: what says nothing contradicts nothing.
fn has_vanished(mistake: Mistake, mended: &[Record], rig: &Rig) -> bool {
    let Mistake::Scaled(readings, factor) = mistake else { return false };
    let sensors = rig.sensors();
    let range = |of: fn(&Record) -> Option<f64>| {
        let bounds =
            mended.iter().filter_map(of).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        bounds.1 - bounds.0
    };
    let vanished = |signal: &Signal| match signal {
        Signal::Position => range(|r| Some(r.sample.x_m)) < CONTENT_SIGMAS * sensors.position.noise_std,
        Signal::PressureA => range(|r| Some(r.sample.pa_pa)) < CONTENT_SIGMAS * sensors.pressure.noise_std,
        Signal::PressureB => range(|r| Some(r.sample.pb_pa)) < CONTENT_SIGMAS * sensors.pressure.noise_std,
        Signal::FlowA => range(|r| r.sample.qa_m3s) < CONTENT_SIGMAS * sensors.flow_a.noise_std,
        Signal::FlowB => range(|r| r.sample.qb_m3s) < CONTENT_SIGMAS * sensors.flow_b.noise_std,
        _ => false,
    };
    factor > 1.0 && readings.signals().iter().any(vanished)
}

/// Whether a flow that lost its sign gets another one often enough to make a difference.
fn turns_many(mended: &[Record], records: &[Record]) -> bool {
    let flows = |r: &Record| [r.sample.qa_m3s, r.sample.qb_m3s];
    let (mut signed, mut turned) = ([0_u64; 2], [0_u64; 2]);
    for (after, before) in mended.iter().zip(records) {
        for (at, (after, before)) in flows(after).into_iter().zip(flows(before)).enumerate() {
            signed[at] += u64::from(after.is_some());
            turned[at] += u64::from(after != before && after.is_some());
        }
    }
    signed.iter().zip(turned).any(|(signed, turned)| turned >= LEAST_TURNED && 10 * turned > *signed)
}

/// Whether nearly all readings lie within what the rig allows.
fn is_possible(records: &[Record], rig: &Rig) -> bool {
    let stroke = rig.cylinder.stroke_m;
    let (sheets, vacuum) = (&rig.instruments, pitchleak_core::ATMOSPHERE_PA);
    let pressure = -vacuum - 0.05 * sheets.pressure.full_scale..=1.5 * sheets.pressure.full_scale;
    let flow = |flow: Option<f64>, full_scale: f64| flow.is_none_or(|flow| flow.abs() <= 1.5 * full_scale);
    let possible = records.iter().filter(|record| {
        let s = &record.sample;
        (-0.05 * stroke..=1.05 * stroke).contains(&s.x_m)
            && pressure.contains(&s.pa_pa)
            && pressure.contains(&s.pb_pa)
            && flow(s.qa_m3s, sheets.flow_a.full_scale)
            && flow(s.qb_m3s, sheets.flow_b.full_scale)
    });
    possible.count() as f64 >= POSSIBLE_SHARE * records.len() as f64
}

/// A flow of the wrong sign that is never negative may as well have lost its sign.
fn with_lost_signs(mut mistakes: Vec<Mistake>, records: &[Record]) -> Vec<Mistake> {
    let turned: Vec<_> = mistakes
        .iter()
        .filter_map(|one| if let Mistake::Sign(readings) = one { Some(*readings) } else { None })
        .collect();
    let lost = turned.into_iter().flat_map(|readings| [readings, Readings::Flows]).map(Mistake::Size);
    for mistake in lost.filter(|mistake| is_wanted(*mistake, records)) {
        if !mistakes.contains(&mistake) {
            mistakes.push(mistake);
        }
    }
    mistakes
}

/// The best, and those that the trace can't tell from it. A sensor's scatter tells factors apart that the equations
/// can't: where it speaks for one, others go.
fn best(mut found: Vec<Scored>, rows: usize) -> Vec<Scored> {
    let score = |one: &Scored| one.fit.mean_chi_square() * rows as f64;
    found.sort_by(|a, b| score(a).total_cmp(&score(b)));
    let Some(first) = found.first() else { return found };
    let most = score(first) + APART * first.fit.worst().max(1.0);
    let mut alike: Vec<Scored> = Vec::new();
    for one in found {
        if score(&one) <= most && !alike.iter().any(|other| other.mistake.is_like(one.mistake)) {
            alike.push(one);
        }
    }
    let factor = |one: &Scored| matches!(one.mistake, Mistake::Scaled(..));
    if alike.iter().any(|one| one.scatter == Verdict::For) {
        alike.retain(|one| one.scatter == Verdict::For || !factor(one));
    }
    alike
}
