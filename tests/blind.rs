//! A small blind bench against its snapshot: `data/blind-snapshot.csv` says how often each effect was named right.
//! After a deliberate change: `BLIND_SNAPSHOT=write cargo test --release --test blind`, and read the difference.

use pitchleak_testkit::blind::tables::{Tally, sweep};
use pitchleak_testkit::blind::{Ailment, Case, Excitation, cases};
use std::collections::BTreeMap;

const ACCURACIES: [f64; 1] = [1e-3];
const MULTIPLES: [f64; 1] = [3.0];
const SOUND_SEEDS: u64 = 6;
/// Another platform rounds otherwise and tosses the coins of inseparable effects anew; an effect this far from its
/// nearest rival is named right on all of them.
const SURE_SIGMA: f64 = 5.0;
/// Right names that may be lost altogether, as a share of the runs.
const SLACK: f64 = 0.06;

/// One effect's answers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Answers {
    named_first: usize,
    in_group: usize,
    wrong_without_doubt: usize,
}

fn answers(case: &Case, tally: &Tally) -> (String, Answers) {
    let Tally { named_first, in_group, wrong_without_doubt, .. } = *tally;
    let name = format!("{:?},{}", case.excitation, case.ailment.name());
    // Sizes of candidates follow from the noise of one trace, those of the others are given.
    let key = if case.expected.is_some() { name } else { format!("{name} {:.0e}", case.size) };
    (key, Answers { named_first, in_group, wrong_without_doubt })
}

fn read(text: &str) -> BTreeMap<String, Answers> {
    let line = |line: &str| {
        let mut cells = line.rsplitn(4, ',');
        let mut count = || cells.next().and_then(|cell| cell.parse().ok());
        let (wrong_without_doubt, in_group, named_first) = (count()?, count()?, count()?);
        Some((cells.next()?.to_owned(), Answers { named_first, in_group, wrong_without_doubt }))
    };
    text.lines().skip(1).filter_map(line).collect()
}

fn written(rows: &[(String, Answers)]) -> String {
    let lines = rows.iter().map(|(key, one)| {
        format!("{key},{},{},{}\n", one.named_first, one.in_group, one.wrong_without_doubt)
    });
    "excitation,effect,named_first,in_group,wrong_without_doubt\n".to_owned() + &lines.collect::<String>()
}

#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn regress_names_are_right_as_often_as_in_the_snapshot() {
    let all: Vec<Case> = [Excitation::Wind, Excitation::MultiSine]
        .into_iter()
        .flat_map(|excitation| cases(excitation, &ACCURACIES, &MULTIPLES))
        .collect();
    let tallies = sweep(&all, |case| if case.ailment == Ailment::None { SOUND_SEEDS } else { 1 });
    let rows: Vec<(String, Answers)> =
        all.iter().zip(&tallies).map(|(case, tally)| answers(case, tally)).collect();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/data/blind-snapshot.csv");
    if std::env::var_os("BLIND_SNAPSHOT").is_some() {
        std::fs::write(path, written(&rows)).expect("the snapshot is written");
    }
    let before = read(&std::fs::read_to_string(path).expect("the snapshot is there"));
    assert_eq!(before.len(), rows.len(), "the table of effects has changed: write the snapshot anew");
    let mut lost = 0;
    for ((case, (key, now)), tally) in all.iter().zip(&rows).zip(&tallies) {
        let then = before.get(key).unwrap_or_else(|| panic!("{key} is not in the snapshot"));
        lost += then.named_first.saturating_sub(now.named_first);
        if case.ailment == Ailment::None {
            assert_eq!(tally.anything_else, 0, "{key}: a sound rig is given an effect");
        }
        let sure = case.expected.is_none_or(|expected| expected.apart_sigma > SURE_SIGMA);
        assert!(!sure || now.named_first >= then.named_first, "{key}: was {then:?}, is {now:?}");
        assert!(now.in_group >= then.in_group, "{key}: was {then:?}, is {now:?}");
        assert!(now.wrong_without_doubt <= then.wrong_without_doubt, "{key}: was {then:?}, is {now:?}");
    }
    let runs = tallies.iter().map(|tally| tally.runs).sum::<usize>() as f64;
    assert!(lost as f64 <= SLACK * runs, "{lost} of {runs} names are lost");
}
