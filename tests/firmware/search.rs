//! What a controller has to be ready for: the worst sample that a search finds over rates, gaps, lost readings, jumps, growing
//! leaks and alarms. A trace of our own says too little: one with another leak took half as much again.
//!
//! The search is seeded. It takes random recordings, then changes the worst of them bit by bit; the recording found stays in
//! the folder that is printed.

use super::scene::Scene;
use super::{PROGRAMS, Rig, declared, emulate, folder, samples, sensors, stands_in_docs};
use pitchleak_testkit::seeded;
use rand::RngExt;
use std::collections::BTreeMap;
use std::fmt::Write as _;

const BEGIN: &str = "<!-- firmware search: begin -->\n";
const END: &str = "<!-- firmware search: end -->\n";
const HEADER: &str = "\
| estimator | update | sample, alarms included |
|---|---|---|
";
/// Recordings drawn at random, and changes of the worst of them. A night's search may ask for more.
const DRAWN: usize = 14;
const CHANGED: usize = 26;
/// What a search found.
#[derive(Default)]
struct Found {
    update: u32,
    sample: u32,
}

/// As many as whoever runs it asks for.
fn asked(name: &str, usual: usize) -> usize {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

fn search(program: &str, rig: &Rig) -> Found {
    let mut random = seeded(31);
    let (mut found, mut worst): (Found, Option<(u32, Scene)>) = (Found::default(), None);
    let (drawn, changed) = (asked("PITCHLEAK_DRAWN", DRAWN), asked("PITCHLEAK_CHANGED", CHANGED));
    for round in 0..drawn + changed {
        let mut scene = match &worst {
            Some((_, scene)) if round >= drawn => scene.clone(),
            _ => Scene::drawn(&mut random),
        };
        if round >= drawn {
            scene.change(random.random_range(0..9), &mut random);
        }
        let sample = measure(program, rig, &scene, &mut found);
        if worst.as_ref().is_none_or(|(before, _)| sample > *before) {
            let kept = folder(program).join("worst.f32");
            std::fs::copy(folder(program).join("trace.f32"), &kept).unwrap();
            println!("{program}: {sample} instructions in a sample of {scene:?}, kept as {}", kept.display());
            worst = Some((sample, scene));
        }
    }
    found
}

/// Instructions of the scene's worst sample.
fn measure(program: &str, rig: &Rig, scene: &Scene, found: &mut Found) -> u32 {
    let (sensors, records) = (sensors(rig, program), scene.records(rig));
    let run = emulate(program, &[declared(rig, &sensors), samples(&records)].concat());
    found.update = found.update.max(run.worst);
    found.sample = found.sample.max(run.sample);
    run.sample
}

#[test]
#[ignore = "needs qemu-system-arm, and some minutes; .ci/run runs it"]
fn no_sample_takes_more_than_the_docs_say() {
    super::build();
    let rig = Rig::load("data/traces/rig.toml").unwrap();
    let mut table = String::from(HEADER);
    let mut measured = BTreeMap::new();
    // Lost readings are waited for: that takes more than to let their flow rest.
    for (program, title) in PROGRAMS.into_iter().filter(|(program, _)| program.starts_with("clocks")) {
        let Found { update, sample } = search(program, &rig);
        writeln!(table, "| {title} | {update} | {sample} |").unwrap();
        measured.insert(title, [update, sample]);
    }
    println!("{table}");
    let Some(stands) = stands_in_docs([BEGIN, END], &table) else { return };
    for (title, numbers) in measured {
        let row = stands.lines().find(|line| line.starts_with(&format!("| {title} |"))).unwrap();
        let said = row.split('|').skip(2).filter_map(|cell| cell.trim().parse::<u32>().ok());
        for (number, said) in numbers.into_iter().zip(said) {
            assert!(number <= said, "{title}: {number}, and docs/edge.md says {said}");
        }
    }
}
