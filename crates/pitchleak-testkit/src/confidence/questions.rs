//! The cases: sound rigs of all sizes, rates and lengths, two effects together, effects that no table has.

use super::Case;
use super::plant::Rest;

const SIZES: [f64; 5] = [0.6, 1.0, 1.7, 3.0, 5.0];
const RATES: [f64; 5] = [20.0, 50.0, 100.0, 200.0, 500.0];
const ACCURACIES: [f64; 2] = [1e-3, 1e-2];

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
                        ..Case::sound("sound", number as u64)
                    });
                }
            }
        }
    }
    let step = |case: &(usize, Case)| case.0.is_multiple_of(stride);
    all.into_iter().enumerate().filter(step).map(|(_, case)| case).collect()
}

/// Sound rigs for ten minutes to an hour, at every rate.
pub fn long(count: usize) -> Vec<Case> {
    let case = |number: usize| Case {
        size: SIZES[number % 5],
        rate_hz: RATES[(number + number / 5) % 5],
        accuracy: ACCURACIES[number / 2 % 2],
        rest: [Rest::Half, Rest::Never, Rest::Mostly][number % 3],
        seconds: [3600.0, 600.0, 600.0, 1800.0][number % 4],
        pressure_full_scale: [16e6, 40e6][number / 3 % 2],
        ..Case::sound("sound, long", 500 + number as u64)
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
            ..Case::sound("", 1000 + number as u64)
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

/// One effect, or none, beside sensors that are two to ten times better than their data sheets of 1 %.
pub fn better(count: usize) -> Vec<Case> {
    let case = |number: usize| {
        let (kind, round) = (number % 14, number / 14);
        let mut case = Case {
            size: SIZES[round % 3],
            accuracy: 1e-2,
            noise_share: [0.2, 0.5, 0.1][round % 3],
            rest: [Rest::Never, Rest::Half][number % 2],
            seconds: 120.0,
            ..Case::sound("better than declared", 4000 + number as u64)
        };
        let (area, volume) = (case.size.powi(2), case.size.powi(3));
        let (own, read) = (&mut case.physics, &mut case.reading);
        let (place, id, size) = match kind {
            0 => return case,
            1 => (&mut read.flow_gain_a, "flow_meter_gain_a", 0.03),
            2 => (&mut read.flow_offset_a, "flow_meter_offset_a", 0.3 / 60e3 * volume),
            3 => (&mut read.flow_offset_b, "flow_meter_offset_b", 0.3 / 60e3 * volume),
            4 => (&mut read.flow_lag, "flow_meter_lag", 0.03),
            5 => (&mut read.pressure_lag_a, "pressure_lag_a", 0.02),
            6 => (&mut read.position_gain, "position_gain", 0.02),
            7 => (&mut own.dead_a, "dead_volume_a", 2e-4 * volume),
            8 => (&mut own.dead_b, "dead_volume_b", 2e-4 * volume),
            9 => (&mut own.air, "entrained_air", 0.02),
            10 => (&mut own.gas_a, "accumulator_a", 4e-4 * volume),
            11 => (&mut own.turbulent, "internal_leak_turbulent", 1.2e-8 * area),
            12 => (&mut own.viscous, "viscous_friction", 3000.0 * case.size),
            _ => (&mut own.coulomb, "coulomb_friction", 300.0 * area),
        };
        *place = size;
        case.truth = vec![(id, size)];
        case
    };
    (0..count).map(case).collect()
}

/// Kinds of single effects, half of them such as no table has.
const KINDS: usize = 19;

/// Effects of the table that [`two`] does not have.
pub fn further(count: usize) -> Vec<Case> {
    let all = single(KINDS * count).into_iter();
    all.filter(|case| !case.truth.is_empty()).take(count).collect()
}

/// Effects that no table has.
pub fn outside(count: usize) -> Vec<Case> {
    let all = single(KINDS * count).into_iter();
    all.filter(|case| case.truth.is_empty()).take(count).collect()
}

/// Leaks past a check valve in the piston.
pub fn checked(count: usize) -> Vec<Case> {
    let case = |number: usize| {
        let size = SIZES[number % 4];
        let mut case = Case {
            size,
            accuracy: [1e-3, 3e-3, 1e-2][number % 3],
            rest: [Rest::Never, Rest::Half][number / 2 % 2],
            ..Case::sound("leak past a check valve", 17_000 + number as u64)
        };
        case.physics.checked = 2e-11 * size * size;
        case.truth = vec![("internal_leak_one_way", case.physics.checked / 2.0)];
        case
    };
    (0..count).map(case).collect()
}

/// Single effects that [`two`] does not have: those without a truth stand in no table.
fn single(count: usize) -> Vec<Case> {
    let case = |number: usize| {
        let size = SIZES[number / KINDS % 4];
        let (area, volume) = (size * size, size * size * size);
        let large = if (number / KINDS).is_multiple_of(2) { 1.0 } else { 3.0 };
        let mut case = Case {
            size,
            rate_hz: [100.0, 50.0, 200.0][number / KINDS % 3],
            accuracy: [1e-3, 3e-3, 1e-2][number / 5 % 3],
            rest: [Rest::Never, Rest::Half][number / 7 % 2],
            ..Case::sound("", 2000 + number as u64)
        };
        let (own, read) = (&mut case.physics, &mut case.reading);
        let leak = 5e-12 * area * large;
        case.name = match number % KINDS {
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
                case.truth = vec![("internal_leak_cracking", own.relief)];
                "leak above a pressure"
            }
            3 => {
                own.extending = leak;
                case.truth = vec![("internal_leak_direction", leak / 2.0)];
                "one-way leak"
            }
            4 => {
                own.growing = leak / 30.0;
                case.truth = vec![("internal_leak_growth", own.growing)];
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
                case.truth = vec![("flow_meter_dead_band_a", read.dead_band)];
                "dead band"
            }
            9 => {
                read.backlash = 1e-4 * size * large;
                case.truth = vec![("position_hysteresis", read.backlash)];
                "backlash"
            }
            10 => {
                read.drifting_zero = 0.3 / 60e3 * volume * large;
                case.truth = vec![("flow_meter_drift_a", read.drifting_zero / case.seconds)];
                "drifting zero"
            }
            // Sensors of 1 % do not show the bend.
            11 => {
                case.accuracy = case.accuracy.min(3e-3);
                read.bent_pressure = 1e-8 * large;
                "bent pressure sensor"
            }
            12 => {
                read.cross_talk = 5e-6 * volume * large;
                "cross-talk"
            }
            13 => {
                read.range = 1.5e-4 * volume / large;
                "meter at its end"
            }
            14 => {
                read.pulse_m3 = 0.3 / 60e3 * volume * large / case.rate_hz;
                "pulses"
            }
            15 => {
                read.slow_clock = 0.02 * large;
                case.truth = vec![("flow_meter_lag", read.slow_clock / 2.0)];
                "clocks apart"
            }
            16 => {
                read.pressure_play = 3e4 * large;
                case.truth = vec![("pressure_hysteresis_a", read.pressure_play)];
                "pressure sensor with play"
            }
            17 => {
                own.stiffening = 2e-8 * large;
                "oil that stiffens"
            }
            _ => {
                own.hose = 1e-4 * volume * large;
                // Its volume, its resistance and its oil's mass, which the table has one by one; the resistance is that of the plant.
                let inertia = 870.0 * own.hose / (1.26e-4 * area).powi(2);
                case.truth = vec![
                    ("line_resistance_a", 0.4e9 / volume),
                    ("dead_volume_a", own.hose),
                    ("added_mass", inertia * (1.26e-3 * area).powi(2)),
                ];
                "hose with inertia"
            }
        }
        .to_owned();
        case
    };
    (0..count).map(case).collect()
}
