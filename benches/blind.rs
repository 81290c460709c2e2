//! The blind bench of the diagnosis: effects drawn from the plant at 1 kHz, sampled at 100 Hz, seen
//! through noisy sensors; the diagnosis gets the trace and the plain rig file, nothing else.
//!
//! `cargo bench --bench blind` prints the tables of `docs/bench/blind.md`. After `--`: seeds per cell, seeds
//! for the sound rig, words to pick effects, and a file for every row, e.g. `-- 5 100 friction sound rows.csv`.

use pitchleak_testkit::blind::{Ailment, Case, Excitation, cases, tables};

const ACCURACIES: [f64; 3] = [1e-3, 3e-3, 1e-2];
const MULTIPLES: [f64; 3] = [1.0, 2.0, 5.0];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let numbers: Vec<u64> = arguments.iter().filter_map(|a| a.parse().ok()).collect();
    let (files, words): (Vec<&String>, Vec<&String>) =
        arguments.iter().filter(|a| a.parse::<u64>().is_err()).partition(|a| a.ends_with(".csv"));
    let seeds = numbers.first().copied().unwrap_or(20);
    let sound_seeds = numbers.get(1).copied().unwrap_or(10 * seeds);
    let wanted =
        |case: &Case| words.is_empty() || words.iter().any(|w| case.ailment.name().contains(w.as_str()));
    let all = [Excitation::Wind, Excitation::MultiSine].into_iter();
    let all: Vec<Case> = all.flat_map(|e| cases(e, &ACCURACIES, &MULTIPLES)).filter(wanted).collect();
    let tallies = tables::sweep(&all, |case| if case.ailment == Ailment::None { sound_seeds } else { seeds });
    let rows: Vec<_> = all.iter().zip(&tallies).collect();
    print!("{}", tables::summary(&rows));
    for file in files {
        if let Err(error) = std::fs::write(file, tables::csv(&rows)) {
            eprintln!("{file}: {error}");
        }
    }
}
