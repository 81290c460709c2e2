//! The table of effects and the maps between truth and reading.

use pitchleak_core::effects::{
    EffectConstant, EffectConstants, EffectError, EffectKind, LaggedReading, Play,
};
use pitchleak_core::{Effect, EffectSet, Model, PerLeak, SensorSpread, Sensors, Signals};
use proptest::prelude::*;

fn signals() -> impl Strategy<Value = Signals<f64>> {
    let motion = (0.01..0.19, -0.1..0.1, -2.0..2.0);
    let oil = (1e5..8e6, 1e5..8e6, -1e7..1e7, -1e7..1e7);
    let flow = (-3e-4..3e-4, -3e-4..3e-4, -1e-3..1e-3, -1e-3..1e-3);
    let jerk = (-1e9..1e9, -1e9..1e9);
    (motion, oil, jerk, flow, -5e3..5e3).prop_map(
        |((x, v, a), (pa, pb, dpa, dpb), (d2pa, d2pb), (qa, qb, dqa, dqb), force)| Signals {
            x_m: x,
            v_mps: v,
            a_mps2: a,
            pa_pa: pa,
            pb_pa: pb,
            dpa_pas: dpa,
            dpb_pas: dpb,
            d2pa_pas2: d2pa,
            d2pb_pas2: d2pb,
            pa_side: 0.7,
            pb_side: -0.4,
            dpa_side_ps: 5.0,
            dpb_side_ps: -7.0,
            x_side: -0.6,
            dx_side_ps: 4.0,
            qa_unread: 0.3,
            qb_unread: -0.9,
            qa_m3s: qa,
            qb_m3s: qb,
            dqa_m3s2: dqa,
            dqb_m3s2: dqb,
            force_n: force,
            temp_k: 320.0,
            t_s: 100.0,
        },
    )
}

fn numbers(m: Signals<f64>) -> [f64; 9] {
    [m.x_m, m.v_mps, m.pa_pa, m.pb_pa, m.dpa_pas, m.dpb_pas, m.qa_m3s, m.qb_m3s, m.force_n]
}

proptest! {
    #[test]
    fn correcting_undoes_reading(truth in signals()) {
        let mut all = EffectSet::default();
        for effect in [Effect::PositionGain, Effect::PressureOffsetA, Effect::LineResistanceB,
            Effect::FlowMeterGainA, Effect::FlowMeterOffsetA, Effect::ForceGain, Effect::FlowMeterLag] {
            all.set(effect, effect.spec().default_size, EffectConstants::default()).unwrap();
        }
        for (back, truth) in numbers(all.correct(&all.read(&truth))).into_iter().zip(numbers(truth)) {
            prop_assert!((back - truth).abs() <= 1e-9 * truth.abs().max(1e-9), "{back} {truth}");
        }
    }

    /// A sensor's regressor is the slope of the residual in the effect's value.
    #[test]
    fn sensor_term_is_the_slope_of_the_residual(truth in signals()) {
        let leaks = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 1e-12 };
        let model = Model { leaks_m3spa: leaks, ..Model::paper() };
        for effect in Effect::ALL.iter().copied().filter(|e| e.spec().kind == EffectKind::Sensor) {
            let value = effect.spec().default_size * 1e-2;
            let change = model.residual(&effect.read(value, &truth)).plus(-1.0, model.residual(&truth));
            let unit = effect.unit_term(&truth, &model, &EffectConstants::default());
            for (change, term, scale) in [(change.chamber_a_m3s, unit.chamber_a_m3s, 1e-4),
                (change.chamber_b_m3s, unit.chamber_b_m3s, 1e-4), (change.force_n, unit.force_n, 1e4)] {
                prop_assert!((change - value * term).abs() < 1e-3 * (value * term).abs() + 1e-12 * scale,
                    "{effect}: {change} {}", value * term);
            }
        }
    }
}

#[test]
fn signs_of_the_terms_an_operator_would_check_by_hand() {
    let (model, constants) = (Model::<f64>::paper(), EffectConstants::default());
    let at = Signals { x_m: 0.1, v_mps: 0.05, pa_pa: 4e6, pb_pa: 1e6, qa_m3s: 2e-4, ..Signals::default() };
    let term = |effect: Effect| effect.unit_term(&at, &model, &constants);
    let close = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs();
    assert!(close(term(Effect::FlowMeterOffsetA).chamber_a_m3s, 1.0));
    assert!(close(term(Effect::FlowMeterGainA).chamber_a_m3s, 2e-4));
    assert!(close(term(Effect::PositionGain).chamber_a_m3s, -1.26e-3 * 0.05));
    assert!(close(term(Effect::PositionGain).chamber_b_m3s, 0.94e-3 * 0.05));
    assert!(close(term(Effect::PressureOffsetB).force_n, -0.94e-3));
    assert!(
        close(term(Effect::InternalLeakTurbulent).chamber_a_m3s, 3e6_f64.sqrt()) || {
            let ratio = term(Effect::InternalLeakTurbulent).chamber_a_m3s / 3e6_f64.sqrt();
            (ratio - 1.0).abs() < 1e-4
        }
    );
    assert!(close(term(Effect::ViscousFriction).force_n, 0.05));
}

#[test]
fn every_id_names_its_effect() {
    for effect in Effect::ALL.iter().copied() {
        let spec = effect.spec();
        assert_eq!(spec.id.parse(), Ok(effect));
        assert!(spec.lower <= 0.0 && spec.default_size > 0.0 && spec.default_size < spec.upper, "{effect}");
        assert_eq!(format!("{effect:?}").to_lowercase(), spec.id.replace('_', ""));
    }
    let error = "slip".parse::<Effect>().unwrap_err().to_string();
    assert!(error.contains(" position_gain "), "{error}");
}

#[test]
fn a_set_refuses_what_cannot_be() {
    let (mut set, constants) = (EffectSet::<f64>::default(), EffectConstants::default());
    for bad in [-1e-5, f64::NAN, f64::INFINITY] {
        let error = set.set(Effect::AccumulatorA, bad, constants);
        assert_eq!(error, Err(EffectError::Value(Effect::AccumulatorA)));
    }
    let flat = EffectConstants { spot_width_m: 0.0, ..constants };
    let error = set.set(Effect::PositionDependentLeak, 1e-12, flat);
    assert_eq!(error, Err(EffectError::Constants(Effect::PositionDependentLeak)));
    for effect in &Effect::ALL[..8] {
        set.set(*effect, effect.spec().default_size, constants).unwrap();
    }
    assert_eq!(set.set(Effect::LoadOffset, 1.0, constants), Err(EffectError::Full));
    set.set(Effect::AccumulatorA, 0.0, constants).unwrap();
    set.set(Effect::LoadOffset, 1.0, constants).unwrap();
    assert_eq!(set.iter().count(), 8);
}

/// A term that grows with a measured left side of the chambers' equations carries its noise, and says so. What only turns with it,
/// as a direction does, carries none once it is turned.
#[test]
fn what_carries_the_noise_of_the_left_side_is_in_proportion_to_it() {
    use pitchleak_core::effects::LeftSide;
    let (model, constants) = (Model::<f64>::paper(), EffectConstants::default());
    let rest =
        Signals { x_m: 0.09, pa_pa: 4e6, pb_pa: 1e6, dpa_pas: 1e6, temp_k: 330.0, ..Signals::default() };
    let sides = [
        (LeftSide::Speed, Signals { v_mps: 0.05, ..rest }, Signals { v_mps: 0.1, ..rest }),
        (LeftSide::FlowA, Signals { qa_m3s: 1e-4, ..rest }, Signals { qa_m3s: 2e-4, ..rest }),
        (LeftSide::FlowB, Signals { qb_m3s: 1e-4, ..rest }, Signals { qb_m3s: 2e-4, ..rest }),
    ];
    for effect in Effect::ALL.iter().copied() {
        for (side, one, two) in &sides {
            let flows = |at: &Signals<f64>| {
                let own = effect.unit_term(at, &model, &constants);
                let none = effect.unit_term(&rest, &model, &constants);
                [own.chamber_a_m3s - none.chamber_a_m3s, own.chamber_b_m3s - none.chamber_b_m3s]
            };
            let (one, two) = (flows(one), flows(two));
            let size = (two[0] - one[0]).abs() + (two[1] - one[1]).abs();
            let carries = effect.spec().carries == Some(*side);
            assert_eq!(size > 1e-9, carries, "{effect} {side:?} {size}");
            for (one, two) in one.into_iter().zip(two).filter(|_| carries) {
                assert!((two - 2.0 * one).abs() < 1e-9 * size + 1e-12, "{effect} {side:?}");
            }
        }
    }
}

/// What is known of a sensor's error beforehand is what its data sheet says, each of its own.
#[test]
fn a_sensors_declared_error_is_the_prior_of_its_effect() {
    let spread =
        |k: f64| SensorSpread { noise_std: 99.0, bias_std: k, gain_std: 10.0 * k, drift_std_ph: 99.0 };
    let sensors = Sensors {
        flow_a: spread(1.0),
        flow_b: spread(2.0),
        pressure: spread(3.0),
        position: spread(4.0),
        force: spread(5.0),
    };
    for effect in Effect::ALL.iter().copied() {
        let id = effect.spec().id;
        let sensor = ["flow_meter_", "pressure_", "position_", "force_", "load_offset"]
            .iter()
            .position(|name| id.starts_with(name))
            .filter(|_| id.contains("offset") || id.contains("gain"));
        let own = sensor.map(|k| match (k, id.ends_with("_b")) {
            (0, false) => 1.0,
            (0, true) => 2.0,
            (1, _) => 3.0,
            (2, _) => 4.0,
            _ => 5.0,
        });
        let expected = own.map(|own| if id.contains("gain") { 10.0 * own } else { own });
        assert_eq!(effect.prior_std(&sensors), expected, "{effect}");
        assert_eq!(effect.prior_std(&Sensors::<f64>::default()), None, "{effect}");
    }
}

/// A lag's value is a time, and the signals that it delays are those that its map changes.
#[test]
fn late_sensors_are_those_that_a_lag_delays() {
    let moving = Signals { dqa_m3s2: 1.0, dqb_m3s2: 1.0, dpa_pas: 1.0, dpb_pas: 1.0, ..Signals::default() };
    for effect in Effect::ALL.iter().copied() {
        let mut shown = effect.read(0.5, &moving);
        let late: Vec<f64> = effect.late(&mut shown).into_iter().flatten().map(|signal| *signal).collect();
        assert_eq!(!late.is_empty(), effect.spec().unit == "s", "{effect}");
        assert!(late.iter().all(|signal| (signal + 0.5).abs() < 1e-12), "{effect}: {late:?}");
    }
}

/// Play is the distance by which a reading hangs behind: rising it reads less, falling more.
#[test]
fn sensors_with_play_are_those_that_hang_behind() {
    let rising = Signals { x_side: 1.0, pa_side: 1.0, pb_side: 1.0, ..Signals::default() };
    for effect in Effect::ALL.iter().copied() {
        let mut shown = effect.read(0.5, &rising);
        let hanging = effect.hanging(&mut shown).map(|signal| *signal);
        assert_eq!(hanging, effect.spec().id.contains("_hysteresis").then_some(-0.5), "{effect}");
    }
}

/// A dead band is the flow below which a meter shows none: of a flow at its edge it takes all.
#[test]
fn meters_with_a_dead_band_are_those_that_lose_it() {
    let band = 0.5;
    let edge = Signals { qa_m3s: band, qb_m3s: -band, qa_unread: 1.0, qb_unread: -1.0, ..Signals::default() };
    for effect in Effect::ALL.iter().copied() {
        let mut shown = effect.read(band, &edge);
        let silent = effect.deaf(&mut shown).map(|signal| *signal);
        assert_eq!(silent, effect.spec().id.contains("_dead_band").then_some(0.0), "{effect}");
    }
}

/// Once it has moved through its play the sensor reads what the map between truth and reading says, either way.
#[test]
fn a_sensor_with_play_hangs_behind_on_both_sides() {
    let (width, mut own, mut known) = (3.0_f64, Play::new(0.0), Play::new(0.0));
    let way = (0..200).map(|i| f64::from(i - 2 * (i - 100).max(0)));
    for signal in way {
        let (reading, side) = (own.update(width, signal), known.side(width, signal));
        let truth = Signals { pa_pa: signal, pa_side: side, ..Signals::default() };
        let mapped = Effect::PressureHysteresisA.read(width, &truth).pa_pa;
        assert!((reading - mapped).abs() < 1e-9 && side.abs() <= 1.0, "{signal}: {reading} {mapped}");
    }
    assert!(
        (own.update(width, 1.0) - 4.0).abs() < 1e-12 && (own.update(width, f64::NAN) - 4.0).abs() < 1e-12
    );
}

/// A fit varies exactly the constants that an effect's term depends on.
#[test]
fn every_constant_that_matters_is_listed() {
    let (model, constants) = (Model::<f64>::paper(), EffectConstants::default());
    let at = Signals {
        x_m: 0.09,
        v_mps: 5e-4,
        a_mps2: 0.1,
        pa_pa: 13e6,
        pb_pa: 6e6,
        qa_m3s: 6e-7,
        qb_m3s: -5e-7,
        dpa_pas: 1e6,
        dpb_pas: -2e6,
        temp_k: 330.0,
        t_s: 100.0,
        ..Signals::default()
    };
    for effect in Effect::ALL.iter().copied() {
        for parameter in EffectConstant::ALL {
            let changed = constants.with(parameter, constants.get(parameter) * 1.1 + 1e-3);
            let matters =
                effect.unit_term(&at, &model, &changed) != effect.unit_term(&at, &model, &constants);
            assert_eq!(matters, effect.constants().contains(&parameter), "{effect} {parameter:?}");
        }
    }
}

/// On a slow ramp the lagging meter reads what the map between truth and reading says.
#[test]
fn a_lagging_meter_trails_a_ramp_by_its_lag() {
    let (lag, slope, step) = (0.05_f64, 1e-4, 1e-4);
    let mut meter = LaggedReading::new(0.0);
    let mut reading = 0.0;
    for i in 1..=10_000 {
        reading = meter.update(step, lag, slope * step * f64::from(i));
    }
    let truth = Signals { qa_m3s: slope, dqa_m3s2: slope, ..Signals::default() };
    let mapped = Effect::FlowMeterLag.read(lag, &truth).qa_m3s;
    assert!((reading - mapped).abs() < 1e-9 * slope, "{reading} {mapped}");
    assert!((meter.update(step, lag, f64::NAN) - reading).abs() < 1e-30);
}

/// Free gas of share α takes V α/n (P₀/P)^{1/n}/P Ṗ, absolute pressures, whatever the pressure is.
#[test]
fn entrained_air_follows_the_polytropic_law() {
    let (model, constants) = (Model::<f64>::paper(), EffectConstants::default());
    let n = constants.polytropic_exponent;
    for pa_pa in [0.0, 4e5, 5e6] {
        let at = Signals { x_m: 0.1, pa_pa, dpa_pas: 1e6, ..Signals::default() };
        let absolute_pa: f64 = pa_pa + 101_325.0;
        let by_hand =
            model.cylinder.volume_a_m3(0.1) * (101_325.0 / absolute_pa).powf(1.0 / n) / n / absolute_pa;
        let term = Effect::EntrainedAir.unit_term(&at, &model, &constants).chamber_a_m3s;
        assert!((term / (by_hand * 1e6) - 1.0).abs() < 1e-12, "{term} at {pa_pa} Pa");
    }
}

/// Dry friction turns within its slip speed: tanh 1 of it is there at that speed.
#[test]
fn dry_friction_holds_a_piston_with_what_it_resists_at_creeping_speed() {
    let constants = EffectConstants { stribeck_speed_mps: 1.0, ..EffectConstants::default() };
    let at =
        Signals { v_mps: 20.0 * constants.slip_speed_mps, pa_pa: 4e6, pb_pa: -1e6, ..Signals::default() };
    let dry: Vec<Effect> = Effect::ALL.iter().copied().filter(|one| one.stiction(&at).is_some()).collect();
    assert_eq!(dry, [Effect::CoulombFriction, Effect::StribeckFriction, Effect::SealFriction]);
    for effect in dry {
        let creeping: f64 = effect.unit_term(&at, &Model::paper(), &constants).force_n;
        let holds = effect.stiction(&at).expect("is dry");
        assert!((creeping / holds - 1.0).abs() < 1e-3, "{effect}: {creeping} {holds}");
    }
}

#[test]
fn what_adds_to_a_declared_number_is_that_number() {
    let moving = Signals { x_m: 0.07, v_mps: 0.02, pa_pa: 4e6, pb_pa: 1e6, ..Signals::default() };
    let at = Signals { a_mps2: 0.3, dpa_pas: 1e6, dpb_pas: -2e6, ..moving };
    let model = Model::paper();
    for effect in Effect::ALL {
        let (mut more, size) = (model, effect.spec().default_size);
        let Some(number) = effect.adds_to(&mut more.cylinder) else { continue };
        *number += size;
        let moved = model.residual(&at).plus(-1.0, more.residual(&at));
        let term = effect.unit_term(&at, &model, &EffectConstants::default());
        let left = moved.plus(-size, term);
        for (left, moved) in [
            (left.chamber_a_m3s, moved.chamber_a_m3s),
            (left.chamber_b_m3s, moved.chamber_b_m3s),
            (left.force_n, moved.force_n),
        ] {
            assert!(left.abs() <= 1e-9 * moved.abs(), "{effect}");
        }
    }
}

#[test]
fn given_constants_are_not_fitted_and_fitted_ones_have_a_range_in_a_lively_trace() {
    let span = |of: fn(&Signals<f64>) -> f64| {
        let ends = [-1.0, 1.0].map(|way| {
            of(&Signals {
                x_m: 0.1 + 0.05 * way,
                v_mps: 0.05 * way,
                pa_pa: 5e6 + 2e6 * way,
                pb_pa: 3e6,
                ..Signals::default()
            })
        });
        (ends[0].min(ends[1]), ends[0].max(ends[1]))
    };
    for effect in Effect::ALL {
        for constant in effect.constants() {
            let is_given = effect.spec().given.contains(constant);
            assert_eq!(effect.fitted_constants().any(|own| own == *constant), !is_given, "{effect}");
            let range = constant.range(1e-4, span);
            let bounds = constant.spec();
            assert!(
                is_given
                    || range
                        .is_some_and(|(low, high)| low < high && low >= bounds.lower && high <= bounds.upper),
                "{effect} {range:?}"
            );
        }
    }
}

#[test]
fn dry_friction_turns_at_its_slip_speed() {
    let (model, constants) = (Model::<f64>::paper(), EffectConstants::default());
    for (share, expected) in [(1.0, 0.761_594), (-1.0, -0.761_594), (10.0, 1.0)] {
        let at = Signals { v_mps: share * constants.slip_speed_mps, ..Signals::default() };
        let force_n = Effect::CoulombFriction.unit_term(&at, &model, &constants).force_n;
        assert!((force_n - expected).abs() < 1e-6, "{force_n}");
    }
}

/// Nothing leaks below the cracking pressure, and what is beyond drives the leak above it, either way.
#[test]
fn a_leak_above_a_cracking_pressure_grows_with_what_is_beyond() {
    let (model, constants) =
        (Model::<f64>::paper(), EffectConstants { cracking_pa: 5e6, ..Default::default() });
    for (pressure, beyond) in [(4.9e6, 0.0), (-4.9e6, 0.0), (5e6, 0.0), (6.5e6, 1.5e6), (-6.5e6, -1.5e6)] {
        let at = Signals { pa_pa: pressure, pb_pa: 0.0, ..Signals::default() };
        let past = Effect::InternalLeakCracking.unit_term(&at, &model, &constants);
        assert_eq!((past.chamber_a_m3s, past.chamber_b_m3s), (beyond, -beyond));
    }
}

/// What grows with time does so from the trace's beginning on.
#[test]
fn what_grows_is_nothing_at_the_beginning_and_twice_as_large_after_twice_the_time() {
    let (model, constants) = (Model::<f64>::paper(), EffectConstants::default());
    let at = |t_s: f64| Signals { pa_pa: 4e6, pb_pa: 1e6, t_s, ..Signals::default() };
    let leak = |t_s| Effect::InternalLeakGrowth.unit_term(&at(t_s), &model, &constants).chamber_a_m3s;
    let drift = |t_s| Effect::FlowMeterDriftA.read(1e-7, &at(t_s)).qa_m3s;
    assert_eq!((leak(0.0), drift(0.0)), (0.0, 0.0));
    assert!((leak(60.0) - 60.0 * 3e6).abs() < 1e-6 && (leak(120.0) - 2.0 * leak(60.0)).abs() < 1e-6);
    assert!((drift(60.0) - 6e-6).abs() < 1e-18 && (drift(120.0) - 1.2e-5).abs() < 1e-18);
}

/// Past a check valve oil goes one way, whichever way the piston moves.
#[test]
fn a_leak_that_is_larger_one_way_goes_with_the_load_pressure() {
    let (model, constants) = (Model::<f64>::paper(), EffectConstants::default());
    for (pa_pa, pb_pa) in [(4e6, 1e6), (1e6, 4e6)] {
        let at = Signals { pa_pa, pb_pa, v_mps: -0.05, ..Signals::default() };
        let leak = Effect::InternalLeakOneWay.unit_term(&at, &model, &constants);
        assert!(
            (leak.chamber_a_m3s - 3e6).abs() < 1e-3 && (leak.chamber_b_m3s + 3e6).abs() < 1e-3,
            "{leak:?}"
        );
    }
}

/// A seal that is tighter one way leaks more the other way: as the piston moves, whatever leaks past the meters meanwhile.
#[test]
fn a_leak_that_depends_on_direction_turns_with_the_motion() {
    let constants = EffectConstants::default();
    let leaking = PerLeak { internal: 1e-10, external_a: 2e-11, external_b: 3e-11 };
    for leaks_m3spa in [PerLeak::default(), leaking] {
        let model = Model::<f64> { leaks_m3spa, ..Model::paper() };
        for (way, speed) in [(1.0, 0.05), (-1.0, -0.05), (0.0, 0.0)] {
            let (pa_pa, pb_pa) = (4e6, 1e6);
            let past = leaks_m3spa.internal * (pa_pa - pb_pa);
            let at = Signals {
                pa_pa,
                pb_pa,
                qa_m3s: speed * model.cylinder.area_a_m2 + past + leaks_m3spa.external_a * pa_pa,
                qb_m3s: -speed * model.cylinder.area_b_m2 - past + leaks_m3spa.external_b * pb_pa,
                ..Signals::default()
            };
            let leak = Effect::InternalLeakDirection.unit_term(&at, &model, &constants).chamber_a_m3s;
            assert!((leak - way * 3e6).abs() < 1.0, "{leak}");
        }
    }
}

#[test]
fn an_effect_that_is_switched_off_leaves_the_others_on() {
    let all = [Effect::ViscousFriction, Effect::PositionGain, Effect::CoulombFriction];
    let on = |set: &EffectSet<f64>| set.iter().map(|active| active.effect).collect::<Vec<_>>();
    for off in all {
        let mut set = EffectSet::default();
        for effect in all {
            set.set(effect, 0.01, EffectConstants::default()).unwrap();
        }
        set.set(off, 0.0, EffectConstants::default()).unwrap();
        assert_eq!(on(&set), all.into_iter().filter(|effect| *effect != off).collect::<Vec<_>>());
        set.set(off, 0.02, EffectConstants::default()).unwrap();
        assert_eq!(set.iter().count(), 3);
        all.into_iter().for_each(|effect| set.set(effect, 0.0, EffectConstants::default()).unwrap());
        assert!(set.is_empty() && on(&set).is_empty());
    }
}
