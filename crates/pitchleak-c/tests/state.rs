//! States as bytes, error codes, and sizes as the header asserts them.

#![allow(clippy::unwrap_used)]

use pitchleak_c::*;
use pitchleak_testkit::Motion;
use std::ptr::{null, null_mut};

/// Another number after a change of what the estimator keeps: then raise `VERSION` in src/state.rs.
const STATE_BYTES: usize = 2068;

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
    assert!(saved(&estimator) == good);
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
        BadSensors,
        BadThreshold,
        TooSmall,
        Rejected,
        Started,
    ];
    assert_eq!(results, expected);
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
