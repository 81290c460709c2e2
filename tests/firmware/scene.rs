//! Recordings that somebody may have, drawn at random: rates, gaps, lost readings, jumps and growing leaks.

use pitchleak::Rig;
use pitchleak::core::PerLeak;
use pitchleak::trace::Record;
use pitchleak_testkit::{Motion, noisy, seeded};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Samples of a recording at most, and its length, s.
const SAMPLES: f64 = 8000.0;
const LONGEST_S: f64 = 30.0;
/// Sampling rates, Hz.
const RATES_HZ: [f64; 7] = [10.0, 25.0, 50.0, 100.0, 200.0, 400.0, 1000.0];
/// A leak through which ten times the pump's flow goes is no leak, m³/(s·Pa).
const MOST_PSPA: f64 = 1e-9;

/// A recording that somebody may have.
#[derive(Clone, Debug)]
pub struct Scene {
    seed: u64,
    pub rate_hz: f64,
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
    pub fn drawn(random: &mut ChaCha8Rng) -> Self {
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
    pub fn change(&mut self, which: u32, random: &mut ChaCha8Rng) {
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

    /// How often the leaks have jumped until then.
    pub fn jumps(&self, t_s: f64) -> u64 {
        if self.jump_every_s.is_finite() { (t_s / self.jump_every_s) as u64 } else { 0 }
    }

    pub fn records(&self, rig: &Rig) -> Vec<Record> {
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
            let size = (1.0 + self.growth_ps * t_s) * [1.0, 4.0, 0.0][(self.jumps(t_s) % 3) as usize];
            let leak = |leak: f64| (size * leak).min(MOST_PSPA);
            let [internal, external_a, external_b] = self.leaks.map(leak);
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
