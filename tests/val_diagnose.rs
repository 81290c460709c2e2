//! The diagnosis on traces of an independent simulator, with the effects its authors put in.

use pitchleak::Rig;
use pitchleak::diagnose::{
    Declared, Diagnosis, Doubt, DoubtId, Equation, LeakEstimates, Series, Verdict, diagnose,
};
use pitchleak::trace::TraceReader;
use pitchleak_testkit::hopsan;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::path::Path;

fn rig(mass_kg: f64, bulk_modulus_pa: f64, accuracy: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.cylinder.moving_mass_kg = mass_kg;
    rig.fluid.bulk_modulus_pa = bulk_modulus_pa;
    rig.instruments = rig.instruments.with_accuracy(accuracy);
    rig
}

fn read(name: &str, rig: &Rig) -> Series {
    let mut reader = TraceReader::open(hopsan::path(name), rig).expect("data/hopsan has the trace");
    Series::read(&mut reader).expect("the trace reads")
}

fn with_noise(mut series: Series, rig: &Rig, seed: u64) -> Series {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let sensors = rig.sensors();
    for (signal, std) in [
        (&mut series.x_m, sensors.position.noise_std),
        (&mut series.pa_pa, sensors.pressure.noise_std),
        (&mut series.pb_pa, sensors.pressure.noise_std),
        (&mut series.qa_m3s, sensors.flow_a.noise_std),
        (&mut series.qb_m3s, sensors.flow_b.noise_std),
        (&mut series.force_n, sensors.force.noise_std),
    ] {
        for value in signal {
            let unit: f64 = StandardNormal.sample(&mut random);
            *value += std * unit;
        }
    }
    series
}

/// The trace clean, declared as 0.1 % and 1 %, and with noise of these sizes.
fn answers(name: &str, mass_kg: f64, bulk_modulus_pa: f64) -> Vec<Diagnosis> {
    let mut answers = Vec::new();
    for accuracy in [1e-3, 1e-2] {
        let rig = rig(mass_kg, bulk_modulus_pa, accuracy);
        let series = read(name, &rig);
        let declared = Declared::of(&rig);
        let mut ask = |series| answers.push(diagnose(&[series], &[], &declared, &|| ()));
        ask(series.clone());
        ask(with_noise(series, &rig, 20_111));
    }
    answers
}

fn ids(answer: &Diagnosis) -> Vec<&str> {
    answer.effects.iter().map(|effect| effect.id).collect()
}

#[test]
fn val_sound_traces_name_nothing() {
    for answer in answers("h02", 30.0, 0.9e9).iter().chain(&answers("h06", 50.0, 1.1e9)) {
        assert_eq!(answer.verdict, Verdict::NoMissingEffect, "{:?}", answer.notes);
        assert!(answer.effects.is_empty());
    }
}

#[test]
fn val_friction_is_named_and_mends_the_force_balance() {
    const LOAD_SPREAD_N: f64 = 644.06;
    let answers = answers("u04", 30.0, 0.9e9);
    for answer in &answers {
        assert!(answer.notes.is_empty(), "{:?}", answer.notes);
        let mut ids = ids(answer);
        ids.sort_unstable();
        assert_eq!(ids, ["coulomb_friction", "viscous_friction"]);
    }
    // Noise of 1 % leaves viscous friction eleven standard deviations, too few to tell its law from others.
    let [clean, quiet, clean_at_one, noisy] = &answers[..] else { panic!("four answers") };
    for answer in [clean, quiet, clean_at_one] {
        assert_eq!(answer.verdict, Verdict::Explained);
    }
    let is_of_law = |doubt: &Doubt| matches!(doubt.id, DoubtId::Rivals | DoubtId::UnlistedLaw);
    let doubts: Vec<&Doubt> = noisy.effects.iter().flat_map(|effect| &effect.doubts).collect();
    assert!(doubts.iter().all(|doubt| is_of_law(doubt)), "{doubts:?}");
    let is_sure = noisy.effects.iter().all(|effect| effect.confident);
    assert_eq!(noisy.verdict, if is_sure { Verdict::Explained } else { Verdict::PartlyExplained });
    assert!(clean.before.quality.rmse.force.unwrap() > 0.4 * LOAD_SPREAD_N);
    assert!(clean.after.quality.rmse.force.unwrap() < 0.02 * LOAD_SPREAD_N);
}

#[test]
fn val_position_gain_is_named_and_mends_the_leaks() {
    for answer in &answers("u07", 20.0, 0.9e9) {
        assert_eq!(answer.verdict, Verdict::Explained, "{:?}", answer.notes);
        assert_eq!(ids(answer), ["position_gain"]);
        let effect = &answer.effects[0];
        assert!((effect.value - 0.02).abs() < 4.0 * effect.std && (effect.value - 0.02).abs() < 2e-3);
        let (before, after) = (&answer.before.leaks, &answer.after.leaks);
        let off = |leaks: &LeakEstimates| leaks.external_leak_b_coefficient.value.abs();
        assert!(off(after) < 0.5 * off(before));
        for (leak, truth) in [
            (after.internal_leak_coefficient, 1e-11),
            (after.external_leak_a_coefficient, 3e-12),
            (after.external_leak_b_coefficient, 0.0),
        ] {
            // The noise-free trace leaves rounding in place of noise, far below the interval.
            assert!((leak.value - truth).abs() < 3.5 * leak.std, "{leak:?} is not {truth}");
        }
    }
}

#[test]
fn a_trace_in_which_nothing_happens_is_not_judged() {
    let rig = Rig::paper();
    let mut series = Series::default();
    let sample = pitchleak::core::Sample {
        x_m: 0.1,
        pa_pa: 5e6,
        pb_pa: 4e6,
        qa_m3s: Some(1e-5),
        qb_m3s: Some(-1e-5),
        force_n: Some(2e3),
    };
    (0..2000).for_each(|i| series.push(0.01 * f64::from(i), &sample, None));
    for traces in [vec![series], vec![Series::default()], vec![]] {
        let answer = diagnose(&traces, &[], &Declared::of(&rig), &|| ());
        assert_eq!(answer.verdict, Verdict::InsufficientExcitation);
        assert!(answer.effects.is_empty());
    }
}

/// A pump-controlled cylinder in a laboratory, where its traces are: nobody knows what the model lacks, but its areas are as measured, and
/// what is named helps on days that were not fitted.
#[test]
fn a_measured_rig_keeps_its_areas_and_is_met_better() {
    let Some(diagnosed) = measured() else { return };
    let fitted = ["d1018_load1_stroke3", "d1018_load3_stroke3", "d1018_load5_stroke3"];
    let answer = diagnosed(&fitted, &["d1018_load2_stroke2", "d1017_test1"]);
    let (before, after) = (&answer.before.quality.rmse, &answer.after.quality.rmse);
    println!("{:?}: {before:?} {after:?}", ids(&answer));
    assert!(!ids(&answer).iter().any(|id| id.starts_with("area")), "{:?}", ids(&answer));
    for equation in [Equation::ChamberA, Equation::ChamberB] {
        let [before, after] = [before, after].map(|rmse| rmse[equation].expect("is judged"));
        assert!(after < 0.8 * before, "{equation:?}: {before} {after}");
    }
}

/// Of the same rig: meter B reads 0 below its least flow. A line whose resistance nothing but the end of its range stopped took
/// all that chamber B does upon itself, and what it left elsewhere was twenty times as much.
#[test]
fn a_meter_that_reads_nothing_slow_gets_no_line_without_end() {
    let Some(diagnosed) = measured() else { return };
    let answer = diagnosed(&["d1018_load1_stroke2", "d1018_load1_stroke3"], &["d1017_test1"]);
    let (before, after) = (&answer.before.quality.rmse, &answer.after.quality.rmse);
    println!("{:?}: {before:?} {after:?}", ids(&answer));
    for equation in [Equation::ChamberA, Equation::ChamberB] {
        let [before, after] = [before, after].map(|rmse| rmse[equation].expect("is judged"));
        assert!(after < 1.5 * before, "{equation:?}: {before} {after}");
    }
}

/// Diagnoses some of the measured rig's traces on others; none, which is said, where they are not.
fn measured() -> Option<impl Fn(&[&str], &[&str]) -> Diagnosis> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/measured/eha");
    let Ok(rig) = Rig::load(folder.join("rig.toml")) else {
        println!("skipped: no {}", folder.display());
        return None;
    };
    Some(move |fitted: &[&str], judged: &[&str]| {
        let read = |name: &&str| {
            let path = folder.join(format!("{name}.csv.gz"));
            Series::read(&mut TraceReader::open(&path, &rig).expect("opens")).expect("reads")
        };
        let [fitted, judged] = [fitted, judged].map(|names| names.iter().map(read).collect::<Vec<_>>());
        diagnose(&fitted, &judged, &Declared::of(&rig), &|| ())
    })
}
