//! A small piece of the bench of confidence (`cargo bench --bench confidence`): sound rigs, two effects at once, effects that no
//! table has.

use pitchleak::diagnose::{Diagnosis, Verdict};
use pitchleak_testkit::confidence::plant::Rest;
use pitchleak_testkit::confidence::{Case, all_named, ask_all, deviations, first_is_true, line, questions};
use pitchleak_testkit::subsets;

/// Every `stride`th from `first`.
fn asked(cases: Vec<Case>, first: usize, stride: usize) -> Vec<(Case, Diagnosis)> {
    ask_all(&cases.into_iter().skip(first).step_by(stride).collect::<Vec<_>>())
}

fn lines(answers: &[(Case, Diagnosis)]) -> String {
    answers.iter().map(|(case, answer)| line(case, answer) + "\n").collect()
}

/// Whether the residual is white noise, as small as the sensors'; a name may be doubtful beside that.
fn leaves_noise(answer: &Diagnosis) -> bool {
    const LEAST_P: f64 = 2e-4;
    let is_white = |p: Option<f64>| p.is_none_or(|p| p >= LEAST_P);
    answer.after.noise_ratio.iter().all(|(_, ratio)| *ratio <= 1.0)
        && answer.after.quality.whiteness_p.iter().all(|(_, p)| is_white(*p))
}

#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn a_sound_rig_of_any_size_and_rate_lacks_nothing() {
    let answers = asked(questions::sound(1), 2, 9);
    let sound = answers.iter().filter(|(_, answer)| answer.verdict == Verdict::NoMissingEffect).count();
    let named = answers.iter().any(|(_, answer)| !answer.effects.is_empty());
    assert!(!named && sound + 1 >= answers.len(), "{sound} of {}:\n{}", answers.len(), lines(&answers));
}

#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn two_effects_are_both_named_and_their_values_hold() {
    let answers = asked(questions::two(24), 0, 2);
    let is_explained = |(case, answer): &&(Case, Diagnosis)| leaves_noise(answer) && all_named(case, answer);
    let explained = answers.iter().filter(is_explained).count();
    let first = answers.iter().filter(|(case, answer)| first_is_true(case, answer)).count();
    for (case, answer) in &answers {
        let worst = deviations(case, answer).into_iter().fold(0.0, f64::max);
        assert!(worst < 4.5, "{}", line(case, answer));
    }
    // Dry friction leaves more than noise in two.
    assert!(first == answers.len(), "{first} of {}:\n{}", answers.len(), lines(&answers));
    assert!(explained + 2 >= answers.len(), "{explained} of {}:\n{}", answers.len(), lines(&answers));
}

#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn an_effect_that_no_table_has_is_never_surely_explained_by_another() {
    for (case, answer) in asked(questions::outside(26), 0, 2) {
        let surely = answer.effects.iter().any(|effect| effect.confident);
        assert!(!(surely && answer.verdict == Verdict::Explained), "{}", line(&case, &answer));
    }
}

/// It passed for a leak that opens at a pressure, with sensors' zeros beside it, each for sure.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn a_leak_past_a_check_valve_is_larger_one_way() {
    for (case, answer) in asked(questions::checked(8), 0, 1) {
        let worst = deviations(&case, &answer).into_iter().fold(0.0, f64::max);
        let is_sure = answer.effects.len() == 1 && answer.effects[0].confident;
        assert!(first_is_true(&case, &answer) && is_sure && worst < 4.0, "{}", line(&case, &answer));
    }
}

/// A pressure sensor with play is named with its width, and not as one that answers late.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn a_sensor_that_hangs_behind_is_no_sensor_that_is_late() {
    let mut cases = questions::further(72);
    cases.retain(|case| case.name == "pressure sensor with play");
    assert!(cases.len() >= 6);
    for (case, answer) in asked(cases, 0, 2) {
        assert!(first_is_true(&case, &answer), "{}", line(&case, &answer));
        let off = answer.effects[0].value / case.truth[0].1 - 1.0;
        assert!(off.abs() < 0.1 && leaves_noise(&answer), "{}", line(&case, &answer));
        let late = answer.effects.iter().any(|effect| effect.confident && effect.id.contains("_lag"));
        assert!(!late, "{}", line(&case, &answer));
    }
}

/// Backlash of the position and a dead band of a meter are named before all else, and their sizes hold. Sensors of 1 % hide the smallest.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn backlash_and_a_dead_band_are_named_in_their_size() {
    let mut cases = questions::further(96);
    cases.retain(|case| ["backlash", "dead band"].contains(&case.name.as_str()) && case.accuracy < 1e-2);
    assert!(cases.len() >= 10, "{}", cases.len());
    for (case, answer) in asked(cases, 0, 2) {
        let worst = deviations(&case, &answer).into_iter().fold(0.0, f64::max);
        assert!(first_is_true(&case, &answer) && worst < 4.0, "{}", line(&case, &answer));
    }
}

/// A hose is its resistance, volume and inertia; clocks that drift apart are a lag that no law of the table has all the time.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn a_hose_and_clocks_apart_come_out_first_as_what_they_are_made_of() {
    let mut cases = questions::further(48);
    cases.retain(|case| ["hose with inertia", "clocks apart"].contains(&case.name.as_str()));
    assert!(cases.len() >= 8);
    for (case, answer) in asked(cases, 0, 3) {
        assert!(first_is_true(&case, &answer), "{}", line(&case, &answer));
        let is_sure = answer.effects.iter().any(|effect| effect.confident);
        assert!(case.name == "hose with inertia" || !is_sure, "{}", line(&case, &answer));
    }
}

/// Beside large effects that act on each other, or are as large as what is declared, no small wrong name is sure: a meter's lag of 0.2 ms and a
/// line's resistance beside a hose, and a mass that takes away all that is declared beside an accumulator.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn what_an_error_of_a_large_effect_leaves_is_no_sure_small_one() {
    let of = |mut cases: Vec<Case>, draw: u64, seed: u64| {
        cases.iter_mut().for_each(|case| case.seed += draw);
        cases.retain(|case| case.seed == seed);
        assert_eq!(cases.len(), 1);
        cases
    };
    let cases = [of(questions::further(72), 61_000, 63_113), of(questions::two(96), 73_000, 74_055)].concat();
    for (case, answer) in asked(cases, 0, 1) {
        let is_true = |id: &str| case.truth.iter().any(|(own, _)| *own == id);
        let wrong = answer.effects.iter().any(|effect| effect.confident && !is_true(effect.id));
        assert!(!wrong && first_is_true(&case, &answer), "{}", line(&case, &answer));
    }
}

/// One dry friction is not surely another where the motion hardly tells them apart, nor a meter's zero a turbulent leak beside a play that hides it,
/// nor are wrong areas a friction that a line's resistance hides.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn what_another_set_of_effects_may_be_is_not_surely_the_first() {
    let cases = [12, 103, 138, 199].map(|number| subsets::Case::draw_before(0x0c0f_fee1, number, 2));
    let answers = subsets::ask_all(&cases);
    assert_eq!(answers.len(), cases.len());
    for (case, answer) in &answers {
        assert!(!answer.has_a_sure_wrong_name(), "{}: {}", case.words(), answer.line());
    }
}

/// A leak the other way would explain the rest: that is no reason to take it for none, and a meter's zero for sure in its stead.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn what_would_turn_a_leak_is_no_next_effect() {
    let case = subsets::Case::draw_before(0x62b3e8, 7, 2);
    let answer = case.ask().expect("can be built");
    let is_named = answer.diagnosis.effects.iter().any(|effect| effect.id == "external_leak_b_turbulent");
    assert!(is_named && !answer.has_a_sure_wrong_name(), "{}: {}", case.words(), answer.line());
}

/// Near its end stop a chamber is small, its oil rings faster than is sampled and evaporates at times: nothing is missing there.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn what_moves_faster_than_is_sampled_is_no_missing_effect() {
    let cases = [50, 100, 180].map(|number| subsets::Case::draw(0x50f2, number, 0));
    for (case, answer) in subsets::ask_all(&cases) {
        let Diagnosis { verdict, notes, .. } = &answer.diagnosis;
        assert_eq!(*verdict, Verdict::NoMissingEffect, "{}: {notes:?}", case.words());
    }
}

/// A pressure sensor whose scale bends may pass for one with a gain and an offset, and a leak that grows faster than its pressure for one
/// that opens at a pressure: where the traces do not tell, no name is sure.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn a_bend_that_fits_as_well_takes_confidence_from_gain_and_offset_and_from_a_cracking_pressure() {
    let mut cases = questions::outside(208);
    cases.iter_mut().for_each(|case| case.seed += 41_000);
    cases.retain(|case| [43_087, 43_134].contains(&case.seed));
    assert_eq!(cases.len(), 2);
    for (case, answer) in asked(cases, 0, 1) {
        assert!(["bent pressure sensor", "steep leak"].contains(&case.name.as_str()), "{}", case.name);
        assert!(answer.effects.iter().all(|effect| !effect.confident), "{}", line(&case, &answer));
    }
}

/// The size of a leak above a pressure is known no better than that pressure is.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn a_leak_above_a_pressure_has_the_spread_of_the_pressure_in_its_own() {
    let mut cases = questions::further(48);
    cases.iter_mut().for_each(|case| case.seed += 43_000);
    cases.retain(|case| case.name == "leak above a pressure");
    for (case, answer) in asked(cases, 0, 1) {
        let worst = deviations(&case, &answer).into_iter().fold(0.0, f64::max);
        assert!(first_is_true(&case, &answer) && worst < 4.0, "{}", line(&case, &answer));
    }
}

/// Stops of a heavy piston between two samples at 20 Hz: the residual of the forces there was noise to the fit, then
/// friction.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn a_stop_that_samples_do_not_see_is_neither_noise_nor_friction() {
    let large = |seed| Case {
        size: 5.0,
        rate_hz: 20.0,
        rest: Rest::Half,
        seconds: 600.0,
        pressure_full_scale: 40e6,
        ..Case::sound("stops", seed)
    };
    for (case, answer) in asked([9509, 200_509].map(large).into(), 0, 1) {
        assert_eq!(answer.verdict, Verdict::NoMissingEffect, "{}", line(&case, &answer));
    }
}

/// A meter that reads the position a little leaves less than noise, in a colour: no name beside it is sure.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn beside_what_is_small_but_no_noise_a_weak_effect_is_doubtful() {
    let mut cases: Vec<Case> = questions::outside(7).split_off(6);
    cases.iter_mut().for_each(|case| case.seed += 11_000);
    for (case, answer) in asked(cases, 0, 1) {
        assert_eq!(case.name, "cross-talk");
        assert!(!answer.effects.is_empty(), "{}", line(&case, &answer));
        assert!(answer.effects.iter().all(|effect| !effect.confident), "{}", line(&case, &answer));
    }
}
