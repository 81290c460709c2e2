//! Whether the diagnosis is sure where it may be, and only there: sound rigs, two effects at once, and effects that no
//! table has, by a plant of its own.
//!
//! `cargo bench --bench confidence` prints the figures of `docs/bench/diagnosis.md`. After `--`: a kind (`sound`, `long`, `two`,
//! `further`, `outside`, `better`), a number that thins the cases out, `seeds=7000` for rigs drawn anew, `only=1007` for the case with that
//! seed, and `each` for a line per case.

use pitchleak_testkit::confidence::{Case, ask_all, line, questions, summary};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let stride = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(1_usize).max(1);
    let kinds = ["sound", "long", "two", "further", "outside", "better"];
    let wanted = |kind: &str| {
        !arguments.iter().any(|a| kinds.contains(&a.as_str())) || arguments.iter().any(|a| a == kind)
    };
    let all: [(&str, Vec<Case>); 6] = [
        ("sound", questions::sound(stride)),
        ("long", questions::long(20 / stride)),
        ("two", questions::two(96 / stride)),
        ("further", questions::further(48 / stride)),
        ("outside", questions::outside(208 / stride)),
        ("better", questions::better(84 / stride)),
    ];
    let further = arguments.iter().find_map(|a| a.strip_prefix("seeds=")?.parse().ok()).unwrap_or(0_u64);
    let only = arguments.iter().find_map(|a| a.strip_prefix("only=")?.parse().ok());
    let each = arguments.iter().any(|a| a == "each");
    for (kind, mut cases) in all.into_iter().filter(|(kind, _)| wanted(kind)) {
        cases.iter_mut().for_each(|case| case.seed += further);
        cases.retain(|case| only.is_none_or(|seed: u64| case.seed == seed));
        let answers = ask_all(&cases);
        if each {
            answers.iter().for_each(|(case, answer)| println!("{}", line(case, answer)));
        }
        println!("{kind}: {}", summary(&answers));
    }
}
