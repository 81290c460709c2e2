//! What came of the seeds of each case, and the tables of `docs/bench/blind.md`.

use super::{Ailment, Case, LEAKS, ask, truth};
use pitchleak::core::effects::EffectKind;
use pitchleak::diagnose::{Diagnosis, LeakEstimates, PerEquation, Verdict};
use std::fmt::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Counts of answers, and sums over them.
#[derive(Default, Clone)]
pub struct Tally {
    pub runs: usize,
    /// The true effect is the first named.
    pub named_first: usize,
    /// It is, or stands among those that the first named can be confused with.
    pub in_group: usize,
    /// Some other effect is named, as well or instead.
    pub anything_else: usize,
    /// Some other effect is named, is not doubtful, and has not the truth in its group.
    pub wrong_without_doubt: usize,
    pub explained: usize,
    pub partly: usize,
    pub none: usize,
    pub unexplained: usize,
    pub error_before: f64,
    pub error_after: f64,
    pub leak_bias_before_lpm: f64,
    pub leak_bias_after_lpm: f64,
}

impl Tally {
    fn add(&mut self, ailment: Ailment, answer: &Diagnosis) {
        self.runs += 1;
        match answer.verdict {
            Verdict::Explained => self.explained += 1,
            Verdict::PartlyExplained => self.partly += 1,
            Verdict::NoMissingEffect => self.none += 1,
            _ => self.unexplained += 1,
        }
        let id = ailment.name();
        let first = answer.effects.first();
        self.named_first += usize::from(first.is_some_and(|effect| effect.id == id));
        let grouped = first.is_some_and(|effect| effect.id == id || effect.confusable_with.contains(&id));
        self.in_group += usize::from(grouped);
        let others = || answer.effects.iter().filter(|effect| effect.id != id);
        self.anything_else += usize::from(others().next().is_some());
        let sure = |effect: &pitchleak::diagnose::FoundEffect| {
            effect.confident && !effect.confusable_with.contains(&id)
        };
        self.wrong_without_doubt += usize::from(others().any(sure));
        let in_force = matches!(ailment, Ailment::Known(effect) if effect.spec().kind == EffectKind::Force);
        self.error_before += error(&answer.before.quality.rmse, in_force);
        self.error_after += error(&answer.after.quality.rmse, in_force);
        self.leak_bias_before_lpm += leak_bias_lpm(&answer.before.leaks);
        self.leak_bias_after_lpm += leak_bias_lpm(&answer.after.leaks);
    }
}

/// L/min of both chambers, or N.
fn error(rmse: &PerEquation<Option<f64>>, in_force: bool) -> f64 {
    if in_force {
        return rmse.force.unwrap_or(0.0);
    }
    rmse.chamber_a.unwrap_or(0.0).hypot(rmse.chamber_b.unwrap_or(0.0)) * 60e3
}

/// The largest of the three leaks' errors at 2 (internal) or 4 MPa.
fn leak_bias_lpm(leaks: &LeakEstimates) -> f64 {
    let off = |value: f64, truth: f64, pressure_pa: f64| (value - truth).abs() * pressure_pa * 60e3;
    off(leaks.internal_leak_coefficient.value, LEAKS.internal, 2e6)
        .max(off(leaks.external_leak_a_coefficient.value, LEAKS.external_a, 4e6))
        .max(off(leaks.external_leak_b_coefficient.value, LEAKS.external_b, 4e6))
}

/// Asks `seeds(case)` times about each case, on all cores; the order and the seeds do not depend on them.
pub fn sweep(cases: &[Case], seeds: impl Fn(&Case) -> u64 + Sync) -> Vec<Tally> {
    let tallies = Mutex::new(vec![Tally::default(); cases.len()]);
    let next = AtomicUsize::new(0);
    let work = || {
        while let Some((at, case)) =
            Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, cases.get(i)?)))
        {
            let Some(truths) = truth(case.excitation, case.ailment, case.size) else { continue };
            let mut tally = Tally::default();
            for seed in 0..seeds(case) {
                tally.add(case.ailment, &ask(&truths, case.accuracy, 1000 * at as u64 + seed));
            }
            tallies.lock().expect("no worker panicked")[at] = tally;
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| (0..workers).for_each(|_| drop(scope.spawn(work))));
    tallies.into_inner().expect("no worker panicked")
}

type Row<'a> = (&'a Case, &'a Tally);

/// Standard deviations between an effect and its nearest rival: edges of the classes.
const APART: [f64; 6] = [0.0, 1.0, 2.0, 3.3, 5.0, f64::INFINITY];

/// Every row, all its figures.
pub fn csv(rows: &[Row<'_>]) -> String {
    let mut out = "excitation,effect,accuracy,size_sigma,size,runs,first,in_group,attainable_first,apart_sigma,nearest_rival,\
                   anything_else,wrong_without_doubt,error_before,error_after,leak_bias_before_lpm,\
                   leak_bias_after_lpm,explained,partly,none,unexplained\n"
        .to_owned();
    for (case, tally) in rows {
        let mean = |sum: f64| sum / tally.runs.max(1) as f64;
        let expected = case.expected.map_or(",,".to_owned(), |expected| {
            format!("{:.2},{:.1},{}", expected.first, expected.apart_sigma, expected.rival)
        });
        let _ = writeln!(
            out,
            "{:?},{},{},{},{:.3e},{},{},{},{expected},{},{},{:.4},{:.4},{:.4},{:.4},{},{},{},{}",
            case.excitation,
            case.ailment.name(),
            case.accuracy,
            5.0 * case.multiple,
            case.size,
            tally.runs,
            tally.named_first,
            tally.in_group,
            tally.anything_else,
            tally.wrong_without_doubt,
            mean(tally.error_before),
            mean(tally.error_after),
            mean(tally.leak_bias_before_lpm),
            mean(tally.leak_bias_after_lpm),
            tally.explained,
            tally.partly,
            tally.none,
            tally.unexplained,
        );
    }
    out
}

/// Sums over some rows.
#[derive(Default)]
struct Sum {
    rows: usize,
    all: Tally,
    attainable: f64,
}

fn sum<'a>(rows: impl Iterator<Item = &'a Row<'a>>) -> Sum {
    let mut sum = Sum::default();
    for (case, tally) in rows {
        let all = &mut sum.all;
        sum.rows += 1;
        sum.attainable += case.expected.map_or(0.0, |e| e.first) * tally.runs as f64;
        all.runs += tally.runs;
        all.named_first += tally.named_first;
        all.in_group += tally.in_group;
        all.anything_else += tally.anything_else;
        all.wrong_without_doubt += tally.wrong_without_doubt;
        all.explained += tally.explained;
        all.partly += tally.partly;
        all.none += tally.none;
        all.unexplained += tally.unexplained;
        all.leak_bias_before_lpm += tally.leak_bias_before_lpm;
        all.leak_bias_after_lpm += tally.leak_bias_after_lpm;
    }
    sum
}

impl Sum {
    fn percent(&self, count: usize) -> f64 {
        100.0 * count as f64 / self.all.runs.max(1) as f64
    }
}

/// The tables for people.
pub fn summary(rows: &[Row<'_>]) -> String {
    let mut out = String::new();
    write_by_size(&mut out, rows);
    write_by_distance(&mut out, rows);
    write_below(&mut out, rows);
    write_others(&mut out, rows);
    out
}

/// Values of a key among the rows, in order.
fn keys(rows: &[Row<'_>], key: impl Fn(&Case) -> f64) -> Vec<f64> {
    let known = rows.iter().filter(|(case, _)| case.expected.is_some());
    let mut keys: Vec<f64> = known.map(|(case, _)| key(case)).collect();
    keys.sort_by(f64::total_cmp);
    keys.dedup();
    keys
}

fn write_by_size(out: &mut String, rows: &[Row<'_>]) {
    out.push_str(
        "| accuracy | size | runs | right first | attainable | right in the first group | anything else | wrong without doubt | explained | largest leak bias, L/min, before → after |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for accuracy in keys(rows, |case| case.accuracy) {
        for multiple in keys(rows, |case| case.multiple) {
            let same = |case: &Case| {
                case.expected.is_some()
                    && case.accuracy.total_cmp(&accuracy).is_eq()
                    && case.multiple.total_cmp(&multiple).is_eq()
            };
            let sum = sum(rows.iter().filter(|(case, _)| same(case)));
            let (all, runs) = (&sum.all, sum.all.runs.max(1) as f64);
            let _ = writeln!(
                out,
                "| {} % | {} σ | {} | {:.0} % | {:.0} % | {:.0} % | {:.0} % | {:.1} % | {:.0} % | {:.3} → {:.3} |",
                100.0 * accuracy,
                5.0 * multiple,
                all.runs,
                sum.percent(all.named_first),
                100.0 * sum.attainable / runs,
                sum.percent(all.in_group),
                sum.percent(all.anything_else),
                sum.percent(all.wrong_without_doubt),
                sum.percent(all.explained),
                all.leak_bias_before_lpm / runs,
                all.leak_bias_after_lpm / runs,
            );
        }
    }
}

fn write_by_distance(out: &mut String, rows: &[Row<'_>]) {
    out.push_str("\n| accuracy | from its nearest rival | rows | runs | right first | attainable | right in the first group |\n|---|---|---|---|---|---|---|\n");
    for accuracy in keys(rows, |case| case.accuracy) {
        for edges in APART.windows(2) {
            let within = |case: &Case| {
                let apart = case.expected.map(|expected| expected.apart_sigma);
                case.accuracy.total_cmp(&accuracy).is_eq()
                    && apart.is_some_and(|apart| apart >= edges[0] && apart < edges[1])
            };
            let sum = sum(rows.iter().filter(|(case, _)| within(case)));
            let _ = writeln!(
                out,
                "| {} % | {} to {} σ | {} | {} | {:.0} % | {:.0} % | {:.0} % |",
                100.0 * accuracy,
                edges[0],
                edges[1],
                sum.rows,
                sum.all.runs,
                sum.percent(sum.all.named_first),
                100.0 * sum.attainable / sum.all.runs.max(1) as f64,
                sum.percent(sum.all.in_group),
            );
        }
    }
}

/// Effects whose share of right answers over all sizes and accuracies is further below the attainable one than
/// three standard deviations of the counts.
fn write_below(out: &mut String, rows: &[Row<'_>]) {
    let mut names: Vec<String> = rows.iter().map(|(case, _)| label(case)).collect();
    names.sort();
    names.dedup();
    out.push_str("\nFurther below the attainable than chance allows:");
    let mut none = true;
    for name in names {
        let of = || rows.iter().filter(|(case, _)| label(case) == name && case.expected.is_some());
        let sum = sum(of());
        let variance: f64 = of()
            .map(|(case, tally)| {
                let p = case.expected.map_or(0.0, |e| e.first);
                tally.runs as f64 * p * (1.0 - p) + 0.25
            })
            .sum();
        let short = sum.attainable - sum.all.named_first as f64;
        if short > 3.0 * variance.sqrt() {
            none = false;
            let _ = write!(
                out,
                " {name} ({} of {}, attainable {:.0});",
                sum.all.named_first, sum.all.runs, sum.attainable
            );
        }
    }
    out.push_str(if none { " none.\n" } else { "\n" });
}

fn label(case: &Case) -> String {
    format!("{:?} {}", case.excitation, case.ailment.name())
}

fn write_others(out: &mut String, rows: &[Row<'_>]) {
    out.push_str("\n| no candidate | runs | names something | without doubt | no missing effect | explained | partly explained | unexplained |\n|---|---|---|---|---|---|---|---|\n");
    for ailment in [Ailment::None, Ailment::SpoolLeak, Ailment::Ripple] {
        let all = sum(rows.iter().filter(|(case, _)| case.ailment == ailment)).all;
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            ailment.name(),
            all.runs,
            all.anything_else,
            all.wrong_without_doubt,
            all.none,
            all.explained,
            all.partly,
            all.unexplained
        );
    }
}
