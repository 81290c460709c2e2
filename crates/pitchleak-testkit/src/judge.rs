//! The blind judge: worlds, motions, leaks and rigs drawn from a seed, shown to all who give verdicts, and their words held against the truth.
//!
//! Nobody tunes on it. `cargo bench --bench judge` runs it; `docs/bench/judge.md` has its table as it fell.

#![allow(missing_docs, reason = "cells of the bench's own tables")]

pub mod givers;
pub mod motion;
pub mod plant;
pub mod score;
pub mod sensors;
pub mod worlds;

use givers::VerdictGiver;
use motion::{Kind, Motion};
use pitchleak::Rig;
use pitchleak::core::{Cylinder, Fluid, Leak, PerLeak};
use pitchleak::rig::{Instrument, Instruments};
use plant::{Machine, Plant};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use score::{Scored, THRESHOLD_LPM, Truth, score};
use sensors::{FORCE_SCALE, PRESSURE_SCALE, Recorder};
#[cfg(test)]
use worlds::WORLDS;
use worlds::{Ailment, Course, World};

/// Lengths of the rigs in those of the paper's: its own, and ten times its volume.
const SIZES: [f64; 2] = [1.0, 2.154_434_69];
/// One rig in so many is the large one.
const LARGE_ONE_IN: u32 = 4;
const ACCURACIES: [f64; 3] = [1e-3, 3e-3, 1e-2];
/// Leaks of the paper's size, L/min.
const LEAKS_LPM: [f64; 2] = [0.2, 0.5];
/// A pilot run lasts no longer, s.
const PILOT_S: f64 = 30.0;
const LPM: f64 = 60e3;

/// One trace.
pub struct Case {
    pub world: &'static World,
    pub number: u64,
    pub motion: Kind,
    pub machine: Machine,
    /// 3 σ of the sensors as a share of full scale.
    pub accuracy: f64,
    /// Mean flows at the full share of their courses, L/min of the paper's size.
    pub leaks_lpm: PerLeak<f64>,
    pub seconds: f64,
    seed: u64,
}

/// Words of a seed as a number (FNV-1a), the same on every machine.
fn hashed(words: &str) -> u64 {
    words
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

impl Case {
    /// The `number`th trace of a world: it depends on nothing else that is asked for.
    pub fn draw(world: &'static World, number: u64, seed: &str, accuracy: Option<f64>, seconds: f64) -> Self {
        let seed = hashed(&format!("{seed} {} {number}", world.name));
        let random = &mut ChaCha8Rng::seed_from_u64(seed);
        let size = SIZES[usize::from(random.random_range(0..LARGE_ONE_IN) == 0)];
        let motion = Kind::ALL[random.random_range(0..Kind::ALL.len())];
        let drawn = ACCURACIES[random.random_range(0..ACCURACIES.len())];
        let leaks_lpm = leaks(&world.ailment(), random);
        let accuracy = accuracy.unwrap_or(drawn);
        Self { world, number, motion, machine: Machine::of_size(size), accuracy, leaks_lpm, seconds, seed }
    }

    /// The same without a leak, in wind of so many m/s.
    pub fn draw_sound(world: &'static World, number: u64, seed: &str, seconds: f64, mps: u8) -> Self {
        let drawn = Self::draw(world, number, seed, None, seconds);
        Self { leaks_lpm: PerLeak::default(), motion: Kind::Wind(mps), ..drawn }
    }

    /// As in a table's row, comma-separated.
    pub fn key(&self) -> String {
        let PerLeak { internal, external_a, external_b } = self.leaks_lpm;
        let (world, motion) = (self.world.name.replace(',', ";"), self.motion.name());
        let (size, accuracy) = (self.machine.size.powi(3).round(), self.accuracy);
        format!("{world},{},{motion},{size},{accuracy},{internal},{external_a},{external_b}", self.number)
    }

    /// What the rig file declares.
    pub fn rig(&self) -> Rig {
        let (machine, mut rig) = (&self.machine, Rig::paper());
        rig.cylinder = Cylinder {
            area_a_m2: machine.area_a,
            area_b_m2: machine.area_b,
            stroke_m: machine.stroke,
            moving_mass_kg: machine.mass,
            dead_volume_a_m3: machine.dead[0],
            dead_volume_b_m3: machine.dead[1],
        };
        rig.fluid = Fluid { bulk_modulus_pa: machine.bulk, bulk_modulus_std_pa: 0.25 * machine.bulk };
        let flow = Instrument::of_full_scale(machine.flow_scale());
        rig.instruments = Instruments {
            flow_a: flow,
            flow_b: flow,
            pressure: Instrument::of_full_scale(PRESSURE_SCALE),
            position: Instrument::of_full_scale(machine.stroke),
            force: Instrument::of_full_scale(FORCE_SCALE * machine.size.powi(2)),
            ..rig.instruments
        }
        .with_accuracy(self.accuracy);
        let threshold = THRESHOLD_LPM / LPM * machine.size.powi(3);
        rig.alarms.threshold_m3s = PerLeak::from_fn(|_| threshold);
        rig
    }

    /// The trace as CSV, and what happened.
    pub fn record(&self) -> (Vec<u8>, Truth) {
        let ailment = self.world.ailment();
        let random = &mut ChaCha8Rng::seed_from_u64(self.seed.wrapping_add(1));
        let motion = Motion::draw(self.motion, self.seconds, random);
        let coefficients = self.coefficients(&ailment, &motion);
        let noise = self.seed.wrapping_add(2);
        let mut recorder = Recorder::new(&ailment, &self.machine, self.accuracy, self.seconds, noise);
        let to_lpm = LPM / self.machine.size.powi(3);
        let mut rows = Vec::new();
        self.plant(&ailment, &motion, coefficients).run(|now| {
            if recorder.take(now) {
                rows.push((now.t, now.leaks.map(|flow| flow.abs() * to_lpm)));
            }
        });
        let truth = truth(&ailment, rows, self.seconds);
        (recorder.text.into_bytes(), truth)
    }

    fn plant<'a>(&self, ailment: &'a Ailment, motion: &'a Motion, coefficients: PerLeak<f64>) -> Plant<'a> {
        Plant { machine: self.machine, ailment, motion, coefficients, seconds: self.seconds }
    }

    /// Coefficients by which the drawn leaks have their mean flows: three pilot runs, as leaks move the pressures.
    fn coefficients(&self, ailment: &Ailment, motion: &Motion) -> PerLeak<f64> {
        let calm = Ailment::default();
        let ailment = Ailment { course: Course::Steady, warming: 0.0, dry: calm.dry, ..ailment.clone() };
        let wanted = self.leaks_lpm.map(|lpm| lpm * self.machine.size.powi(3) / LPM);
        let typical_pa = PerLeak { internal: 2e6, external_a: 6e6, external_b: 4e6 };
        let guess = PerLeak::from_fn(|leak| wanted[leak] / typical_pa[leak]);
        if Leak::ALL.iter().all(|leak| wanted[*leak] == 0.0) {
            return wanted;
        }
        (0..3).fold(guess, |coefficients, _| {
            let (mut sums, mut count) = (PerLeak::<f64>::default(), 0.0);
            let pilot = self.plant(&ailment, motion, coefficients);
            let pilot = Plant { seconds: self.seconds.min(PILOT_S), ..pilot };
            pilot.run(|now| {
                count += 1.0;
                sums = PerLeak::from_fn(|leak| sums[leak] + now.leaks[leak].abs());
            });
            let factor = |leak| wanted[leak] * count / f64::max(sums[leak], f64::MIN_POSITIVE);
            // More than in proportion: a wider leak takes away some of its own pressure.
            // One that hardly ever opens stays small.
            PerLeak::from_fn(|leak| (coefficients[leak] * factor(leak).powf(1.4)).min(8.0 * guess[leak]))
        })
    }

    /// What each makes of it.
    pub fn judge(&self, givers: &[&dyn VerdictGiver]) -> Vec<Scored> {
        let ((trace, truth), rig) = (self.record(), self.rig());
        let to_paper = self.machine.size.powi(-3);
        let judge =
            |giver: &&dyn VerdictGiver| score(self, &truth, &giver.judge(&trace, &rig).scaled(to_paper));
        givers.iter().map(judge).collect()
    }
}

/// Which leaks there are: none, one or two, and at least one, or a second, where the world is about them.
fn leaks(ailment: &Ailment, random: &mut ChaCha8Rng) -> PerLeak<f64> {
    let honest = Ailment::default();
    let about_leaks = ailment.course != Course::Steady
        || ailment.orifice > 0.0
        || ailment.warming > 0.0
        || ailment.cracking > honest.cracking;
    let internal_alone = ailment.by_position > 0.0 || ailment.spot || ailment.one_way;
    let mut size = || LEAKS_LPM[random.random_range(0..LEAKS_LPM.len())];
    let mut sizes = PerLeak { internal: size(), external_a: size(), external_b: size() };
    let first = if internal_alone { 0 } else { random.random_range(0..3) };
    let second = (first + random.random_range(1..3)) % 3;
    let count = match random.random_range(0..10) {
        _ if ailment.course == Course::InTurn => return PerLeak { external_b: 0.0, ..sizes },
        0..4 if !about_leaks && !internal_alone => 0,
        8.. => 2,
        _ => 1,
    };
    for (place, leak) in Leak::ALL.iter().enumerate() {
        let open = (count >= 1 && place == first) || (count == 2 && place == second);
        sizes[*leak] = if open { sizes[*leak] } else { 0.0 };
    }
    sizes
}

/// Leaks at the end: the mean flow that the trace's pressures would have driven through them, as they were then.
fn truth(ailment: &Ailment, rows: Vec<(f64, PerLeak<f64>)>, seconds: f64) -> Truth {
    let open: Vec<_> = rows.iter().map(|(t, _)| ailment.courses(*t, seconds)).collect();
    let now = PerLeak::from_fn(|leak| {
        let each = rows.iter().zip(&open).filter(|(_, open)| open[leak] > 0.0);
        let wide: Vec<f64> = each.map(|((_, flows), open)| flows[leak] / open[leak]).collect();
        let wide = mean(wide.into_iter());
        let late = rows.iter().zip(&open).filter(|((t, _), _)| *t >= seconds - 10.0);
        let late = mean(late.map(|(_, open)| open[leak]));
        [wide * open.last().map_or(0.0, |open| open[leak]), wide * late]
    });
    let steady = ailment.course == Course::Steady && ailment.warming == 0.0;
    Truth { now, steady, rows }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / f64::max(count, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The judge's machine is no estimator's: its oil is counted here once more, by what came in, moved the piston, leaked and was pressed.
    #[test]
    fn oil_is_neither_made_nor_lost() {
        let case = Case::draw(&worlds::WORLDS[0], 0, "oil", None, 20.0);
        let (ailment, random) = (Ailment::default(), &mut ChaCha8Rng::seed_from_u64(1));
        let motion = Motion::draw(Kind::Wind(21), 20.0, random);
        let leaks = PerLeak { internal: 1e-11, external_a: 2e-12, external_b: 3e-12 };
        let (mut first, mut last, mut sums, mut pressed) = (None, None::<plant::Instant>, [0.0; 3], 0.0);
        case.plant(&ailment, &motion, leaks).run(|now| {
            if let Some(before) = last.replace(*now) {
                let mean =
                    |of: &dyn Fn(&plant::Instant) -> f64| 0.5 * (of(now) + of(&before)) / plant::STEPS_HZ;
                sums[0] += mean(&|at| at.qa);
                sums[1] += mean(&|at| at.leaks.internal + at.leaks.external_a);
                let volume = case.machine.area_a * 0.5 * (now.x + before.x) + case.machine.dead[0];
                pressed += volume * (now.pa - before.pa) / case.machine.bulk;
            } else {
                first = Some(*now);
            }
        });
        let (first, last) = (first.expect("runs"), last.expect("runs"));
        let moved = case.machine.area_a * (last.x - first.x);
        let missing = sums[0] - sums[1] - moved - pressed;
        assert!(missing.abs() < 2e-3 * sums[1].abs(), "{missing} of {sums:?}");
    }

    #[test]
    fn a_case_is_the_same_whatever_else_is_asked() {
        let draw = |number| Case::draw(&worlds::WORLDS[3], number, "6c429f8", None, 5.0);
        assert_eq!(draw(2).record().0, draw(2).record().0);
        assert_ne!(draw(2).record().0, draw(3).record().0);
    }

    #[test]
    fn leaks_have_the_size_that_was_drawn() {
        for number in 0..6 {
            let case = Case::draw(&worlds::WORLDS[0], number, "size", None, 30.0);
            let (_, truth) = case.record();
            for leak in Leak::ALL {
                let off = truth.now[leak][0] - case.leaks_lpm[leak];
                assert!(off.abs() <= 0.1 * case.leaks_lpm[leak], "{}: {:?}", case.key(), truth.now);
            }
        }
    }

    #[test]
    fn names_of_worlds_differ() {
        let names: std::collections::BTreeSet<_> = WORLDS.iter().map(|world| world.name).collect();
        assert_eq!(names.len(), WORLDS.len());
    }
}
