//! Random sets of missing effects, drawn from a seed: how often the diagnosis names them, and what its probabilities are worth.
//!
//! `cargo bench --bench subsets` prints the tables of `docs/bench/diagnosis.md`. After `--`: `pairs=200`, `triples=100`, `singles=0`, `sound=0`, `seed=6c429f8`
//! (else the version's commit), `each` for a line per rig, `wrong` for those alone that name something else.

use pitchleak_testkit::subsets::{Answer, Case, ask_all, summary};

struct Options(Vec<String>);

impl Options {
    fn value(&self, name: &str) -> Option<&str> {
        self.0.iter().find_map(|word| word.strip_prefix(name)?.strip_prefix('='))
    }

    fn has(&self, word: &str) -> bool {
        self.0.iter().any(|own| own == word)
    }

    fn seed(&self) -> u64 {
        let commit = || {
            let git =
                std::process::Command::new("git").args(["rev-parse", "--short=7", "HEAD"]).output().ok()?;
            String::from_utf8(git.stdout).ok()
        };
        let words = self.value("seed").map(str::to_owned).or_else(commit).unwrap_or_default();
        u64::from_str_radix(words.trim(), 16).unwrap_or(0)
    }
}

fn main() {
    let options = Options(std::env::args().skip(1).collect());
    let seed = options.seed();
    for (kind, effects, usual) in [("sound", 0, 0), ("singles", 1, 0), ("pairs", 2, 200), ("triples", 3, 100)]
    {
        let count = options.value(kind).and_then(|count| count.parse().ok()).unwrap_or(usual);
        let cases: Vec<Case> = (0..count).map(|number| Case::draw(seed, number, effects)).collect();
        let only = options.value("only").and_then(|n| n.parse::<usize>().ok());
        let cases: Vec<Case> = cases
            .into_iter()
            .enumerate()
            .filter(|(i, _)| only.is_none_or(|n| n == *i))
            .map(|one| one.1)
            .collect();
        let answers = ask_all(&cases);
        let is_wanted = |(_, answer): &&(Case, Answer)| {
            options.has("each") || options.has("wrong") && answer.line().contains("WRONG")
        };
        for (case, answer) in answers.iter().filter(is_wanted) {
            println!("{}: {}", case.words(), answer.line());
        }
        if count > 0 {
            println!("{kind}, seed {seed:x}: {}", summary(&answers));
        }
    }
}
