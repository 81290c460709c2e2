//! From the residual to the physical effect that it lacks.
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
//! 6. `outcome`: what is said, in JSON too, and as a rig file.
//!
//! The derivation is in `docs/diagnosis.md`.

mod assess;
mod data;
mod equation;
mod fit;
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
    BinnedResidual, Calibration, Correlation, Diagnosis, Doubt, DoubtId, EquationResidual, FoundEffect,
    FoundLeakChange, HoldLeak, Holds, Interaction, LeakEstimate, LeakEstimates, ModelFit, NextMeasurement,
    Quality, Samples, Size, Verdict,
};
pub use search::{Candidate, Collinearity};

use assess::{HeldOut, model_fit};
use fit::{Fit, Problem};
use search::Selection;
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// Fits all of `train` as traces of one rig and judges on `test`, or, where that is empty, on blocks
/// of `train` that each fit leaves out.
pub fn diagnose(train: &[Series], test: &[Series], declared: &Declared, progress: Progress<'_>) -> Diagnosis {
    let faults = data::channel_faults(train, declared);
    let (test, _) = data::thinned(test, declared);
    let (train, declared) = data::thinned(train, declared);
    let checks = data::check_sensors(&train, &declared);
    let problem = Problem::new(&train, &declared, &checks);
    let plain = Selection::none(Fit::declared(&problem, progress));
    let mut before = model_fit(&plain, &test);
    let excited = assess::is_excited(&plain.fit);
    let miswired = data::miswired(&train, &declared);
    let beyond_effects = miswired.as_ref().is_some_and(|found| found.is_beyond_effects);
    let tested = data::miswired(&test, &declared).filter(|found| found.is_beyond_effects);
    let changing = OnceCell::new();
    let selection = if excited && !beyond_effects {
        let with_changes = || {
            let plain = || Problem::new(&train, &declared, &checks);
            changing.get_or_init(|| search::leak_changes::problem(plain, progress)).as_ref()
        };
        search::best(plain.fit, with_changes, |fit| HeldOut::of(fit, &test).rmse(), progress)
    } else {
        plain
    };
    if selection.fit.has_leak_changes() {
        let plain = Fit::declared(selection.fit.problem, progress);
        before = model_fit(&Selection::none(plain), &test);
    }
    let after = model_fit(&selection, &test);
    let judgement = assess::judge(&selection, assess::failures(&checks, &faults), [&before, &after]);
    let found = assess::found(&selection, &judgement);
    let verdict = match assess::verdict(&judgement, &found, &after.leaks) {
        _ if beyond_effects || tested.is_some() => Verdict::Unexplained,
        _ if !excited => Verdict::InsufficientExcitation,
        verdict => verdict,
    };
    let wiring = miswired.filter(|_| beyond_effects || verdict != Verdict::Explained);
    let judged = if test.is_empty() { &train } else { &test };
    let holds = assess::check_holds(&selection, (&train, judged), &declared, &checks, progress);
    let Selection { fit, effects, .. } = &selection;
    Diagnosis {
        samples: Samples::of(&train),
        effects: found,
        next_measurement: assess::next_measurement(&selection),
        calibration: assess::calibration(fit),
        not_detectable_below: if excited { assess::detection_limits(fit) } else { BTreeMap::new() },
        verdict,
        wiring: wiring.map(|found| found.wiring).or(tested.map(data::Miswired::of_test)),
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
        leak_changes: assess::leak_changes(fit),
        holds,
    }
}
