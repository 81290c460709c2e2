//! Laws of the default estimator: units, number types, and that nothing but numbers ever leaves it.

use pitchleak_core::{
    Cylinder, CylinderError, ExcitationSettings, Fluid, LeakDetector, Parameter, PerLeak, Real, Rls,
    RlsError, RlsSettings, Sample, SensorSpread, Sensors, Update,
};
use pitchleak_testkit::{Motion, Multisine};
use proptest::prelude::*;

const LEAKS: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 2e-12 };

/// Exact readings of a leaky cylinder.
fn exact(seconds: u32) -> impl Iterator<Item = Sample<f64>> {
    Motion::sines(LEAKS).samples(seconds).into_iter()
}

fn narrow<T: Real>(sample: &Sample<f64>) -> Sample<T> {
    Sample {
        x_m: T::lit(sample.x_m),
        pa_pa: T::lit(sample.pa_pa),
        pb_pa: T::lit(sample.pb_pa),
        qa_m3s: sample.qa_m3s.map(T::lit),
        qb_m3s: sample.qb_m3s.map(T::lit),
        force_n: None,
    }
}

fn estimate<T: Real, const N: usize>(
    cylinder: Cylinder<T>,
    fluid: Fluid<T>,
    sensors: &Sensors<T>,
    samples: impl Iterator<Item = Sample<T>>,
) -> Rls<T, N> {
    let mut rls = Rls::new(cylinder, fluid, sensors, RlsSettings::default()).expect("a rig that can be");
    for sample in samples {
        rls.update(T::lit(0.01), &sample);
    }
    rls
}

/// f32 agrees with f64 to a two-hundredth of the standard deviation that sensors of the paper leave, and its own
/// standard deviations to 0.1 %.
#[test]
fn single_precision_is_good_enough() {
    let double: Rls<f64, 4> = estimate(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), exact(60));
    let single: Rls<f32, 4> =
        estimate(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), exact(60).map(|s| narrow(&s)));
    let pairs = double.leak_coefficients().zip(single.leak_coefficients());
    for (_, (double, single)) in pairs {
        let apart = (double.value - f64::from(single.value)).abs() / double.std;
        println!(
            "f32 and f64 are {apart:.3} standard deviations apart, spreads {} and {}",
            single.std, double.std
        );
        assert!(apart < 0.005);
        assert!((f64::from(single.std) / double.std - 1.0).abs() < 1e-3);
    }
}

/// Lengths in units of 1/ℓ m, pressures in 1/p Pa, time in 1/τ s: the coefficients follow their dimension,
/// m³/(s·Pa).
#[test]
fn estimates_do_not_depend_on_the_units() {
    let reference: Rls<f64, 4> = estimate(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), exact(20));
    for (l, p) in [(10.0, 1.0), (1.0, 10.0), (3.0, 0.2)] {
        let scale = |s: SensorSpread<f64>, unit: f64| SensorSpread { noise_std: s.noise_std * unit, ..s };
        let base = Sensors::<f64>::paper();
        let volume = l * l * l;
        let sensors = Sensors {
            flow_a: scale(base.flow_a, volume),
            flow_b: scale(base.flow_b, volume),
            pressure: scale(base.pressure, p),
            position: scale(base.position, l),
            force: base.force,
        };
        let paper = Cylinder::<f64>::paper();
        let cylinder = Cylinder {
            area_a_m2: paper.area_a_m2 * l * l,
            area_b_m2: paper.area_b_m2 * l * l,
            stroke_m: paper.stroke_m * l,
            ..paper
        };
        let Fluid { bulk_modulus_pa, bulk_modulus_std_pa } = Fluid::<f64>::paper();
        let fluid =
            Fluid { bulk_modulus_pa: bulk_modulus_pa * p, bulk_modulus_std_pa: bulk_modulus_std_pa * p };
        let samples = exact(20).map(|s| Sample {
            x_m: s.x_m * l,
            pa_pa: s.pa_pa * p,
            pb_pa: s.pb_pa * p,
            qa_m3s: s.qa_m3s.map(|q| q * volume),
            qb_m3s: s.qb_m3s.map(|q| q * volume),
            force_n: None,
        });
        let scaled: Rls<f64, 4> = estimate(cylinder, fluid, &sensors, samples);
        for (_, (one, other)) in reference.leak_coefficients().zip(scaled.leak_coefficients()) {
            let back = other.scaled(p / volume);
            assert!((back.value - one.value).abs() < 1e-3 * one.std, "{back:?} and {one:?}");
            assert!((back.std / one.std - 1.0).abs() < 1e-3);
        }
    }
}

/// Forgetting must not blow up: an hour of a cylinder at rest after a minute of motion.
#[test]
fn a_long_rest_lets_no_covariance_blow_up() {
    let at_rest =
        Sample { x_m: 0.1, pa_pa: 5e6, pb_pa: 5e6, qa_m3s: Some(4e-5), qb_m3s: Some(1e-5), force_n: None };
    let samples = exact(60).chain(std::iter::repeat_n(at_rest, 360_000));
    let rls: Rls<f64, 4> = estimate(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), samples);
    for (_, coefficient) in rls.leak_coefficients() {
        assert!(coefficient.std <= 1.01 * rls.leak_prior_std());
        assert!(coefficient.value.abs() <= rls.leak_prior_std());
    }
    let report = rls.excitation(&ExcitationSettings::default());
    assert!(!report.leaks.internal.identifiable, "P_L is zero: nothing drives the internal leak");
    assert!(!report.bulk_modulus.identifiable);
}

/// A leak that starts within a trace is found within seconds, not after the forgetting time.
#[test]
fn a_sudden_leak_is_found_within_a_second() {
    let cylinder = Cylinder::<f64>::paper();
    let mut rls =
        Rls::<f64, 4>::new(cylinder, Fluid::paper(), &Sensors::paper(), RlsSettings::default()).unwrap();
    let (mut found_after_s, mut changed_at_s) = (None, None);
    for (k, mut sample) in (0..).zip(exact(90)) {
        let t = f64::from(k) * 0.01;
        if t >= 60.0 {
            sample.qa_m3s = sample.qa_m3s.map(|q| q + 5e-12 * sample.pa_pa);
        }
        if matches!(rls.update(0.01, &sample), Update::Renewed { changed: true, .. }) {
            changed_at_s = Some(t);
        }
        let off = (rls.leak_coefficients().external_a.value - LEAKS.external_a - 5e-12).abs();
        if t >= 60.0 && off < 0.05 * 8e-12 {
            found_after_s.get_or_insert(t - 60.0);
        }
    }
    println!("found after {found_after_s:?} s");
    assert!(found_after_s.is_some_and(|t| t <= 1.0));
    assert!(changed_at_s.is_some_and(|t: f64| (60.0..61.0).contains(&t)), "{changed_at_s:?}");
}

/// Once a leak has changed at once, its flow is quoted at the pressures since, not at those of the minute before.
#[test]
fn after_a_sudden_change_pressures_are_those_since() {
    let mut rls = estimate::<f64, 4>(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), exact(0));
    let mut changed = false;
    // The pressures fall to a third as a hose bursts.
    let after = Motion { pressure_a_pa: lower(6e6), pressure_b_pa: lower(4e6), ..Motion::sines(LEAKS) };
    for mut sample in exact(60).chain((6000..6500).map(|k| after.sample(f64::from(k) * 0.01))) {
        if changed || sample.pa_pa < 4e6 {
            sample.qa_m3s = sample.qa_m3s.map(|q| q + 2e-11 * sample.pa_pa);
        }
        changed |= matches!(rls.update(0.01, &sample), Update::Renewed { changed: true, .. });
    }
    let PerLeak { external_a, external_b, .. } = rls.estimates().mean_pressures_pa;
    println!("P_A {external_a:.3e}, P_B {external_b:.3e}");
    assert!(changed);
    assert!(external_a < 2.5e6 && external_b < 1.7e6, "{external_a} {external_b}");
}

/// A third of a mean pressure, with a slow sine.
fn lower(mean_pa: f64) -> Multisine {
    Multisine { mean: mean_pa / 3.0, lines: vec![(0.1 * mean_pa, 0.2, 0.0)] }
}

/// A leak that grows has a slope, within four standard deviations, and one that stays has none.
#[test]
fn a_leak_that_grows_has_a_slope() {
    let growth_ps = 2e-13;
    let grown = (0..).zip(exact(120)).map(|(k, mut sample)| {
        let t_s = f64::from(k) * 0.01;
        sample.qa_m3s = sample.qa_m3s.map(|q| q + growth_ps * t_s * sample.pa_pa);
        sample
    });
    let rls: Rls<f64, 4> = estimate(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), grown);
    let slopes = rls.estimates().leak_slopes_m3spa_ps;
    println!("{slopes:?}");
    let off = slopes.external_a.value - growth_ps;
    assert!(off.abs() < 4.0 * slopes.external_a.std && off.abs() < 0.2 * growth_ps, "{slopes:?}");
    for still in [slopes.internal, slopes.external_b] {
        assert!(still.std > 0.0 && still.value.abs() < 4.0 * still.std, "{slopes:?}");
    }
}

/// Without pressure and meter in chamber B a leak past the piston and one out of chamber A are the same flow.
#[test]
fn leaks_that_make_the_same_flow_trade_off() {
    let excitation = |samples: Vec<Sample<f64>>| {
        let rls: Rls<f64, 4> =
            estimate(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), samples.into_iter());
        rls.excitation(&ExcitationSettings::default()).leaks
    };
    for (leak, known) in excitation(exact(60).collect()) {
        assert!(known.identifiable && known.traded_with.is_none(), "{leak:?}");
    }
    let blind = exact(60).map(|sample| Sample { pb_pa: 1e3, qb_m3s: None, ..sample });
    let blind = excitation(blind.collect());
    assert!(!blind.internal.identifiable && !blind.external_a.identifiable);
    assert_eq!(blind.internal.traded_with, Some(Parameter::ExternalA));
    assert_eq!(blind.external_a.traded_with, Some(Parameter::Internal));
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -10.0..10.0_f64,
        3 => (-1.0..1.0_f64).prop_map(|v| v * 1e7),
        2 => any::<f64>(),
        1 => prop::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, f64::MAX, f64::MIN_POSITIVE]),
    ]
}

prop_compose! {
    fn any_sample()(
        x in prop_oneof![0.0..0.2_f64, any_number()],
        pa in any_number(), pb in any_number(),
        qa in prop::option::of(prop_oneof![-1e-3..1e-3_f64, any_number()]),
        qb in prop::option::of(prop_oneof![-1e-3..1e-3_f64, any_number()]),
    ) -> Sample<f64> {
        Sample { x_m: x, pa_pa: pa, pb_pa: pb, qa_m3s: qa, qb_m3s: qb, force_n: None }
    }
}

/// The innovations that `update` hands out are those that the estimator judges itself by, and the time between two
/// renewals is the time that was watched.
#[test]
fn an_update_tells_innovation_and_watched_time() {
    let sensors = Sensors::paper();
    let settings = RlsSettings::default();
    let mut rls = Rls::<f64, 4>::new(Cylinder::paper(), Fluid::paper(), &sensors, settings).unwrap();
    let mut rng = pitchleak_testkit::seeded(7);
    let (mut ratio, mut count, mut watched_s) = (0.0, 0.0, 0.0);
    for (k, sample) in exact(60).enumerate() {
        // A minute's pause every ten seconds: nothing is known of it.
        let dt_s = if k % 1000 == 0 { 60.0 } else { 0.01 };
        let update = rls.update(dt_s, &pitchleak_testkit::noisy(&sample, &sensors, &mut rng));
        if let Update::Balanced { innovation: Some(found) }
        | Update::Renewed { innovation: Some(found), .. } = update
        {
            assert!(found.variance >= 1.0, "{update:?}");
            // Over the last minute, as the estimator does.
            let keep = 1.0 / (1.0 + 0.25 / 60.0);
            ratio = keep * (ratio + found.value * found.value / found.variance);
            count = keep * (count + 1.0);
        }
        if let Update::Renewed { elapsed_s, changed, .. } = update {
            assert!(!changed);
            watched_s += elapsed_s;
        }
    }
    let [balance, _] = rls.estimates().normalised_innovation;
    assert!((ratio / count - balance).abs() < 1e-12, "{} {balance}", ratio / count);
    assert!((0.7..1.4).contains(&balance), "{balance} of {count}");
    assert!((59.0..=60.0).contains(&watched_s), "{watched_s}");
}

/// Every second block begins a renewal, and it ends with the sixth sample that follows and is taken in, however few samples
/// a block has: before the next block does.
#[test]
fn a_renewal_ends_before_the_next_block() {
    for (dt_s, block_time_s) in
        [(0.005, 0.25), (0.01, 0.25), (0.05, 0.25), (0.1, 0.25), (0.4, 0.25), (0.01, 0.01)]
    {
        let settings = RlsSettings { block_time_s, ..RlsSettings::default() };
        let mut rls =
            Rls::<f64, 4>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), settings).unwrap();
        let (mut blocks, mut since, mut renewed) = (0, 0, 0);
        // At rest, so that any step will do; gaps and nonsense may come at any moment.
        let flow = Some(1e-12 * 5e6);
        let rest =
            Sample { x_m: 0.1, pa_pa: 5e6, pb_pa: 5e6, qa_m3s: flow, qb_m3s: Some(0.0), force_n: None };
        for k in 0..4000 {
            let sample = if k % 13 == 4 { Sample { pa_pa: f64::NAN, ..rest } } else { rest };
            let update = rls.update(if k % 17 == 5 { 60.0 } else { dt_s }, &sample);
            match update {
                Update::Balanced { .. } => {
                    blocks += 1;
                    since = 0;
                }
                Update::Accepted => since += 1,
                Update::Renewed { changed, .. } => {
                    assert_eq!((since, blocks % 2, changed), (5, 0, false), "{dt_s} s, sample {k}");
                    since += 1;
                    renewed += 1;
                }
                Update::Started | Update::Rejected => {}
            }
            assert!(blocks == 2 * renewed || blocks == 2 * renewed + 1 || since < 6, "{dt_s} s, sample {k}");
        }
        assert!(renewed > 20, "{renewed} with {dt_s} s");
    }
}

#[test]
fn an_estimator_refuses_what_cannot_be() {
    let settings = RlsSettings::default();
    let new =
        |cylinder, fluid, sensors, settings| Rls::<f64, 6>::new(cylinder, fluid, &sensors, settings).err();
    let (cylinder, fluid, sensors) = (Cylinder::paper(), Fluid::paper(), Sensors::paper());
    assert_eq!(new(cylinder, fluid, sensors, settings), None);
    for area_a_m2 in [f64::NAN, 0.0, -1.0, f64::INFINITY] {
        let error = new(Cylinder { area_a_m2, ..cylinder }, fluid, sensors, settings);
        assert_eq!(error, Some(RlsError::Cylinder(CylinderError::Area)), "{area_a_m2}");
    }
    let error = new(cylinder, Fluid { bulk_modulus_pa: 0.0, ..fluid }, sensors, settings);
    assert_eq!(error, Some(RlsError::Cylinder(CylinderError::BulkModulus)));
    for std in [-1e-9, f64::NAN, f64::INFINITY] {
        let spread = [
            SensorSpread { noise_std: std, ..sensors.force },
            SensorSpread { bias_std: std, ..sensors.force },
            SensorSpread { gain_std: std, ..sensors.force },
        ];
        for bad in spread {
            for sensors in [
                Sensors { flow_a: bad, ..sensors },
                Sensors { flow_b: bad, ..sensors },
                Sensors { pressure: bad, ..sensors },
                Sensors { position: bad, ..sensors },
                Sensors { force: bad, ..sensors },
            ] {
                assert_eq!(new(cylinder, fluid, sensors, settings), Some(RlsError::Sensors), "{sensors:?}");
            }
        }
    }
    for time in [0.0, -1.0, f64::NAN] {
        for settings in [
            RlsSettings { forgetting_time_s: time, ..settings },
            RlsSettings { block_time_s: time, ..settings },
            RlsSettings { max_step_s: time, ..settings },
            RlsSettings { block_time_s: f64::INFINITY, ..settings },
        ] {
            assert_eq!(new(cylinder, fluid, sensors, settings), Some(RlsError::Settings), "{settings:?}");
        }
    }
}

/// A gain is the share by which a sensor reads too much.
#[test]
fn the_gain_of_the_position_sensor_is_found() {
    let base = Sensors::paper();
    let position = SensorSpread { gain_std: 0.05, ..base.position };
    let sensors = Sensors { position, ..base };
    for gain in [-0.03, 0.03] {
        let read = exact(60).map(|sample| Sample { x_m: sample.x_m * (1.0 + gain), ..sample });
        let rls: Rls<f64, 9> = estimate(Cylinder::paper(), Fluid::paper(), &sensors, read);
        let [flow_a, flow_b, position] = rls.estimates().gains.expect("nine parameters");
        println!("{gain}: {position:?}, {flow_a:?}, {flow_b:?}");
        assert!((position.value - gain).abs() < 0.1 * gain.abs(), "{position:?} for {gain}");
    }
}

/// What an estimator of fewer parameters does not know is none, not zero.
#[test]
fn small_estimators_know_no_offsets_and_no_gains() {
    fn known<const N: usize>() -> (bool, bool) {
        let sensors = Sensors::paper();
        let found = estimate::<f64, N>(Cylinder::paper(), Fluid::paper(), &sensors, exact(2)).estimates();
        (found.flow_offsets_m3s.is_some(), found.gains.is_some())
    }
    assert_eq!((known::<4>(), known::<6>(), known::<9>()), ((false, false), (true, false), (true, true)));
}

fn all_finite<T: Real, const N: usize>(rls: &Rls<T, N>, detector: &mut LeakDetector<T>) -> bool {
    let found = rls.estimates();
    let leaks = found.leaks_m3spa.into_iter().chain(found.mean_leaks_m3s);
    let estimates = leaks
        .map(|(_, estimate)| estimate)
        .chain(found.flow_offsets_m3s.into_iter().flatten())
        .chain(found.gains.into_iter().flatten())
        .chain(found.pressure_biases_pa)
        .chain([found.compressibility_per_pa]);
    let mut numbers: Vec<T> = estimates.flat_map(|estimate| [estimate.value, estimate.std]).collect();
    numbers.extend(found.normalised_innovation);
    detector.update(T::lit(0.25), &found.mean_leaks_m3s);
    numbers.iter().all(|n| n.is_finite())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// No NaN or infinity leaves the core, whatever goes in.
    #[test]
    fn nothing_but_numbers_leaves_the_core(
        samples in prop::collection::vec((any_sample(), prop_oneof![3 => Just(0.01), 1 => any_number()]), 1..400),
    ) {
        let mut plain = Rls::<f64, 4>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), RlsSettings::default()).unwrap();
        let mut gains = Rls::<f64, 9>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), RlsSettings::default()).unwrap();
        let mut single = Rls::<f32, 6>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), RlsSettings::default()).unwrap();
        let mut detector = LeakDetector::new(Default::default());
        let mut detector_single = LeakDetector::new(Default::default());
        for (sample, dt) in &samples {
            plain.update(*dt, sample);
            gains.update(*dt, sample);
            single.update(*dt as f32, &narrow(sample));
            prop_assert!(all_finite(&plain, &mut detector));
            prop_assert!(all_finite(&gains, &mut detector));
            prop_assert!(all_finite(&single, &mut detector_single));
        }
    }
}
