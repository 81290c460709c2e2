//! The tables of `docs/blind-bench.md`.

use crate::cases::{Ailment, Case};
use crate::tally::Tally;
use std::fmt::Write;

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
