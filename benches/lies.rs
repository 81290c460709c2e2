//! The bench of lies: what `replay` and `watch` make of traces whose sensors, wires or recorder lie, of a cylinder that does
//! what the estimator's model leaves out.
//!
//! `cargo bench --bench lies` prints the tables of `docs/bench/lies.md`. After `--`: seeds per row, and a file for
//! every row, e.g. `-- 3 rows.csv`. `-- on-its-way 1 2 0.003` judges all that streams say where a
//! meter's zero is off: seeds, and the sensors' accuracies.

use pitchleak::wind::WindCase;
use pitchleak_testkit::lies::judge::{csv, summary, sweep};
use pitchleak_testkit::lies::on_its_way;

const ACCURACIES: [f64; 3] = [1e-3, 3e-3, 1e-2];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let seeds = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(1);
    if arguments.iter().any(|a| a == "on-its-way") {
        let (accuracies, seeds) = arguments.iter().partition::<Vec<_>, _>(|a| a.contains('.'));
        let seeds: Vec<u64> = seeds.iter().filter_map(|a| a.parse().ok()).collect();
        let accuracies: Vec<f64> = accuracies.iter().filter_map(|a| a.parse().ok()).collect();
        return on_its_way::print(&accuracies, &seeds);
    }
    let outcomes = sweep(&ACCURACIES, &WindCase::ALL, seeds, 1);
    print!("{}", summary(&outcomes));
    for file in arguments.iter().filter(|a| a.ends_with(".csv")) {
        if let Err(error) = std::fs::write(file, csv(&outcomes)) {
            eprintln!("{file}: {error}");
        }
    }
}
