//! A small bench of lies against its snapshot: `data/lies-snapshot.csv` says how each trace was judged.
//! After a deliberate change: `LIES_SNAPSHOT=write cargo test --release --test lies`, and read the difference. That sees each
//! mistake beside every leak, this test each beside one leak in a wind and beside another in the other: minutes.

use pitchleak::wind::WindCase;
use pitchleak_testkit::lies::judge::{Door, Outcome, csv, key, sweep};
use pitchleak_testkit::lies::{Family, LEAKING, LIES, OPENS_S, on_its_way};
use std::collections::{BTreeMap, BTreeSet};

const ACCURACIES: [f64; 1] = [3e-3];
const WINDS: [WindCase; 2] = [WindCase::Mps5, WindCase::Mps13];
/// Leaks of 0.5 L/min beside honest sensors are known for sure within this time of a stream's begin, s.
const SURE_WITHIN_S: f64 = 10.0;
/// A leak of 0.2 L/min that opens beside them within this time, s.
const SMALL_LEAK_SURE_WITHIN_S: f64 = 10.0;
/// Of the streams this share may at some moment be sure of what is not so: α, which is what *sure* leaves.
const SURE_AND_WRONG: f64 = 0.05;
/// Share of the mistakes in doubt that are named at the least.
const NAMED: f64 = 0.85;
/// Another platform rounds otherwise and may turn a coin or two, as a share of a family's runs.
const SLACK: f64 = 0.01;

fn slack(runs: usize) -> usize {
    (SLACK * runs as f64).ceil() as usize
}

/// Right and confidently wrong ones of each row.
fn read(text: &str) -> BTreeMap<String, (usize, usize)> {
    let line = |line: &str| {
        let mut cells = line.rsplitn(6, ',');
        let mut count = || cells.next().and_then(|cell| cell.parse().ok());
        let [_misnamed, _named, wrong, _doubt, right] = [count()?, count()?, count()?, count()?, count()?];
        Some((cells.next()?.to_owned(), (right, wrong)))
    };
    text.lines().skip(1).filter_map(line).collect()
}

#[test]
fn every_lie_has_a_name_of_its_own() {
    let names: BTreeSet<_> = LIES.iter().map(|lie| lie.name).collect();
    assert_eq!(names.len(), LIES.len());
    let mistakes = LIES.iter().filter(|lie| lie.family == Family::Mistake).count();
    assert!(mistakes >= 40, "{mistakes} mistakes");
}

/// Whatever a stream says before its last word was read as well, and acted on.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn words_of_a_stream_on_its_way_are_as_sure_as_they_say_where_a_meters_zero_is_off() {
    let streams = on_its_way::sweep(&ACCURACIES, &WINDS, &[1]);
    let wrong: Vec<_> = streams.iter().filter(|stream| !stream.wrong_s.is_empty()).collect();
    assert!(wrong.len() as f64 <= SURE_AND_WRONG * streams.len() as f64, "{wrong:#?}");
    let honest = streams.iter().filter(|one| one.lie.family == Family::Honest && one.leaking.is_some());
    for stream in honest {
        assert!(stream.sure_s.is_some_and(|s| s <= SURE_WITHIN_S), "{stream:#?}");
    }
}

/// No leak lets oil in: zeros explain a leak beside another one that does, and only so in calm wind.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn a_small_leak_that_opens_beside_honest_sensors_is_soon_sure() {
    for stream in on_its_way::openings(&ACCURACIES, &WINDS, &[1], 0.2) {
        let sure_s = stream.sure_s.map(|s| s - OPENS_S);
        assert!(sure_s.is_some_and(|s| s <= SMALL_LEAK_SURE_WITHIN_S), "{sure_s:?}: {stream:#?}");
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn regress_no_family_is_judged_worse_than_in_the_snapshot() {
    let writes = std::env::var_os("LIES_SNAPSHOT").is_some();
    let outcomes = sweep(&ACCURACIES, &WINDS, 1, if writes { 1 } else { LEAKING.len() });
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/data/lies-snapshot.csv");
    if writes {
        std::fs::write(path, csv(&outcomes)).expect("the snapshot is written");
    }
    let before = read(&std::fs::read_to_string(path).expect("the snapshot is there"));
    let rows = Door::ALL.len() * LIES.len() * LEAKING.len() * WINDS.len();
    assert_eq!(before.len(), rows, "the lies have changed: write the snapshot anew");
    for (door, family) in Door::ALL.into_iter().flat_map(|door| Family::ALL.map(|family| (door, family))) {
        let (mut runs, mut lost, mut misnamed, mut wrong) = (0, 0, 0, Vec::new());
        let own = |outcome: &&Outcome| outcome.door == door && outcome.lie.family == family;
        for outcome in outcomes.iter().filter(own) {
            let key = key(outcome);
            let (right, wrong_before) =
                before.get(&key).unwrap_or_else(|| panic!("{key} is not in the snapshot"));
            runs += outcome.runs();
            lost += right.saturating_sub(outcome.right);
            misnamed += outcome.misnamed;
            if outcome.confidently_wrong > *wrong_before {
                wrong.push(key);
            }
        }
        let slack = slack(runs);
        assert!(wrong.len() <= slack, "{door:?}, {family:?}: newly confidently wrong: {wrong:#?}");
        let must_be_sure = matches!(family, Family::Honest | Family::Harmless);
        assert!(!must_be_sure || misnamed == 0, "{door:?}, {family:?}: {misnamed} accused of wrong wires");
        // To doubt a trace whose meters lie is no loss.
        assert!(
            !must_be_sure || lost <= slack,
            "{door:?}, {family:?}: {lost} of {runs} right and sure ones are lost"
        );
    }
    mistakes_are_named(&outcomes);
}

/// Of `replay`'s doubts that a mistake is behind.
fn mistakes_are_named(outcomes: &[Outcome]) {
    let own = |one: &&Outcome| one.door == Door::Replay && one.lie.family == Family::Mistake;
    let sum = |of: fn(&Outcome) -> usize| outcomes.iter().filter(own).map(of).sum::<usize>();
    let (doubts, named, misnamed) = (sum(|one| one.in_doubt), sum(|one| one.named), sum(|one| one.misnamed));
    assert!(named as f64 >= NAMED * doubts as f64, "of {doubts} mistakes in doubt {named} are named");
    for one in outcomes.iter().filter(own).filter(|one| one.misnamed > 0) {
        println!("misnamed: {}", key(one));
    }
    assert!(misnamed <= slack(doubts), "of {doubts} mistakes in doubt {misnamed} are called another");
}
