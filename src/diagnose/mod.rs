//! From the residual of the model to the physical effect that it lacks.
//!
//! 1. `data`: the traces, what is declared of the rig, the noise that the sensors really carry, and mistakes of wiring,
//!    beside which no effect is worth a word.
//! 2. `weak_form`: the equations integrated against test functions around a linearisation, so that nothing is
//!    differentiated and the noise of every row follows from the rig file.
//! 3. `fit`: the declared model by generalised least squares with its priors. A fit is a value; with one more effect
//!    or without one it gives another fit.
//! 4. `search`: every known effect is a column; a score test says what it would bring, and forward selection
//!    confirmed on held-out samples names the missing ones.
//! 5. `assess`: the residual, held against the declared noise, which decides the verdict.
//! 6. `present`: text, figures, JSON, a rig file.
//!
//! The derivation is in `docs/diagnosis.md`.

mod assess;
mod calibrated_rig;
mod data;
mod equation;
mod fit;
mod json;
mod outcome;
mod search;
mod statistics;
#[cfg(test)]
mod testing;
mod thresholds;
mod weak_form;

pub use data::{Declared, FittedAndJudged, Roles, SameFile, Series, Traces};
pub use equation::{Equation, PerEquation};
pub use fit::Progress;
pub use outcome::{
    BinnedResidual, Calibration, Correlation, Diagnosis, EquationResidual, FoundEffect, HoldLeak, Holds,
    Interaction, LeakEstimate, LeakEstimates, ModelFit, Quality, Samples, Size, Verdict,
};
pub use search::{Candidate, Collinearity};

use assess::{HeldOut, model_fit};
use fit::{Fit, Problem};
use search::Selection;
use std::collections::BTreeMap;

/// Fits all of `train` as traces of one rig and judges on `test`, or, where that is empty, on blocks
/// of `train` that each fit leaves out.
pub fn diagnose(train: &[Series], test: &[Series], declared: &Declared, progress: Progress<'_>) -> Diagnosis {
    let faults = data::channel_faults(train, declared);
    let (test, _) = data::thinned(test, declared);
    let (train, declared) = data::thinned(train, declared);
    let checks = data::check_sensors(&train, &declared);
    let problem = Problem::new(&train, &declared, &checks);
    let plain = Fit::declared(&problem, progress);
    let before = model_fit(&plain, &test);
    let excited = assess::is_excited(&plain);
    let miswired = data::miswired(&train, &declared);
    let beyond_effects = miswired.as_ref().is_some_and(|found| found.is_beyond_effects);
    let selection = if excited && !beyond_effects {
        search::search(plain, |fit| HeldOut::of(fit, &test).rmse(), progress)
    } else {
        Selection::none(plain)
    };
    let after = model_fit(&selection.fit, &test);
    let judgement = assess::judge(&selection, excited, assess::failures(&checks, &faults), [&before, &after]);
    let wiring = miswired.filter(|_| beyond_effects || judgement.verdict != Verdict::Explained);
    let judged = if test.is_empty() { &train } else { &test };
    let holds = assess::check_holds(&selection, (&train, judged), &declared, &checks, progress);
    let Selection { fit, effects } = &selection;
    Diagnosis {
        samples: Samples::of(&train),
        effects: effects.iter().filter_map(|one| assess::found(&selection, one, &judgement)).collect(),
        calibration: assess::calibration(fit),
        not_detectable_below: if excited { assess::detection_limits(fit) } else { BTreeMap::new() },
        verdict: if beyond_effects { Verdict::Unexplained } else { judgement.verdict },
        wiring: wiring.map(|found| found.wiring),
        notes: assess::notes(
            &selection,
            judgement.complaints,
            &before,
            (!effects.is_empty()).then_some(&after),
            &judgement.interactions,
        ),
        before,
        after,
        interactions: judgement.interactions,
        holds,
    }
}
