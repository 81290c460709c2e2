//! States as bytes, error codes, and sizes as the header asserts them.

#![allow(clippy::unwrap_used)]

use pitchleak_c::*;
use pitchleak_testkit::Motion;
use pitchleak_testkit::valve::ValveCylinder;
use rand::{RngExt, SeedableRng};
use std::ptr::{null, null_mut};

/// Another number after a change of what the estimator keeps: then raise `VERSION` in src/state.rs.
const STATE_BYTES: usize = 2282;

fn rig() -> PitchleakRig {
    let sensor = |noise_std| PitchleakSensor { noise_std, bias_std: 0.0, gain_std: 0.0, drift_std_ph: 0.0 };
    PitchleakRig {
        cylinder: PitchleakCylinder {
            area_a_m2: 12.6e-4,
            area_b_m2: 9.4e-4,
            stroke_m: 0.2,
            moving_mass_kg: 20.0,
            dead_volume_a_m3: 0.0,
            dead_volume_b_m3: 0.0,
        },
        fluid: PitchleakFluid { bulk_modulus_pa: 0.8e9, bulk_modulus_std_pa: 0.2e9 },
        flow_a: sensor(1e-6),
        flow_b: sensor(1e-6),
        pressure: sensor(5e4),
        position: sensor(1e-3),
        threshold_internal_m3s: 1e-6,
        threshold_external_a_m3s: 1e-6,
        threshold_external_b_m3s: 1e-6,
        max_step_s: 0.5,
    }
}

fn samples() -> Vec<PitchleakSample> {
    let leaks = pitchleak_core::PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 0.0 };
    let of = |s: &pitchleak_core::Sample<f64>| PitchleakSample {
        x_m: s.x_m as f32,
        pa_pa: s.pa_pa as f32,
        pb_pa: s.pb_pa as f32,
        qa_m3s: s.qa_m3s.unwrap() as f32,
        qb_m3s: s.qb_m3s.unwrap() as f32,
    };
    Motion::wind_like(leaks).samples(20).iter().map(of).collect()
}

fn begun() -> Pitchleak4 {
    let mut estimator = Pitchleak4 { words: [0; PITCHLEAK4_WORDS] };
    // SAFETY: both are what they say.
    assert_eq!(unsafe { pitchleak4_begin(&mut estimator, &rig()) }, PitchleakResult::Ok);
    estimator
}

fn feed(estimator: &mut Pitchleak4, samples: &[PitchleakSample]) {
    for sample in samples {
        // SAFETY: both are what they say.
        let result = unsafe { pitchleak4_update(estimator, 0.01, sample) };
        assert!(result as i32 >= 0, "{result:?}");
    }
}

fn saved(estimator: &Pitchleak4) -> Vec<u8> {
    let mut bytes = vec![0; PITCHLEAK4_STATE_BYTES];
    let mut length = bytes.len();
    // SAFETY: all are what they say.
    assert_eq!(unsafe { pitchleak4_save(estimator, bytes.as_mut_ptr(), &mut length) }, PitchleakResult::Ok);
    bytes.truncate(length);
    bytes
}

fn restore(estimator: &mut Pitchleak4, bytes: &[u8]) -> PitchleakResult {
    // SAFETY: all are what they say.
    unsafe { pitchleak4_restore(estimator, bytes.as_ptr(), bytes.len()) }
}

#[test]
fn a_restored_estimator_goes_on_to_the_last_bit() {
    let samples = samples();
    let mut whole = begun();
    feed(&mut whole, &samples);
    // Blocks have 25 samples: sevens come by all their moments, and those of a half-done renewal.
    for at in (0..samples.len()).step_by(7) {
        let (before, after) = samples.split_at(at);
        let mut first = begun();
        feed(&mut first, before);
        let mut second = begun();
        assert_eq!(restore(&mut second, &saved(&first)), PitchleakResult::Ok);
        feed(&mut second, after);
        assert!(saved(&second) == saved(&whole), "interrupted after {at}");
    }
}

#[test]
fn a_damaged_state_is_refused_and_changes_nothing() {
    let mut estimator = begun();
    feed(&mut estimator, &samples());
    let good = saved(&estimator);
    for at in 0..good.len() {
        for bit in [1, 0x10, 0x80] {
            let mut bytes = good.clone();
            bytes[at] ^= bit;
            let result = restore(&mut estimator, &bytes);
            assert!(
                matches!(result, PitchleakResult::Damaged | PitchleakResult::OtherVersion),
                "{at}: {result:?}"
            );
        }
    }
    for length in 0..good.len() {
        assert_eq!(restore(&mut estimator, &good[..length]), PitchleakResult::Damaged);
    }
    let longer = [&good[..], &[0]].concat();
    assert_eq!(restore(&mut estimator, &longer), PitchleakResult::Damaged, "something follows its end");
    assert!(saved(&estimator) == good);
}

/// Any number that a float can be, the likely and the absurd.
fn any(dice: &mut Dice) -> f32 {
    match dice.0.random_range(0..4_u32) {
        0 => f32::from_bits(dice.0.random()),
        1 => [0.0, -0.0, f32::MAX, f32::MIN_POSITIVE, 1e-45, f32::NAN, f32::INFINITY]
            [dice.0.random_range(0..7_usize)],
        _ => 10_f32.powf(dice.0.random_range(-12.0..12.0)),
    }
}

struct Dice(rand_chacha::ChaCha8Rng);

/// What `begin` takes gives no number that is none, whatever the sensors say.
#[test]
fn a_rig_that_is_taken_gives_numbers() {
    let mut dice = Dice(rand_chacha::ChaCha8Rng::seed_from_u64(31));
    let samples = samples();
    let mut taken = 0;
    // A night under sanitizers may ask for more.
    let rounds = std::env::var("PITCHLEAK_RIGS").map_or(3000, |rounds| rounds.parse().unwrap());
    for round in 0..rounds {
        let mut rig = rig();
        // One or two of its 28 numbers are others.
        for _ in 0..1 + round % 2 {
            let which = dice.0.random_range(0..28_usize);
            let value = any(&mut dice);
            // SAFETY: the rig is 28 floats in a row.
            unsafe { (&raw mut rig).cast::<f32>().add(which).write(value) };
        }
        let mut estimator = Pitchleak4 { words: [0; PITCHLEAK4_WORDS] };
        // SAFETY: both are what they say.
        if unsafe { pitchleak4_begin(&mut estimator, &rig) } != PitchleakResult::Ok {
            continue;
        }
        taken += 1;
        for sample in &samples[..300] {
            let mut sample = *sample;
            if dice.0.random_range(0..50) == 0 {
                sample.pa_pa = any(&mut dice);
            }
            if dice.0.random_range(0..50) == 0 {
                sample.qb_m3s = any(&mut dice);
            }
            // SAFETY: both are what they say.
            unsafe { pitchleak4_update(&mut estimator, 0.01, &sample) };
        }
        let mut found = PitchleakFound::default();
        // SAFETY: both are what they say.
        unsafe { pitchleak4_find(&estimator, &mut found) };
        for found in
            [found.internal_m3s, found.external_a_m3s, found.external_b_m3s, found.compressibility_per_pa]
        {
            assert!(!found.value.is_nan() && !found.std.is_nan(), "{rig:?}: {found:?}");
        }
    }
    assert!(taken > rounds / 6, "{taken}");
}

#[test]
fn a_state_belongs_to_its_version_and_size() {
    let mut estimator = begun();
    let mut bytes = saved(&estimator);
    let mut six = Pitchleak6 { words: [0; PITCHLEAK6_WORDS] };
    // SAFETY: all are what they say.
    let result = unsafe { pitchleak6_restore(&mut six, bytes.as_ptr(), bytes.len()) };
    assert_eq!(result, PitchleakResult::OtherVersion);
    bytes[4] += 1;
    assert_eq!(restore(&mut estimator, &bytes), PitchleakResult::OtherVersion);
}

#[test]
fn mistakes_have_their_codes() {
    let mut blank = Pitchleak4 { words: [0; PITCHLEAK4_WORDS] };
    let mut estimator = begun();
    let sample = samples()[0];
    let (mut found, mut length) = (PitchleakFound::default(), 7);
    let mut few = [0; 7];
    let mut bad_cylinder = rig();
    bad_cylinder.cylinder.area_a_m2 = f32::NAN;
    let mut bad_sensors = rig();
    bad_sensors.flow_b.noise_std = -1.0;
    let mut bad_threshold = rig();
    bad_threshold.threshold_internal_m3s = 0.0;
    let mut huge = rig();
    huge.cylinder.stroke_m = 3.4e38;
    // SAFETY: each pointer is null, or what it says.
    let results = unsafe {
        [
            pitchleak4_update(&mut blank, 0.01, &sample),
            pitchleak4_find(&blank, &mut found),
            pitchleak4_update(null_mut(), 0.01, &sample),
            pitchleak4_update(&mut estimator, 0.01, null()),
            pitchleak4_find(&estimator, null_mut()),
            pitchleak4_begin(&mut blank, null()),
            pitchleak4_begin(&mut blank, &bad_cylinder),
            pitchleak4_begin(&mut blank, &huge),
            pitchleak4_begin(&mut blank, &bad_sensors),
            pitchleak4_begin(&mut blank, &bad_threshold),
            pitchleak4_save(&estimator, few.as_mut_ptr(), &mut length),
            pitchleak4_update(&mut estimator, 0.01, &PitchleakSample { x_m: f32::NAN, ..sample }),
            pitchleak4_update(&mut estimator, 0.01, &sample),
        ]
    };
    use PitchleakResult::*;
    let expected = [
        NotBegun,
        NotBegun,
        NullPointer,
        NullPointer,
        NullPointer,
        NullPointer,
        BadCylinder,
        BadCylinder,
        BadSensors,
        BadThreshold,
        TooSmall,
        Rejected,
        Started,
    ];
    assert_eq!(results, expected);
}

/// A nominal valve, known to a thousandth, and what its cylinder reads.
fn valve() -> (PitchleakValveRig, Vec<PitchleakValveSample>) {
    let PitchleakRig { cylinder, fluid, .. } = rig();
    let mut mean = [0.0; PITCHLEAK_VALVE_UNKNOWNS];
    mean[3..8].fill(1.0);
    mean[12] = 0.02;
    let mut covariance = [0.0; PITCHLEAK_VALVE_COVARIANCES];
    (0..PITCHLEAK_VALVE_UNKNOWNS).for_each(|row| covariance[row * (row + 3) / 2] = 1e-6);
    let rig = PitchleakValveRig {
        cylinder,
        fluid,
        mean,
        covariance,
        rated_flow_m3s: 4.0 / 60e3,
        rated_drop_pa: 35e5,
        tank_pa: 2e5,
        hysteresis: 0.003,
        null_leak: 0.02,
        gain_drift: 0.03,
        lap_drift: 0.001,
        null_leak_drift: 0.1,
        position_std_m: 0.2e-3,
        pressure_std_pa: 16e3,
        spool_std: 1e-3,
        supply_std_pa: 16e3,
        threshold_internal_m3s: 1e-6,
        threshold_external_a_m3s: 1e-6,
        threshold_external_b_m3s: 1e-6,
        max_step_s: 0.5,
    };
    let text = ValveCylinder::drawn(4).leaking(1, 1.0).trace(12.0, 100.0, 3e-3);
    let row = |line: &str| {
        let cells: Vec<f32> = line.split(',').filter_map(|cell| cell.parse().ok()).collect();
        let [_, x_mm, pa, pb, spool, ps] = cells.try_into().unwrap();
        let (x_m, pa_pa, pb_pa) = (1e-3 * x_mm, 1e5 * pa, 1e5 * pb);
        PitchleakValveSample { x_m, pa_pa, pb_pa, spool: 1e-2 * spool, ps_pa: 1e5 * ps }
    };
    (rig, text.lines().skip(1).map(row).collect())
}

fn begun_valve(rig: &PitchleakValveRig) -> Result<PitchleakValve, PitchleakResult> {
    let mut estimator = PitchleakValve { words: [0; PITCHLEAK_VALVE_WORDS] };
    // SAFETY: both are what they say.
    let result = unsafe { pitchleak_valve_begin(&mut estimator, rig) };
    if result == PitchleakResult::Ok { Ok(estimator) } else { Err(result) }
}

fn saved_valve(estimator: &PitchleakValve) -> Vec<u8> {
    let mut bytes = vec![0; PITCHLEAK_VALVE_STATE_BYTES];
    let mut length = bytes.len();
    // SAFETY: all are what they say.
    let result = unsafe { pitchleak_valve_save(estimator, bytes.as_mut_ptr(), &mut length) };
    assert_eq!(result, PitchleakResult::Ok);
    bytes.truncate(length);
    bytes
}

fn feed_valve(estimator: &mut PitchleakValve, samples: &[PitchleakValveSample]) {
    for sample in samples {
        // SAFETY: both are what they say.
        let result = unsafe { pitchleak_valve_update(estimator, 0.01, sample) };
        assert!(result as i32 >= 0, "{result:?}");
    }
}

#[test]
fn a_restored_valve_goes_on_to_the_last_bit() {
    let (rig, samples) = valve();
    let mut whole = begun_valve(&rig).unwrap();
    feed_valve(&mut whole, &samples);
    assert!(saved_valve(&whole).len() > 2000);
    for at in (0..samples.len()).step_by(7) {
        let (before, after) = samples.split_at(at);
        let mut first = begun_valve(&rig).unwrap();
        feed_valve(&mut first, before);
        let bytes = saved_valve(&first);
        let mut second = PitchleakValve { words: [0; PITCHLEAK_VALVE_WORDS] };
        // SAFETY: all are what they say.
        let result = unsafe { pitchleak_valve_restore(&mut second, bytes.as_ptr(), bytes.len()) };
        assert_eq!(result, PitchleakResult::Ok);
        feed_valve(&mut second, after);
        assert!(saved_valve(&second) == saved_valve(&whole), "interrupted after {at}");
    }
    let other = saved(&begun());
    // SAFETY: all are what they say.
    let result = unsafe { pitchleak_valve_restore(&mut whole, other.as_ptr(), other.len()) };
    assert_eq!(result, PitchleakResult::OtherVersion);
}

#[test]
fn a_valve_that_cannot_be_has_its_code() {
    let (rig, samples) = valve();
    let broken = |change: fn(&mut PitchleakValveRig)| {
        let mut broken = rig;
        change(&mut broken);
        begun_valve(&broken).err()
    };
    assert_eq!(broken(|rig| rig.covariance[3] = f32::NAN), Some(PitchleakResult::BadCalibration));
    assert_eq!(broken(|rig| rig.rated_flow_m3s = 0.0), Some(PitchleakResult::BadCalibration));
    assert_eq!(broken(|rig| rig.spool_std = -1.0), Some(PitchleakResult::BadSensors));
    assert_eq!(broken(|rig| rig.cylinder.stroke_m = f32::INFINITY), Some(PitchleakResult::BadCylinder));
    assert_eq!(broken(|rig| rig.threshold_external_a_m3s = 0.0), Some(PitchleakResult::BadThreshold));
    let mut blank = PitchleakValve { words: [0; PITCHLEAK_VALVE_WORDS] };
    // SAFETY: both are what they say.
    let result = unsafe { pitchleak_valve_update(&mut blank, 0.01, &samples[0]) };
    assert_eq!(result, PitchleakResult::NotBegun);
}

/// Whatever a calibration holds, what is found is a number.
#[test]
fn a_valve_that_is_taken_gives_numbers() {
    let mut dice = Dice(rand_chacha::ChaCha8Rng::seed_from_u64(32));
    let (sound, samples) = valve();
    let numbers = size_of::<PitchleakValveRig>() / size_of::<f32>();
    let mut taken = 0;
    for _ in 0..1000 {
        let mut rig = sound;
        let (which, value) = (dice.0.random_range(0..numbers), any(&mut dice));
        // SAFETY: the rig is so many floats in a row.
        unsafe { (&raw mut rig).cast::<f32>().add(which).write(value) };
        let Ok(mut estimator) = begun_valve(&rig) else { continue };
        taken += 1;
        feed_valve(&mut estimator, &samples[..200]);
        let mut found = PitchleakValveFound::default();
        // SAFETY: both are what they say.
        unsafe { pitchleak_valve_find(&estimator, &mut found) };
        for found in [found.internal_m3s, found.external_a_m3s, found.external_b_m3s] {
            assert!(!found.value.is_nan() && !found.std.is_nan(), "{which} {value}: {found:?}");
        }
    }
    assert!(taken > 300, "{taken}");
}

/// As many bytes as the header says are enough, and a state of another form would show.
#[test]
fn a_state_has_its_form() {
    let mut estimator = begun();
    feed(&mut estimator, &samples());
    assert_eq!(saved(&estimator).len(), STATE_BYTES);
}

#[test]
fn structs_are_as_large_as_the_header_says() {
    assert_eq!(
        [size_of::<PitchleakRig>(), size_of::<PitchleakSample>(), size_of::<PitchleakFound>()],
        [112, 20, 68]
    );
    assert_eq!(size_of::<PitchleakResult>(), 4);
    assert_eq!([align_of::<Pitchleak4>(), align_of::<Pitchleak6>(), align_of::<Pitchleak9>()], [8; 3]);
}
