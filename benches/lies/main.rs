//! The bench of lies: what `replay` and `watch` make of traces whose sensors, wires or recorder lie, of a cylinder that does
//! what the estimator's model leaves out.
//!
//! `cargo bench --bench lies` prints the tables of `docs/bench-of-lies.md`. After `--`: seeds per row, and a file for
//! every row, e.g. `-- 3 rows.csv`.

mod judge;
mod lie;
mod plant;
mod sweep;
mod table;

use pitchleak::wind::WindCase;

const ACCURACIES: [f64; 3] = [1e-3, 3e-3, 1e-2];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let seeds = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(1);
    let outcomes = sweep::sweep(&ACCURACIES, &WindCase::ALL, seeds);
    print!("{}", table::summary(&outcomes));
    for file in arguments.iter().filter(|a| a.ends_with(".csv")) {
        if let Err(error) = std::fs::write(file, table::csv(&outcomes)) {
            eprintln!("{file}: {error}");
        }
    }
}
