//! Random sets of missing effects, drawn from a seed: how often the diagnosis names them, and what its probabilities are worth.
//!
//! `cargo bench --bench subsets` prints the tables of `docs/bench/diagnosis.md`. After `--`: `pairs=200`, `triples=100`, `singles=0`, `sound=0`, `number=7`
//! that rig of each kind alone, `seed=6c429f8` (else the version's commit; hexadecimal), `each` for a line per rig, `wrong` for those alone that name something else.

use pitchleak_testkit::options::Options;
use pitchleak_testkit::subsets::{Answer, Case, ask_all, summary};

fn main() {
    let options = Options::of_arguments();
    let seed = u64::from_str_radix(&options.seed(), 16).unwrap_or(0);
    let only = options.number::<u64>("number");
    for (kind, effects, usual) in [("sound", 0, 0), ("singles", 1, 0), ("pairs", 2, 200), ("triples", 3, 100)]
    {
        let count = options.number(kind).unwrap_or(usual);
        let numbers = (0..count).filter(|number| only.is_none_or(|only| only == *number));
        let cases: Vec<Case> = numbers.map(|number| Case::draw(seed, number, effects)).collect();
        let answers = ask_all(&cases);
        let is_wanted = |(_, answer): &&(Case, Answer)| {
            options.has("each") || options.has("wrong") && answer.has_a_wrong_name()
        };
        for (case, answer) in answers.iter().filter(is_wanted) {
            println!("{}: {}", case.words(), answer.line());
        }
        if count > 0 {
            println!("{kind}, seed {seed:x}: {}", summary(&answers));
        }
    }
}
