//! The blind judge: worlds, motions, leaks and rigs drawn from a seed; what every giver of verdicts makes of the same traces.
//!
//! `cargo bench --bench judge` prints the tables of `docs/judge.md`. After `--`, in any order:
//! `worlds=lag,zero` (parts of names; `held-out`, `known`), `draws=4` per world, `number=7` that draw alone, `seed=6c429f8` (else the
//! version's commit), `accuracy=0.003`, `seconds=60`, `rows.csv` for a line per trace, `wrong` for a line per wrong verdict, `each` for all.

use pitchleak_testkit::judge::Case;
use pitchleak_testkit::judge::givers::{Replay, VerdictGiver};
use pitchleak_testkit::judge::score::{Judgement, Scored, Sum};
use pitchleak_testkit::judge::worlds::{WORLDS, World};
use rayon::prelude::*;
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

const DRAWS: u64 = 4;
const SECONDS: f64 = 60.0;
const HEADER: &str = "giver,world,number,motion,size,accuracy,internal_lpm,external_a_lpm,external_b_lpm,judgement,why,log_loss,cause_named,\
                      sound_part_blamed,causes,text";

struct Options(Vec<String>);

impl Options {
    fn value(&self, name: &str) -> Option<&str> {
        self.0.iter().find_map(|word| word.strip_prefix(name)?.strip_prefix('='))
    }

    fn number<T: std::str::FromStr>(&self, name: &str) -> Option<T> {
        self.value(name)?.parse().ok()
    }

    fn has(&self, word: &str) -> bool {
        self.0.iter().any(|own| own == word)
    }

    fn seed(&self) -> String {
        let commit = || {
            let git =
                std::process::Command::new("git").args(["rev-parse", "--short=7", "HEAD"]).output().ok()?;
            Some(String::from_utf8(git.stdout).ok()?.trim().to_owned())
        };
        self.value("seed")
            .map(str::to_owned)
            .or_else(commit)
            .filter(|seed| !seed.is_empty())
            .unwrap_or("0".into())
    }

    fn worlds(&self) -> Vec<&'static World> {
        let asked = self.value("worlds").unwrap_or_default();
        let wanted = |world: &&World| match asked {
            "" => true,
            "held-out" => world.held_out,
            "known" => !world.held_out,
            _ => asked.split(',').any(|part| world.name.contains(part)),
        };
        WORLDS.iter().filter(wanted).collect()
    }
}

fn main() {
    let options = Options(std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect());
    let seed = options.seed();
    let (accuracy, seconds) = (options.number("accuracy"), options.number("seconds").unwrap_or(SECONDS));
    let draws = match options.number::<u64>("number") {
        Some(number) => number..number + 1,
        None => 0..options.number("draws").unwrap_or(DRAWS),
    };
    let worlds = options.worlds();
    let each = |world: &&'static World| {
        let world = *world;
        let draw = |number| Case::draw(world, number, &seed, accuracy, seconds);
        draws.clone().map(draw).collect::<Vec<_>>()
    };
    let cases: Vec<Case> = worlds.iter().flat_map(each).collect();
    let givers: [&dyn VerdictGiver; 1] = [&Replay];
    let scored = judged(&cases, &givers);
    println!("Seed {seed}, {} traces of {seconds} s.", cases.len());
    for (place, giver) in givers.iter().enumerate() {
        let rows: Vec<(&Case, &Scored)> = cases.iter().zip(scored.iter().map(|all| &all[place])).collect();
        table(giver.name(), &worlds, &rows);
        lines(giver.name(), &rows, &options);
    }
    for file in options.0.iter().filter(|word| word.ends_with(".csv")) {
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

fn table(giver: &str, worlds: &[&World], rows: &[(&Case, &Scored)]) {
    let columns = Sum::HEAD.matches('|').count() + 2;
    println!("\n| `{giver}` | {} |\n|{}", Sum::HEAD, "---|".repeat(columns));
    let line = |name: &str, of: &dyn Fn(&Case) -> bool| {
        let own = rows.iter().filter(|(case, _)| of(case)).map(|(_, scored)| *scored);
        println!("| {name} | {} |", Sum::of(own).cells());
    };
    for world in worlds {
        let mark = if world.held_out { " †" } else { "" };
        line(&format!("{}{mark}", world.name.replace('|', "\\|")), &|case| case.world.name == world.name);
    }
    let wrong_wires = |case: &Case| case.world.ailment().wires != Default::default();
    line("**known, without wiring**", &|case| !case.world.held_out && !wrong_wires(case));
    line("**wiring**", &wrong_wires);
    line("**held out** †", &|case| case.world.held_out);
    line("**all**", &|_| true);
}

fn lines(giver: &str, rows: &[(&Case, &Scored)], options: &Options) {
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
