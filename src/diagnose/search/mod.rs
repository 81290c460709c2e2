//! Which effects are missing.

mod candidates;
pub(crate) mod leak_changes;
mod selection;
mod sets;
mod trials;

pub(crate) use candidates::{critical_sigma, open, strongest_unlisted};
pub(crate) use selection::{Rival, Selected, Selection, interactions, loss};
pub use trials::{Candidate, Collinearity};
pub(crate) use trials::{constant_at_end, std_of_constants};

use crate::diagnose::equation::PerEquation;
use crate::diagnose::fit::{Fit, Problem, Progress};
use crate::diagnose::thresholds::{FEW_EFFECTS, MOST_ROUNDS};

/// The effects that are missing from a declared model whose leaks stay, or from one whose leaks change: whichever says more with less.
/// Leaks are asked whether they change once a few effects leave more than noise, and where there are several traces.
pub(crate) fn best<'a>(
    declared: Fit<'a>,
    with_changes: impl FnOnce() -> Option<&'a Problem<'a>>,
    error: impl Fn(&Fit<'_>) -> PerEquation<Option<f64>>,
    progress: Progress<'_>,
) -> Selection<'a> {
    let mut staying = Selection::none(declared);
    add_while(
        &mut staying,
        |all| all.effects.len() < FEW_EFFECTS || !all.fit.is_incomplete(),
        &error,
        progress,
    );
    let is_whole = !staying.fit.is_incomplete();
    if is_whole && (staying.effects.is_empty() || staying.fit.traces() == 1) {
        return finished(staying, &error, progress);
    }
    let changing = with_changes().map(|problem| search(Fit::declared(problem, progress), &error, progress));
    // While something else is missing, what leaks seem to do is that one's doing.
    let changing = changing.filter(|all| !all.fit.is_incomplete());
    if is_whole {
        let chosen = changing.filter(|other| other.is_commoner_than(&staying));
        return chosen.unwrap_or_else(|| finished(staying, &error, progress));
    }
    let changing = match changing {
        // More effects than these few would cost more.
        Some(whole) if whole.effects.is_empty() || whole.size() <= FEW_EFFECTS => return whole,
        changing => changing,
    };
    add_while(&mut staying, |_| true, &error, progress);
    let staying = finished(staying, &error, progress);
    changing.filter(|other| other.is_likelier_than(&staying)).unwrap_or(staying)
}

/// Names effect after effect while each is significant; `error` gives the held-out error of a fit.
pub(crate) fn search<'a>(
    declared: Fit<'a>,
    error: impl Fn(&Fit<'_>) -> PerEquation<Option<f64>>,
    progress: Progress<'_>,
) -> Selection<'a> {
    let mut all = Selection::none(declared);
    add_while(&mut all, |_| true, &error, progress);
    finished(all, &error, progress)
}

/// Adds effects while there are further ones, and `goes_on`.
fn add_while(
    all: &mut Selection<'_>,
    goes_on: impl Fn(&Selection<'_>) -> bool,
    error: impl Fn(&Fit<'_>) -> PerEquation<Option<f64>>,
    progress: Progress<'_>,
) {
    let mut last = error(&all.fit);
    for _ in 0..MOST_ROUNDS {
        if !goes_on(all) || !all.add_next(progress) {
            break;
        }
        all.drop_needless(progress);
        let now = error(&all.fit);
        let mended = reduction_percent(&last, &now);
        all.effects.iter_mut().for_each(|one| _ = one.mended_percent.get_or_insert(mended));
        last = now;
    }
}

/// Without those that the last exchange may have left needless, each held against the sets without it. Another set may want others beside.
fn finished<'a>(
    mut all: Selection<'a>,
    error: &impl Fn(&Fit<'_>) -> PerEquation<Option<f64>>,
    progress: Progress<'_>,
) -> Selection<'a> {
    let is_last = |all: &Selection<'_>, weighed: &sets::Weighed| weighed.last() == Some(&all.named());
    let mut weighed = sets::Weighed::new();
    for _ in 0..MOST_ROUNDS {
        all.drop_needless(progress);
        all.drop_needless_changes(progress);
        all.drop_doubtful(progress);
        if is_last(&all, &weighed) || !sets::weigh(&mut all, &mut weighed, progress) {
            return all;
        }
        add_while(&mut all, |_| true, error, progress);
    }
    if !is_last(&all, &weighed) {
        sets::weigh(&mut all, &mut weighed, progress);
    }
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
    use crate::diagnose::testing::{TURBULENT, declared, seen, sound, torn_seal};
    use crate::diagnose::weak_form::Term;
    use pitchleak_core::Effect;

    fn names(all: &Selection<'_>) -> Vec<Effect> {
        all.effects.iter().filter_map(|one| all.fit.problem.terms[one.term].effect()).collect()
    }

    fn found_in(series: Series) -> Vec<Effect> {
        let traces = [series];
        let problem = Problem::new(&traces, &declared(), &[]);
        let plain = Fit::declared(&problem, &|| ());
        names(&search(plain, |_| PerEquation::default(), &|| ()))
    }

    #[test]
    fn the_missing_effect_is_selected_and_nothing_in_a_sound_rig() {
        assert_eq!(found_in(torn_seal(60)), [TURBULENT.0]);
        assert_eq!(found_in(sound(60)), []);
    }

    #[test]
    fn a_leak_whose_gap_the_pressure_widens_makes_no_meters_zero_sure() {
        let sure_of_zero = |flow_m3s: fn(f64) -> f64| {
            let traces =
                [seen(60, |sample| sample.qa_m3s = sample.qa_m3s.map(|q| q + flow_m3s(sample.pa_pa)))];
            let problem = Problem::new(&traces, &declared(), &[]);
            let all = search(Fit::declared(&problem, &|| ()), |_| PerEquation::default(), &|| ());
            assert_eq!(names(&all), [Effect::FlowMeterOffsetA]);
            all.effects[0].unlisted_rival.is_none()
        };
        assert!(sure_of_zero(|_| 5e-6) && sure_of_zero(|_| -5e-6));
        assert!(!sure_of_zero(|pa_pa| 5e-6 * (pa_pa / 5e6).powi(2)));
        assert!(!sure_of_zero(|pa_pa| 5e-6 * (pa_pa / 5e6).powi(3)));
    }

    #[test]
    fn one_effect_that_stands_for_two_gives_way_to_them() {
        let traces = [seen(60, |sample| {
            sample.pb_pa -= 2e4;
            sample.qb_m3s = sample.qb_m3s.map(|q| 1.006 * q);
        })];
        let problem = Problem::new(&traces, &declared(), &[]);
        let area = problem.place(Term::Effect(Effect::AreaB)).expect("is a term");
        let fit = Fit::declared(&problem, &|| ()).with(area, problem.usual_constants, &|| ());
        let mut all = Selection { effects: vec![Selected::new(area, 1.0)], ..Selection::none(fit) };
        assert!(sets::weigh(&mut all, &mut Vec::new(), &|| ()));
        let names = names(&all);
        assert!(names.contains(&Effect::FlowMeterGainB) && !names.contains(&Effect::AreaB), "{names:?}");
        assert!(names.contains(&Effect::PressureOffsetB), "{names:?}");
    }

    #[test]
    fn a_wrong_name_gives_way_to_the_right_one_and_two_names_to_a_single_one() {
        let traces = [torn_seal(60)];
        let problem = Problem::new(&traces, &declared(), &[]);
        let plain = Fit::declared(&problem, &|| ());
        for wrong in [&[Effect::FlowMeterGainA][..], &[Effect::FlowMeterGainA, Effect::FlowMeterOffsetB]] {
            let places = wrong.iter().map(|effect| problem.place(Term::Effect(*effect)).expect("is a term"));
            let effects: Vec<_> = places.map(|term| Selected::new(term, 1.0)).collect();
            let new: Vec<_> = effects.iter().map(|one| (one.term, problem.usual_constants)).collect();
            let mut all = Selection { effects, ..Selection::none(plain.changed(&[], &new, &|| ())) };
            sets::weigh(&mut all, &mut Vec::new(), &|| ());
            assert!(names(&all).contains(&TURBULENT.0), "{wrong:?} became {:?}", names(&all));
            assert!(
                names(&all).len() <= wrong.len()
                    && all.effects.iter().all(|one| all.fit.active().contains(&one.term))
            );
        }
    }
}
