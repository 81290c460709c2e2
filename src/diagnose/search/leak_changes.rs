//! Where leaks change along the traces: the partition of the rows that lets each part have leaks of its own, by dynamic programming
//! (Jackson et al. 2005, "An algorithm for optimal partitioning of data on an interval", IEEE Signal Processing Letters 12).

use super::candidates::critical_sigma;
use crate::diagnose::fit::{Emptied, Fit, LeakProducts, Problem, Progress};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{COLLINEAR_RIDGE, FALSE_RATE, MOST_CHANGE_PLACES, MOST_ROUNDS};
use crate::diagnose::weak_form::{ChangeKind, LeakChange};
use nalgebra::{Cholesky, Matrix6};
use pitchleak_core::Leak;

/// The problem with the changes that its declared model needs; none where leaks that stay do as well.
pub(crate) fn problem<'a>(plain: impl Fn() -> Problem<'a>, progress: Progress<'_>) -> Option<Problem<'a>> {
    let with = |changes: &[LeakChange]| plain().with_leak_changes(changes);
    let changes = find(with, progress);
    (!changes.is_empty()).then(|| with(&changes))
}

/// The changes that the declared model needs. While it is incomplete the noise that it is held against is large, so that the largest are
/// found first. From trace to trace leaks may be others without more than noise being left.
fn find<'a>(problem: impl Fn(&[LeakChange]) -> Problem<'a>, progress: Progress<'_>) -> Vec<LeakChange> {
    let from_trace_to_trace = between_traces(&Fit::declared(&problem(&[]), progress));
    let mut changes = needed(&problem, from_trace_to_trace, progress);
    for _ in 0..MOST_ROUNDS {
        let with = problem(&changes);
        let fit = Fit::declared(&with, progress);
        let more: Vec<LeakChange> = if fit.is_incomplete() { new_ones(&fit, &changes) } else { Vec::new() };
        if more.is_empty() {
            break;
        }
        changes.extend(more);
        changes = needed(&problem, changes, progress);
    }
    changes
}

/// Those that are more than chance.
fn needed<'a>(
    problem: &impl Fn(&[LeakChange]) -> Problem<'a>,
    changes: Vec<LeakChange>,
    progress: Progress<'_>,
) -> Vec<LeakChange> {
    if changes.is_empty() {
        return changes;
    }
    let with = problem(&changes);
    let fit = Fit::declared(&with, progress);
    let gone = needless(&fit);
    let kept = fit.leak_changes().filter(|(place, _)| !gone.contains(place));
    kept.map(|(_, change)| change).collect()
}

/// Steps of every leak where a trace follows another.
fn between_traces(fit: &Fit<'_>) -> Vec<LeakChange> {
    let rows = &fit.rows().rows;
    let begins = (1..rows.len()).filter(|row| rows[*row].trace() != rows[row - 1].trace());
    begins.flat_map(|row| of_each_leak(fit, row, ChangeKind::Step)).collect()
}

/// This change at a row, of every leak.
fn of_each_leak(fit: &Fit<'_>, row: usize, kind: ChangeKind) -> impl Iterator<Item = LeakChange> {
    let at = fit.rows().rows.get(row).map(|own| (own.trace(), own.t_s));
    at.into_iter().flat_map(move |(trace, from_s)| {
        Leak::ALL.into_iter().map(move |leak| LeakChange { leak, kind, row, trace, from_s })
    })
}

fn new_ones(fit: &Fit<'_>, known: &[LeakChange]) -> Vec<LeakChange> {
    let borders = borders(&fit.leak_products());
    let steps = borders.iter().map(|row| (*row, ChangeKind::Step));
    let growths = std::iter::once(0).chain(borders.iter().copied()).map(|row| (row, ChangeKind::Growth));
    let all = steps.chain(growths);
    let all = all.flat_map(|(row, kind)| of_each_leak(fit, row, kind));
    all.filter(|change| !known.iter().any(|other| other.overlaps(change))).collect()
}

/// Places of those without all of which no more than chance is left, the least first.
pub(super) fn needless(fit: &Fit<'_>) -> Vec<usize> {
    let mut kept: Vec<usize> = fit.leak_changes().map(|(place, _)| place).collect();
    let mut gone = Vec::new();
    let mut without = Emptied::of(fit);
    let needs = critical_sigma(fit, fit.problem.usual_constants).powi(2) * fit.dispersion(fit.free.chi2);
    loop {
        let losses = kept.iter().map(|place| (*place, without.loss(*place)));
        match losses.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((place, loss)) if loss < needs => {
                without.hold(place);
                kept.retain(|other| *other != place);
                gone.push(place);
            }
            _ => return gone,
        }
    }
}

/// What leaks of their own explain of the rows between two sums over the first rows.
fn explained(until: &LeakProducts, from: &LeakProducts) -> f64 {
    let (gram, pull) = (until.gram - from.gram, until.pull - from.pull);
    let ridge = COLLINEAR_RIDGE * gram.trace() + f64::MIN_POSITIVE;
    Cholesky::new(gram + Matrix6::from_diagonal_element(ridge))
        .map_or(0.0, |root| pull.dot(&root.solve(&pull)))
}

/// Rows at which the parts of the best partition begin, the first left out.
fn borders(products: &[LeakProducts]) -> Vec<usize> {
    let mut sums = vec![LeakProducts::default()];
    sums.extend(products.iter().scan(LeakProducts::default(), |sum, row| {
        *sum = LeakProducts { gram: sum.gram + row.gram, pull: sum.pull + row.pull };
        Some(*sum)
    }));
    let spacing = products.len().div_ceil(MOST_CHANGE_PLACES).max(1);
    let places: Vec<usize> = (0..products.len()).step_by(spacing).chain([products.len()]).collect();
    let coarse = partition(&sums, &places);
    // Between its neighbours each border moves to the row that it is best at.
    let mut fine = coarse.clone();
    for at in 0..coarse.len() {
        let from = if at == 0 { 0 } else { fine[at - 1] };
        let until = coarse.get(at + 1).copied().unwrap_or(products.len());
        let near = coarse[at].saturating_sub(spacing).max(from + 1)..(coarse[at] + spacing).min(until);
        let gain = |row: usize| explained(&sums[row], &sums[from]) + explained(&sums[until], &sums[row]);
        fine[at] = near.max_by(|a, b| gain(*a).total_cmp(&gain(*b))).unwrap_or(coarse[at]);
    }
    fine
}

/// The inner borders of the best partition among these places. Each part has to explain more than chance would of any of them, with leaks
/// that grow.
fn partition(sums: &[LeakProducts], places: &[usize]) -> Vec<usize> {
    let parts = places.len() * places.len() / 2;
    let by_chance = statistics::bonferroni_chi2(FALSE_RATE, parts, 2.0 * Leak::ALL.len() as f64);
    let mut best = vec![(0.0_f64, 0_usize)];
    for (end, until) in places.iter().enumerate().skip(1) {
        let with = |begin: usize| best[begin].0 + explained(&sums[*until], &sums[places[begin]]) - by_chance;
        let found = (0..end).map(|begin| (with(begin), begin)).max_by(|a, b| a.0.total_cmp(&b.0));
        best.push(found.unwrap_or_default());
    }
    let mut borders = Vec::new();
    let mut at = places.len() - 1;
    while at > 0 {
        at = best[at].1;
        borders.push(places[at]);
    }
    borders.pop();
    borders.reverse();
    borders
}
