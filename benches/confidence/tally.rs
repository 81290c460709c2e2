//! What the answers are worth.

use crate::cases::Case;
use pitchleak::diagnose::{Diagnosis, FoundEffect, Verdict};
use rayon::prelude::*;
use std::fmt::Write;

pub fn ask_all(cases: &[Case]) -> Vec<(Case, Diagnosis)> {
    cases.par_iter().map(|case| (case.clone(), case.ask())).collect()
}

/// Whether the first name is that of an effect that is there.
pub fn first_is_true(case: &Case, answer: &Diagnosis) -> bool {
    answer.effects.first().is_some_and(|effect| is_true(case, effect))
}

/// Whether all that is there is named.
pub fn all_named(case: &Case, answer: &Diagnosis) -> bool {
    case.truth.iter().all(|(id, _)| answer.effects.iter().any(|effect| effect.id == *id))
}

fn is_true(case: &Case, effect: &FoundEffect) -> bool {
    case.truth.iter().any(|(id, _)| *id == effect.id)
}

/// How far the values of the effects that are surely named are off, in standard deviations.
pub fn deviations(case: &Case, answer: &Diagnosis) -> Vec<f64> {
    let off = |effect: &FoundEffect| {
        let (_, truth) = case.truth.iter().find(|(id, _)| *id == effect.id)?;
        effect.confident.then(|| (effect.value - truth).abs() / effect.std)
    };
    answer.effects.iter().filter_map(off).collect()
}

/// One case and what was said of it.
pub fn line(case: &Case, answer: &Diagnosis) -> String {
    let mut out = format!(
        "{:22} size {} {:3} Hz {} of {} {:?} {} s FS {:.0e} seed {}: {:?}",
        case.name,
        case.size,
        case.rate_hz,
        case.noise_share,
        case.accuracy,
        case.rest,
        case.seconds,
        case.pressure_full_scale,
        case.seed,
        answer.verdict
    );
    for one in &answer.effects {
        let sure = if one.confident { "!" } else { "?" };
        let truth = case.truth.iter().find(|(id, _)| *id == one.id).map(|(_, v)| *v);
        let off = truth.map_or(String::new(), |truth| format!(" ({:+.1}σ)", (one.value - truth) / one.std));
        let _ =
            write!(out, " {}{sure} {:.3e}±{:.1e}{off} {:?}", one.id, one.value, one.std, one.confusable_with);
    }
    let _ = write!(out, " | ratio {:?} | {:?}", answer.after.noise_ratio, answer.notes);
    out
}

pub fn summary(answers: &[(Case, Diagnosis)]) -> String {
    let count = |of: &dyn Fn(&Case, &Diagnosis) -> bool| {
        answers.iter().filter(|(case, answer)| of(case, answer)).count()
    };
    let deviations: Vec<f64> = answers.iter().flat_map(|(case, answer)| deviations(case, answer)).collect();
    let within = deviations.iter().filter(|sigma| **sigma <= 4.0).count();
    format!(
        "{} runs, {} no missing effect, {} explained, {} partly, {} unexplained; {} name something, {} something wrong surely, \
         {} explained with a sure name; first right {}, all named {}, all named and explained {}, all sure {}; {within} of {} sure values within 4 σ",
        answers.len(),
        count(&|_, a| a.verdict == Verdict::NoMissingEffect),
        count(&|_, a| a.verdict == Verdict::Explained),
        count(&|_, a| a.verdict == Verdict::PartlyExplained),
        count(&|_, a| a.verdict == Verdict::Unexplained),
        count(&|_, a| !a.effects.is_empty()),
        count(&|c, a| a.effects.iter().any(|e| e.confident && !is_true(c, e))),
        count(&|_, a| a.verdict == Verdict::Explained && a.effects.iter().any(|e| e.confident)),
        count(&first_is_true),
        count(&all_named),
        count(&|c, a| all_named(c, a) && a.verdict == Verdict::Explained),
        count(&|c, a| all_named(c, a) && a.effects.iter().all(|e| e.confident)),
        deviations.len(),
    )
}
