//! Every door of `fuzz`, with its seeds and some damage to them: `fuzz/run.sh` goes on from there, guided by coverage.

#[path = "../fuzz/src/lib.rs"]
mod fuzz;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Of each seed.
const DAMAGED: u32 = 10;

#[test]
fn seeds_and_damaged_seeds_are_taken_or_refused() {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds");
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (name, enter) in fuzz::DOORS {
        let entries = std::fs::read_dir(seeds.join(name)).expect("a folder of seeds");
        let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
        paths.sort();
        assert!(!paths.is_empty(), "{name} has no seed");
        for path in paths {
            let seed = std::fs::read(&path).expect("a seed");
            enter(&seed);
            for _ in 0..DAMAGED {
                enter(&damaged(&seed, &mut random));
            }
        }
    }
}

/// Some bytes changed, a part doubled or left out.
fn damaged(seed: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..random.random_range(1..6) {
        let at = random.random_range(0..bytes.len().max(1));
        let to = bytes.len().min(at + random.random_range(0..64));
        match random.random_range(0..6) {
            0 => drop(bytes.drain(at..to)),
            1 => drop(bytes.splice(at..at, seed.get(at..to).unwrap_or_default().to_vec())),
            _ => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = random.random()),
        }
    }
    bytes
}
