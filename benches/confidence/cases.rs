//! What is asked: sound rigs of all sizes, two effects at once, effects that no table has.

use crate::plant::{Instant, Physics, Plant, Rest};
use pitchleak::Rig;
use pitchleak::core::{Cylinder, Fluid, Sample};
use pitchleak::diagnose::{Declared, Diagnosis, Series, diagnose};
use pitchleak::rig::{Instrument, Instruments};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// What the sensors do to the truth, by the ids of the table; SI and shares.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reading {
    pub flow_gain_a: f64,
    pub flow_offset_a: f64,
    pub flow_offset_b: f64,
    pub flow_lag: f64,
    pub pressure_lag_a: f64,
    pub position_gain: f64,
    // What no table has.
    /// Meter A reads Q + this × Q².
    pub bent_meter: f64,
    /// Meter A reads nothing below this flow.
    pub dead_band: f64,
    /// The position hangs behind by this much on each side.
    pub backlash: f64,
    /// Meter A's zero at the end, m³/s.
    pub drifting_zero: f64,
    /// Reading of P_A per square of the pressure.
    pub bent_pressure: f64,
    /// Meter A's reading per stroke of the position.
    pub cross_talk: f64,
}

/// One question.
#[derive(Clone, Debug)]
pub struct Case {
    pub name: String,
    pub size: f64,
    pub rate_hz: f64,
    pub seconds: f64,
    pub accuracy: f64,
    pub pressure_full_scale: f64,
    pub rest: Rest,
    pub physics: Physics,
    pub reading: Reading,
    /// Effects of the table that are there, with their sizes.
    pub truth: Vec<(&'static str, f64)>,
    pub seed: u64,
}

pub const SIZES: [f64; 5] = [0.6, 1.0, 1.7, 3.0, 5.0];
const RATES: [f64; 5] = [20.0, 50.0, 100.0, 200.0, 500.0];
const ACCURACIES: [f64; 2] = [1e-3, 1e-2];

impl Case {
    fn new(name: &str, seed: u64) -> Self {
        Self {
            name: name.to_owned(),
            size: 1.0,
            rate_hz: 100.0,
            seconds: 60.0,
            accuracy: 1e-3,
            pressure_full_scale: 16e6,
            rest: Rest::Never,
            physics: Physics::default(),
            reading: Reading::default(),
            truth: vec![],
            seed,
        }
    }

    fn plant(&self) -> Plant {
        Plant { ailment: self.physics, ..Plant::of_size(self.size) }
    }

    fn rig(&self) -> Rig {
        let (plant, mut rig) = (self.plant(), Rig::paper());
        rig.cylinder = Cylinder {
            area_a_m2: plant.area_a,
            area_b_m2: plant.area_b,
            stroke_m: plant.stroke,
            moving_mass_kg: plant.mass,
            dead_volume_a_m3: 0.0,
            dead_volume_b_m3: 0.0,
        };
        rig.fluid = Fluid { bulk_modulus_pa: plant.bulk, ..rig.fluid };
        let full = |full_scale| Instrument::of_full_scale(full_scale);
        let flow = full(20.0 / 60e3 * self.size.powi(3));
        rig.instruments = Instruments {
            flow_a: flow,
            flow_b: flow,
            pressure: full(self.pressure_full_scale),
            position: full(plant.stroke),
            force: full(10.0 * plant.load),
        }
        .with_accuracy(self.accuracy);
        rig
    }

    /// The trace as the sensors show it.
    fn trace(&self) -> Series {
        let (mut series, mut random) = (Series::default(), ChaCha8Rng::seed_from_u64(77_000 + self.seed));
        let (plant, sensors, own) = (self.plant(), self.rig().sensors(), self.reading);
        let mut noisy = |value: f64, std: f64| {
            let unit: f64 = StandardNormal.sample(&mut random);
            value + std * unit
        };
        let every = (10_000.0 / self.rate_hz).round() as u64;
        let (mut late, mut hanging, mut count) = (None::<Instant>, plant.stroke / 2.0, 0_u64);
        plant.run(self.rest, self.seconds, self.seed, |now| {
            let before = late.unwrap_or(*now);
            let follow = |old: f64, new: f64, lag: f64| old + (new - old) * 1e-4 / (1e-4 + lag);
            let shown = Instant {
                qa: follow(before.qa, now.qa, own.flow_lag),
                qb: follow(before.qb, now.qb, own.flow_lag),
                pa: follow(before.pa, now.pa, own.pressure_lag_a),
                ..*now
            };
            late = Some(shown);
            hanging = hanging.clamp(now.x - own.backlash, now.x + own.backlash);
            count += 1;
            if !(count - 1).is_multiple_of(every) {
                return;
            }
            let mut qa = shown.qa * (1.0 + own.flow_gain_a) + own.flow_offset_a;
            qa += own.bent_meter * shown.qa.powi(2) + own.drifting_zero * now.t / self.seconds;
            qa += own.cross_talk * (now.x / plant.stroke - 0.5);
            if shown.qa.abs() < own.dead_band {
                qa = 0.0;
            }
            let sample = Sample {
                x_m: noisy(hanging * (1.0 + own.position_gain), sensors.position.noise_std),
                pa_pa: noisy(shown.pa + own.bent_pressure * shown.pa.powi(2), sensors.pressure.noise_std),
                pb_pa: noisy(shown.pb, sensors.pressure.noise_std),
                qa_m3s: Some(noisy(qa, sensors.flow_a.noise_std)),
                qb_m3s: Some(noisy(shown.qb + own.flow_offset_b, sensors.flow_b.noise_std)),
                force_n: Some(noisy(now.force, sensors.force.noise_std)),
            };
            series.push(now.t, &sample, None);
        });
        series
    }

    pub fn ask(&self) -> Diagnosis {
        diagnose(&[self.trace()], &[], &Declared::of(&self.rig()), &|| ())
    }
}

/// Sound rigs: every `stride`th of all sizes, rates, accuracies, rests, and pressure sensors.
pub fn sound(stride: usize) -> Vec<Case> {
    let mut all = Vec::new();
    for (i, size) in SIZES.into_iter().enumerate() {
        for (j, rate_hz) in RATES.into_iter().enumerate() {
            for (k, accuracy) in ACCURACIES.into_iter().enumerate() {
                for rest in [Rest::Never, Rest::Half] {
                    let number = all.len();
                    let pressure_full_scale = [16e6, 40e6][(i + j + k) % 2];
                    all.push(Case {
                        size,
                        rate_hz,
                        accuracy,
                        rest,
                        pressure_full_scale,
                        ..Case::new("sound", number as u64)
                    });
                }
            }
        }
    }
    let step = |case: &(usize, Case)| case.0.is_multiple_of(stride);
    all.into_iter().enumerate().filter(step).map(|(_, case)| case).collect()
}

/// Sound rigs for ten minutes and for an hour.
pub fn long(count: usize) -> Vec<Case> {
    let case = |number: usize| {
        let hour = number.is_multiple_of(4);
        Case {
            size: SIZES[number % 5],
            rate_hz: if hour { 20.0 } else { [20.0, 50.0, 100.0][number % 3] },
            accuracy: ACCURACIES[number / 2 % 2],
            rest: if hour { Rest::Mostly } else { [Rest::Never, Rest::Half][number / 3 % 2] },
            seconds: if hour { 3600.0 } else { 600.0 },
            ..Case::new("sound, long", 500 + number as u64)
        }
    };
    (0..count).map(case).collect()
}

/// Two effects at once.
pub fn two(count: usize) -> Vec<Case> {
    let case = |number: usize| {
        let size = SIZES[number / 8 % 3];
        let (area, volume) = (size * size, size * size * size);
        let mut case = Case {
            size,
            rate_hz: [100.0, 50.0, 200.0][number / 8 % 3],
            accuracy: [1e-3, 3e-3, 1e-2][number / 8 % 3],
            rest: [Rest::Never, Rest::Half][number / 4 % 2],
            ..Case::new("", 1000 + number as u64)
        };
        let (own, read) = (&mut case.physics, &mut case.reading);
        let (name, truth) = match number % 8 {
            0 => {
                (own.coulomb, read.flow_gain_a) = (300.0 * area, 0.03);
                ("friction and gain", vec![("coulomb_friction", own.coulomb), ("flow_meter_gain_a", 0.03)])
            }
            4 => {
                (own.viscous, read.position_gain) = (3000.0 * size, 0.02);
                ("friction and gain", vec![("viscous_friction", own.viscous), ("position_gain", 0.02)])
            }
            1 | 5 => {
                (own.air, own.dead_a) = (0.02, 4e-4 * volume);
                ("air and dead volume", vec![("entrained_air", 0.02), ("dead_volume_a", own.dead_a)])
            }
            2 | 6 => {
                (read.flow_lag, read.flow_offset_a) = (0.03, 0.3 / 60e3 * volume);
                let offset = ("flow_meter_offset_a", read.flow_offset_a);
                ("lag and offset", vec![("flow_meter_lag", 0.03), offset])
            }
            _ => {
                (own.gas_a, own.turbulent) = (4e-4 * volume, 1.2e-8 * area);
                (
                    "accumulator and leak",
                    vec![("accumulator_a", 4e-4 * volume), ("internal_leak_turbulent", own.turbulent)],
                )
            }
        };
        case.name = name.to_owned();
        case.truth = truth;
        case
    };
    (0..count).map(case).collect()
}

/// Effects that no table has.
pub fn outside(count: usize) -> Vec<Case> {
    let case = |number: usize| {
        let size = SIZES[number / 13 % 4];
        let (area, volume) = (size * size, size * size * size);
        let large = if (number / 13).is_multiple_of(2) { 1.0 } else { 3.0 };
        let mut case = Case {
            size,
            rate_hz: [100.0, 50.0, 200.0][number / 13 % 3],
            accuracy: [1e-3, 3e-3, 1e-2][number / 5 % 3],
            rest: [Rest::Never, Rest::Half][number / 7 % 2],
            ..Case::new("", 2000 + number as u64)
        };
        let (own, read) = (&mut case.physics, &mut case.reading);
        let leak = 5e-12 * area * large;
        case.name = match number % 13 {
            0 => {
                own.spool_leak = 10.0 * leak;
                "leak with the spool"
            }
            1 => {
                own.steep_leak = leak / 1e3;
                "steep leak"
            }
            2 => {
                own.relief = 3.0 * leak;
                "leak above a pressure"
            }
            3 => {
                own.one_way = leak;
                "one-way leak"
            }
            4 => {
                own.growing = leak / 30.0;
                "growing leak"
            }
            5 => {
                own.cubic = 2e6 * large / size;
                "cubic friction"
            }
            6 => {
                own.lopsided = 200.0 * area * large;
                "lopsided friction"
            }
            7 => {
                read.bent_meter = 300.0 * large / volume;
                "bent meter"
            }
            8 => {
                read.dead_band = 0.3 / 60e3 * volume * large;
                "dead band"
            }
            9 => {
                read.backlash = 1e-4 * size * large;
                "backlash"
            }
            10 => {
                read.drifting_zero = 0.3 / 60e3 * volume * large;
                "drifting zero"
            }
            // Sensors of 1 % do not show the bend.
            11 => {
                case.accuracy = case.accuracy.min(3e-3);
                read.bent_pressure = 1e-8 * large;
                "bent pressure sensor"
            }
            _ => {
                read.cross_talk = 5e-6 * volume * large;
                "cross-talk"
            }
        }
        .to_owned();
        case
    };
    (0..count).map(case).collect()
}
