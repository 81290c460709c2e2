//! The tables of `docs/bench-of-lies.md`, and the snapshot's form.

use crate::judge::Door;
use crate::lie::{Family, LIES};
use crate::plant::leak_name;
use crate::sweep::Outcome;
use std::fmt::Write;

pub const HEADER: &str =
    "door,family,lie,leak,accuracy,wind,right,in_doubt,confidently_wrong,named,misnamed\n";

/// What a row of the bench is about, as the first cells of its line.
pub fn key(outcome: &Outcome) -> String {
    let Outcome { door, lie, leaking, accuracy, wind, .. } = outcome;
    let (door, family, leak) = (door.name(), lie.family.name(), leak_name(*leaking));
    format!("{door},{family},{},{leak},{accuracy},{}", lie.name, wind.mean_mps())
}

/// Every row.
pub fn csv(outcomes: &[Outcome]) -> String {
    let line = |one: &Outcome| {
        let Outcome { right, in_doubt, confidently_wrong, named, misnamed, .. } = one;
        format!("{},{right},{in_doubt},{confidently_wrong},{named},{misnamed}\n", key(one))
    };
    HEADER.to_owned() + &outcomes.iter().map(line).collect::<String>()
}

/// Runs, and those right, in doubt, confidently wrong, named, misnamed, of the outcomes that match.
fn sums(outcomes: &[Outcome], matches: impl Fn(&Outcome) -> bool) -> [usize; 6] {
    outcomes.iter().filter(|one| matches(one)).fold(
        [0; 6],
        |[runs, right, doubt, wrong, named, misnamed], one| {
            [
                runs + one.runs(),
                right + one.right,
                doubt + one.in_doubt,
                wrong + one.confidently_wrong,
                named + one.named,
                misnamed + one.misnamed,
            ]
        },
    )
}

fn line(out: &mut String, name: &str, [runs, right, doubt, wrong, named, misnamed]: [usize; 6]) {
    let _ = writeln!(out, "| {name} | {runs} | {right} | {doubt} | {named} | {misnamed} | {wrong} |");
}

/// The tables for people, door by door.
pub fn summary(outcomes: &[Outcome]) -> String {
    let of_door = |door: Door| {
        let own: Vec<Outcome> = outcomes.iter().filter(|one| one.door == door).copied().collect();
        tables(door, &own)
    };
    Door::ALL.map(of_door).join("\n")
}

fn tables(door: Door, outcomes: &[Outcome]) -> String {
    let mut out = String::new();
    let head = |out: &mut String, title: &str, what: &str| {
        let _ = write!(
            out,
            "## `{}`: {title}\n\n| {what} | runs | right | in doubt | of these named | misnamed | confidently wrong |\n|---|---|---|---|---|---|---|\n",
            door.name()
        );
    };
    head(&mut out, "by family", "family");
    for family in Family::ALL {
        line(&mut out, family.name(), sums(outcomes, |one| one.lie.family == family));
    }
    out.push('\n');
    for (title, what, families) in [
        ("right and sure is asked", "accuracy, wind", &[Family::Honest, Family::Harmless][..]),
        ("right or in doubt is asked", "accuracy, wind", &[Family::Offset, Family::Mistake][..]),
    ] {
        head(&mut out, title, what);
        let mut conditions: Vec<_> = outcomes.iter().map(|one| (one.accuracy, one.wind)).collect();
        conditions.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        conditions.dedup();
        for (accuracy, wind) in conditions {
            let same = |one: &Outcome| one.accuracy.to_bits() == accuracy.to_bits() && one.wind == wind;
            let name = format!("{:.1} %, {} m/s", 100.0 * accuracy, wind.mean_mps());
            line(&mut out, &name, sums(outcomes, |one| families.contains(&one.lie.family) && same(one)));
        }
        out.push('\n');
    }
    head(&mut out, "by lie", "lie");
    for lie in LIES {
        let name = format!("{} ({})", lie.name, lie.family.name());
        line(&mut out, &name, sums(outcomes, |one| one.lie.name == lie.name));
    }
    out
}
