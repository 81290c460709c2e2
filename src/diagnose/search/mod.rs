//! Which effects are missing.

mod candidates;
mod collinearity;
mod constants;
mod exchange;
mod interaction;
mod select;
mod selection;
mod split;
mod trials;

pub(crate) use candidates::{critical_sigma, open, strongest_product};
pub use collinearity::{Candidate, Collinearity};
pub(crate) use constants::std_of_constants;
pub(crate) use interaction::interactions;
pub(crate) use selection::{Selected, Selection, loss};

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
        if !all.add_next(progress) && !split::split_one(&mut all, progress) {
            break;
        }
        all.refine_friction(progress);
        all.drop_needless(progress);
        exchange::exchange_all(&mut all, progress);
        let now = error(&all.fit);
        let mended = reduction_percent(&last, &now);
        all.effects.iter_mut().for_each(|one| _ = one.mended_percent.get_or_insert(mended));
        last = now;
    }
    // The last exchange may have left some.
    all.drop_needless(progress);
    all.drop_doubtful(progress);
    all.find_confusable();
    exchange::simplify(&mut all, progress);
    all
}

/// Largest fall of the error over the equations.
fn reduction_percent(before: &PerEquation<Option<f64>>, after: &PerEquation<Option<f64>>) -> f64 {
    let falls = before.iter().filter_map(|(equation, b)| Some(100.0 * (1.0 - after[equation]? / (*b)?)));
    falls.fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::data::Series;
    use crate::diagnose::fit::Problem;
    use crate::diagnose::testing::{TURBULENT, declared, sound, torn_seal};
    use crate::diagnose::weak_form::Term;
    use pitchleak_core::Effect;

    fn names(all: &Selection<'_>) -> Vec<Effect> {
        all.effects.iter().filter_map(|one| all.fit.problem.terms[one.term].effect()).collect()
    }

    fn found_in(series: Series) -> Vec<Effect> {
        let traces = [series];
        let problem = Problem::new(&traces, &declared(), &[]);
        names(&search(Fit::declared(&problem, &|| ()), |_| PerEquation::default(), &|| ()))
    }

    #[test]
    fn the_missing_effect_is_selected_and_nothing_in_a_sound_rig() {
        assert_eq!(found_in(torn_seal(60)), [TURBULENT.0]);
        assert_eq!(found_in(sound(60)), []);
    }

    #[test]
    fn a_wrong_name_gives_way_to_the_right_one_and_two_names_to_a_single_one() {
        let traces = [torn_seal(60)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let plain = Fit::declared(&problem, &|| ());
        for wrong in [&[Effect::FlowMeterGainA][..], &[Effect::FlowMeterGainA, Effect::FlowMeterOffsetB]] {
            let places = wrong.iter().map(|effect| problem.place(Term::Effect(*effect)).expect("is a term"));
            let effects: Vec<_> = places.map(Selected::unjudged).collect();
            let new: Vec<_> = effects.iter().map(|one| (one.term, problem.usual_constants)).collect();
            let mut all = Selection { fit: plain.changed(&[], &new, &|| ()), effects };
            exchange::exchange_all(&mut all, &|| ());
            assert!(names(&all).contains(&TURBULENT.0), "{wrong:?} became {:?}", names(&all));
            assert!(
                names(&all).len() <= wrong.len()
                    && all.effects.iter().all(|one| all.fit.active().contains(&one.term))
            );
        }
    }
}
