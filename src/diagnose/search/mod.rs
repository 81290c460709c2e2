//! Which effects are missing.

mod candidates;
mod collinearity;
mod constants;
mod exchange;
mod interaction;
mod select;
mod selection;

pub(crate) use candidates::{nameless_chi2_drop, open};
pub use collinearity::{Candidate, Collinearity};
pub(crate) use interaction::interactions;
pub(crate) use selection::{Selected, Selection};

use crate::diagnose::equation::PerEquation;
use crate::diagnose::fit::{Fit, Progress};
use crate::diagnose::thresholds::MOST_STEPS;

/// Names effect after effect while each is significant; `error` gives the held-out error of a fit.
pub(crate) fn search<'a>(
    declared: Fit<'a>,
    error: impl Fn(&Fit<'_>) -> PerEquation<Option<f64>>,
    progress: Progress<'_>,
) -> Selection<'a> {
    let mut last = error(&declared);
    let mut all = Selection::none(declared);
    for _ in 0..MOST_STEPS {
        if !all.add_next(progress) {
            break;
        }
        all.drop_needless(progress);
        exchange::exchange_all(&mut all, progress);
        let now = error(&all.fit);
        let mended = reduction_percent(&last, &now);
        all.effects.iter_mut().for_each(|one| _ = one.mended_percent.get_or_insert(mended));
        last = now;
    }
    all.drop_doubtful(progress);
    all.find_confusable();
    all
}

/// Largest fall of the error over the equations.
fn reduction_percent(before: &PerEquation<Option<f64>>, after: &PerEquation<Option<f64>>) -> f64 {
    let falls = before.iter().filter_map(|(equation, b)| Some(100.0 * (1.0 - after[equation]? / (*b)?)));
    falls.fold(f64::NEG_INFINITY, f64::max)
}
