//! Hours of sensors that are not as declared and yet work, on a cylinder that does not leak: how often a stream raises an
//! alarm, and how often it doubts. After `--`: `hours=50`, `seed=…` (else the version's commit).

use pitchleak::core::AlarmState;
use pitchleak::live::{Event, LineFormat, LiveConfig, Watch};
use pitchleak::report::Status;
use pitchleak_testkit::judge::Case;
use pitchleak_testkit::judge::worlds::{WORLDS, World};
use pitchleak_testkit::options::Options;
use rayon::prelude::*;

const HOUR_S: f64 = 3600.0;
const WINDS_MPS: [u8; 4] = [5, 13, 21, 30];
/// Within what sensors do that nobody would change.
const WORKING: [&str; 10] = [
    "honest",
    "zero 0.2 %, A",
    "zero -0.3 %, B",
    "zeros 0.3 %, both",
    "zero drifts 0.3 %, A",
    "lag 20 ms",
    "lag 50 ms",
    "noise x 1.5",
    "hum 0.2 %",
    "12 bit",
];

/// What an hour of a stream said.
#[derive(Default)]
struct Hour {
    estimates: usize,
    /// Alarms raised, and those of a status that is sure.
    alarms: usize,
    sure_alarms: usize,
    /// How often it began to doubt, and to be not sure.
    doubts: usize,
    not_sure: usize,
    /// Words of the first doubt.
    why: String,
}

fn main() {
    let options = Options::of_arguments();
    let (hours, seed) = (options.number("hours").unwrap_or(50_u64), options.seed());
    let worlds: Vec<&'static World> = WORLDS.iter().filter(|world| WORKING.contains(&world.name)).collect();
    let of_each = hours.div_ceil(worlds.len() as u64);
    let cases: Vec<(&'static World, u64)> =
        worlds.iter().flat_map(|world| (0..of_each).map(move |number| (*world, number))).collect();
    let found: Vec<Hour> = cases.par_iter().map(|(world, number)| hour(world, *number, &seed)).collect();
    println!("Seed {seed}, {} h.\n", cases.len());
    println!("| sensors | hours | alarms | of them sure | doubts | not sure |\n|---|---|---|---|---|---|");
    let row = |name: &str, own: &[&Hour]| {
        let sum = |of: fn(&Hour) -> usize| own.iter().map(|hour| of(hour)).sum::<usize>();
        println!(
            "| {name} | {} | {} | {} | {} | {} |",
            own.len(),
            sum(|hour| hour.alarms),
            sum(|hour| hour.sure_alarms),
            sum(|hour| hour.doubts),
            sum(|hour| hour.not_sure)
        );
    };
    for world in &worlds {
        let own: Vec<&Hour> = cases
            .iter()
            .zip(&found)
            .filter(|(case, _)| case.0.name == world.name)
            .map(|both| both.1)
            .collect();
        row(world.name, &own);
    }
    row("**all**", &found.iter().collect::<Vec<_>>());
    for ((world, number), hour) in cases.iter().zip(&found).filter(|(_, hour)| !hour.why.is_empty()) {
        println!("\n{} {number}: {}", world.name, hour.why);
    }
}

fn hour(world: &'static World, number: u64, seed: &str) -> Hour {
    let mps = WINDS_MPS[number as usize % WINDS_MPS.len()];
    let case = Case::draw_sound(world, number, seed, HOUR_S, mps);
    let (trace, _) = case.record();
    let (mut found, mut before, mut events) = (Hour::default(), Status::NotSure, Vec::new());
    let mut watch = Watch::new(LiveConfig::of(case.rig()), Some(LineFormat::Csv));
    for line in trace.split(|byte| *byte == b'\n') {
        watch.take(line, &mut events);
        events.drain(..).for_each(|event| found.hear(event, &mut before));
    }
    watch.finish(&mut events);
    events.drain(..).for_each(|event| found.hear(event, &mut before));
    assert!(found.estimates > 3000, "{} {number}: {} estimates", world.name, found.estimates);
    found
}

impl Hour {
    fn hear(&mut self, event: Event, before: &mut Status) {
        match event {
            Event::Estimate(estimate) => {
                self.estimates += 1;
                let begins = |status| estimate.status == status && *before != status;
                if begins(Status::Doubtful) {
                    self.doubts += 1;
                    if self.why.is_empty() {
                        let texts = estimate.reasons.iter().map(|reason| reason.text.as_str());
                        self.why = format!("{:.0} s: {}", estimate.t_s, texts.collect::<Vec<_>>().join("; "));
                    }
                }
                // The first seconds of any stream are.
                self.not_sure += usize::from(begins(Status::NotSure) && estimate.t_s > 60.0);
                *before = estimate.status;
            }
            Event::Alarm(alarm) if alarm.state == AlarmState::Raised => {
                self.alarms += 1;
                self.sure_alarms += usize::from(alarm.status.is_sure());
            }
            _ => {}
        }
    }
}
