//! The blind judge: worlds, motions, leaks and rigs drawn from a seed; what every giver of verdicts makes of the same traces.
//!
//! `cargo bench --bench judge` prints the tables of `docs/bench/judge.md`. After `--`, in any order:
//! `worlds=lag,zero` (parts of names; `held-out`, `known`), `draws=4` per world, `number=7` that draw alone, `seed=6c429f8` (else the
//! version's commit), `accuracy=0.003`, `seconds=60`, `giver=explain` alone, `rows.csv` for a line per trace, `wrong` for a line per wrong verdict, `each` for all.

use pitchleak_testkit::judge::Case;
use pitchleak_testkit::judge::givers::{Explain, Replay, VerdictGiver};
use pitchleak_testkit::judge::score::{Judgement, Scored, Sum};
use pitchleak_testkit::judge::worlds::{WORLDS, Wires, World};
use pitchleak_testkit::options::Options;
use rayon::prelude::*;
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

const DRAWS: u64 = 4;
const SECONDS: f64 = 60.0;
const HEADER: &str = "giver,world,number,motion,size,accuracy,internal_lpm,external_a_lpm,external_b_lpm,judgement,why,log_loss,cause_named,\
                      sound_part_blamed,causes,text";

fn worlds(options: &Options) -> Vec<&'static World> {
    let asked = options.value("worlds").unwrap_or_default();
    let wanted = |world: &&World| match asked {
        "" => true,
        "held-out" => world.held_out,
        "known" => !world.held_out,
        _ => asked.split(',').any(|part| world.name.contains(part)),
    };
    WORLDS.iter().filter(wanted).collect()
}

fn main() {
    let options = Options::of_arguments();
    let seed = options.seed();
    let (accuracy, seconds) = (options.number("accuracy"), options.number("seconds").unwrap_or(SECONDS));
    let draws = match options.number::<u64>("number") {
        Some(number) => number..number + 1,
        None => 0..options.number("draws").unwrap_or(DRAWS),
    };
    let worlds = worlds(&options);
    let each = |world: &&'static World| {
        let world = *world;
        let draw = |number| Case::draw(world, number, &seed, accuracy, seconds);
        draws.clone().map(draw).collect::<Vec<_>>()
    };
    let cases: Vec<Case> = worlds.iter().flat_map(each).collect();
    let mut givers: Vec<&dyn VerdictGiver> = vec![&Replay, &Explain];
    givers.retain(|giver| options.value("giver").is_none_or(|own| own == giver.name()));
    let scored = judged(&cases, &givers);
    println!("Seed {seed}, {} traces of {seconds} s.", cases.len());
    let rows_of = |place: usize| cases.iter().zip(scored.iter().map(|all| &all[place])).collect();
    let rows: Vec<Rows<'_>> = (0..givers.len()).map(rows_of).collect();
    side_by_side(&givers, &worlds, &rows);
    givers.iter().zip(&rows).for_each(|(giver, own)| details(giver.name(), own));
    givers.iter().zip(&rows).for_each(|(giver, own)| lines(giver.name(), own, &options));
    for file in options.ending_in(".csv") {
        let rows = givers.iter().enumerate().flat_map(|(place, giver)| {
            cases.iter().zip(&scored).map(move |(case, all)| csv(giver.name(), case, &all[place]))
        });
        let text: String = std::iter::once(HEADER.to_owned() + "\n").chain(rows).collect();
        if let Err(error) = std::fs::write(file, text) {
            eprintln!("{file}: {error}");
        }
    }
}

/// On all cores, with a count on a terminal.
fn judged(cases: &[Case], givers: &[&dyn VerdictGiver]) -> Vec<Vec<Scored>> {
    let (done, start) = (AtomicUsize::new(0), Instant::now());
    let is_terminal = std::io::stderr().is_terminal();
    let judge = |case: &Case| {
        let scored = case.judge(givers);
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        if is_terminal {
            let s = start.elapsed().as_secs_f64();
            let left_s = s / done as f64 * (cases.len() - done) as f64;
            let _ = write!(std::io::stderr(), "\r{done} of {} traces, {left_s:.0} s left  ", cases.len());
        }
        scored
    };
    let scored = cases.par_iter().map(judge).collect();
    if is_terminal {
        let _ = write!(std::io::stderr(), "\r{:40}\r", "");
    }
    scored
}

type Rows<'a> = Vec<(&'a Case, &'a Scored)>;

/// A table's row: its name, and which cases are in it.
type Group = (String, Box<dyn Fn(&Case) -> bool>);

/// Every world, and sums over them.
fn groups(worlds: &[&'static World]) -> Vec<Group> {
    let of_world = |world: &&'static World| -> Group {
        let (name, mark) = (world.name, if world.held_out { " †" } else { "" });
        (format!("{}{mark}", name.replace('|', "\\|")), Box::new(move |case| case.world.name == name))
    };
    let wrong_wires = |case: &Case| case.world.ailment().wires != Wires::Right;
    let mut groups: Vec<_> = worlds.iter().map(of_world).collect();
    groups.push((
        "**known, without wiring**".into(),
        Box::new(move |case| !case.world.held_out && !wrong_wires(case)),
    ));
    groups.push(("**wiring**".into(), Box::new(wrong_wires)));
    groups.push(("**held out** †".into(), Box::new(|case| case.world.held_out)));
    groups.push(("**all**".into(), Box::new(|_| true)));
    groups
}

fn sum(rows: &Rows<'_>, is_in: &dyn Fn(&Case) -> bool) -> Sum {
    Sum::of(rows.iter().filter(|(case, _)| is_in(case)).map(|(_, scored)| *scored))
}

/// Right / open / wrong of all givers, world by world.
fn side_by_side(givers: &[&dyn VerdictGiver], worlds: &[&'static World], rows: &[Rows<'_>]) {
    let names: String = givers.iter().map(|giver| format!(" | `{}`", giver.name())).collect();
    println!("\n| right / open / wrong %{names} |\n|---|{}", "---|".repeat(givers.len()));
    for (name, is_in) in groups(worlds) {
        let cells: String = rows.iter().map(|own| format!(" | {}", sum(own, &is_in).shares())).collect();
        println!("| {name}{cells} |");
    }
}

/// All figures of one giver, in sum.
fn details(giver: &str, rows: &Rows<'_>) {
    println!("\n| `{giver}` | {} |\n|{}", Sum::HEAD, "---|".repeat(Sum::HEAD.matches('|').count() + 2));
    for (name, is_in) in groups(&[]) {
        println!("| {name} | {} |", sum(rows, &is_in).cells());
    }
}

fn lines(giver: &str, rows: &Rows<'_>, options: &Options) {
    let wanted =
        |one: &Scored| options.has("each") || (options.has("wrong") && one.judgement == Judgement::Wrong);
    for (case, one) in rows.iter().filter(|(_, one)| wanted(one)) {
        print!("{}", csv(giver, case, one));
    }
}

fn csv(giver: &str, case: &Case, one: &Scored) -> String {
    let Scored { judgement, why, log_loss, named, blamed, causes, text, .. } = one;
    let (key, judgement) = (case.key(), judgement.name());
    format!("{giver},{key},{judgement},{why},{log_loss:.4},{named},{blamed},{causes},{text}\n")
}
