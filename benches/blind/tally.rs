//! What came of the seeds of one case.

use crate::cases::{Ailment, Case, LEAKS, ask, truth};
use pitchleak::core::effects::EffectKind;
use pitchleak::diagnose::{Diagnosis, LeakEstimates, PerEquation, Verdict};
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
    /// The same, without a word of doubt and without the truth in its group.
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
