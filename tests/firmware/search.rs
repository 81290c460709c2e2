//! What a controller has to be ready for: the worst sample that a search finds over rates, gaps, lost readings, jumps, growing
//! leaks and alarms. A trace of our own says too little: one with another leak took half as much again.
//!
//! The search is seeded. It takes random recordings, then changes the worst of them bit by bit; the recording found stays in
//! the folder that is printed.

use super::{PROGRAMS, Renewals, Rig, declared, emulate, farthest, folder, on_host, samples, sensors};
use pitchleak::core::PerLeak;
use pitchleak::trace::Record;
use pitchleak_testkit::{Motion, noisy, seeded};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

const BEGIN: &str = "<!-- firmware search: begin -->\n";
const END: &str = "<!-- firmware search: end -->\n";
const HEADER: &str = "\
| estimator | update | sample, alarms included | apart up to 100 Hz, std | up to 400 Hz | up to 1 kHz | renewals of one alone |
|---|---|---|---|---|---|---|
";
/// Recordings drawn at random, and changes of the worst of them. A night's search may ask for more.
const DRAWN: usize = 14;
const CHANGED: usize = 26;
/// Samples of a recording at most, and its length, s.
const SAMPLES: f64 = 8000.0;
const LONGEST_S: f64 = 30.0;
/// Sampling rates, Hz.
const RATES_HZ: [f64; 7] = [10.0, 25.0, 50.0, 100.0, 200.0, 400.0, 1000.0];
/// Columns of |f32 − f64|: up to these rates, Hz.
const UP_TO_HZ: [f64; 3] = [100.0, 400.0, 1000.0];

/// A recording that somebody may have.
#[derive(Clone, Debug)]
struct Scene {
    seed: u64,
    rate_hz: f64,
    /// Noise, as a share of the sensors' own.
    noise: f64,
    /// Leaks at the begin, m³/(s·Pa): internal, external A, external B.
    leaks: [f64; 3],
    /// By which they grow in a second, as a share.
    growth_ps: f64,
    /// Between two jumps of the leaks to another size, s.
    jump_every_s: f64,
    /// Between two gaps, and their length, s.
    gap_every_s: f64,
    gap_s: f64,
    /// Between two losses of both flows, which last a tenth of that, s.
    loss_every_s: f64,
}

impl Scene {
    fn drawn(random: &mut ChaCha8Rng) -> Self {
        let mut scene = Self {
            seed: 0,
            rate_hz: 0.0,
            noise: 0.0,
            leaks: [0.0; 3],
            growth_ps: 0.0,
            jump_every_s: 0.0,
            gap_every_s: 0.0,
            gap_s: 0.0,
            loss_every_s: 0.0,
        };
        (0..9).for_each(|which| scene.change(which, random));
        scene
    }

    /// Draws one of its properties anew.
    fn change(&mut self, which: u32, random: &mut ChaCha8Rng) {
        // Of what happens now and then: seldom, often, never.
        let every_s =
            |random: &mut ChaCha8Rng| [0.2, 0.7, 2.0, 5.0, f64::INFINITY][random.random_range(0..5_usize)];
        match which {
            0 => self.seed = random.random(),
            1 => self.rate_hz = RATES_HZ[random.random_range(0..RATES_HZ.len())],
            2 => self.noise = 10_f64.powf(random.random_range(-1.5..0.5)),
            3 => {
                let leak = |_| {
                    [0.0, 10_f64.powf(random.random_range(-13.0..-10.3))][random.random_range(0..2_usize)]
                };
                self.leaks = [0, 1, 2].map(leak);
            }
            4 => self.growth_ps = [0.0, 0.02, 0.2, 1.0][random.random_range(0..4_usize)],
            5 => self.jump_every_s = every_s(random),
            6 => self.gap_every_s = every_s(random),
            7 => self.gap_s = [0.02, 0.4, 0.6, 30.0][random.random_range(0..4_usize)],
            _ => self.loss_every_s = every_s(random),
        }
    }

    fn records(&self, rig: &Rig) -> Vec<Record> {
        let count = SAMPLES.min(LONGEST_S * self.rate_hz) as u32;
        let mut random = seeded(self.seed);
        let mut noise = rig.sensors();
        for sensor in [&mut noise.flow_a, &mut noise.flow_b, &mut noise.pressure, &mut noise.position] {
            sensor.noise_std *= self.noise;
        }
        let mut motion = Motion::wind_like(PerLeak::default());
        let (step_s, mut t_s, mut gap_due_s) = (1.0 / self.rate_hz, 0.0, self.gap_every_s);
        let record = |_| {
            let gap = t_s >= gap_due_s;
            let dt_s = if gap { step_s + self.gap_s } else { step_s };
            gap_due_s = if gap { t_s + dt_s + self.gap_every_s } else { gap_due_s };
            t_s += dt_s;
            // Up and down again.
            let jumps = if self.jump_every_s.is_finite() { (t_s / self.jump_every_s) as u64 % 3 } else { 0 };
            let size = (1.0 + self.growth_ps * t_s) * [1.0, 4.0, 0.0][jumps as usize];
            let [internal, external_a, external_b] = self.leaks.map(|leak| size * leak);
            motion.leaks = PerLeak { internal, external_a, external_b };
            let mut sample = noisy(&motion.sample(t_s), &noise, &mut random);
            if t_s % self.loss_every_s > 0.9 * self.loss_every_s {
                (sample.qa_m3s, sample.qb_m3s) = (None, None);
            }
            // As the reader marks a gap: five times the usual step, and what the core calls one itself.
            Record { t_s, dt_s, after_gap: gap && dt_s > 0.5, sample, ..Record::default() }
        };
        (0..count).map(record).collect()
    }
}

/// What a search found.
#[derive(Default)]
struct Found {
    update: u32,
    sample: u32,
    /// By the rate up to which, in standard deviations.
    apart: [f64; 3],
    /// Renewals that only one of both had.
    odd: usize,
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
    let host: Renewals = on_host(program, rig, &sensors, &records);
    found.update = found.update.max(run.worst);
    found.sample = found.sample.max(run.sample);
    let both = run.told.keys().filter(|at| host.contains_key(at)).count();
    let odd = run.told.len() + host.len() - 2 * both;
    found.odd = found.odd.max(odd);
    // Where one has begun anew and the other has not, they tell of other times.
    let apart = if odd == 0 { farthest(&run.told, &host).unwrap_or_default() } else { 0.0 };
    for (most, up_to_hz) in found.apart.iter_mut().zip(UP_TO_HZ) {
        if scene.rate_hz <= up_to_hz {
            *most = most.max(apart);
        }
    }
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
        let Found { update, sample, apart: [low, middle, high], odd } = search(program, &rig);
        writeln!(table, "| {title} | {update} | {sample} | {low:.3} | {middle:.3} | {high:.3} | {odd} |")
            .unwrap();
        measured.insert(title, [f64::from(update), f64::from(sample), low, middle, high, odd as f64]);
    }
    println!("{table}");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/edge.md");
    let text = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = text.split_once(BEGIN).unwrap();
    let (stands, after) = rest.split_once(END).unwrap();
    if std::env::var_os("PITCHLEAK_WRITE_TABLE").is_some() {
        return std::fs::write(&path, [before, BEGIN, &table, END, after].concat()).unwrap();
    }
    for (title, numbers) in measured {
        let row = stands.lines().find(|line| line.starts_with(&format!("| {title} |"))).unwrap();
        let said = row.split('|').skip(2).filter_map(|cell| cell.trim().parse::<f64>().ok());
        for (number, said) in numbers.into_iter().zip(said) {
            assert!(number <= said + 5e-4, "{title}: {number}, and docs/edge.md says {said}");
        }
    }
}
