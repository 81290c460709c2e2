//! Properties of the simulated cylinder.

use pitchleak_core::effects::{EffectConstants, EffectKind};
use pitchleak_core::plant::{CylinderPlant, CylinderState, Drive, Supply, Valve};
use pitchleak_core::{Cylinder, Effect, Fluid, Model, PerLeak};
use proptest::prelude::*;

fn model() -> impl Strategy<Value = Model<f64>> {
    let geometry = (5e-4..5e-3, 0.5..0.95, 0.1..0.6, 5.0..200.0, 0.0..2e-4, 0.0..2e-4);
    let oil_and_leaks = (0.4e9..1.6e9, 0.0..3e-11, 0.0..1e-11, 0.0..1e-11);
    (geometry, oil_and_leaks).prop_map(
        |((area, ratio, stroke, mass, dead_a, dead_b), (bulk, ip, epa, epb))| Model {
            cylinder: Cylinder {
                area_a_m2: area,
                area_b_m2: area * ratio,
                stroke_m: stroke,
                moving_mass_kg: mass,
                dead_volume_a_m3: dead_a,
                dead_volume_b_m3: dead_b,
            },
            fluid: Fluid { bulk_modulus_pa: bulk, bulk_modulus_std_pa: 0.0 },
            leaks_m3spa: PerLeak { internal: ip, external_a: epa, external_b: epb },
        },
    )
}

/// Oil at zero gauge pressure that volumes, pressures and vapour account for.
fn oil_m3(plant: &CylinderPlant<f64>, state: &CylinderState<f64>) -> (f64, f64) {
    let model = &plant.model;
    let (pa, pb) = plant.pressures_pa(state);
    let (vapour_a, vapour_b) = plant.vapour_m3(state);
    let density = |p: f64| (p / model.fluid.bulk_modulus_pa).exp();
    (
        (model.cylinder.volume_a_m3(state.x_m) - vapour_a) * density(pa),
        (model.cylinder.volume_b_m3(state.x_m) - vapour_b) * density(pb),
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// The integral of flows less leaks is the change of stored volume, eq. (1) integrated:
    /// swept volume, compression and vapour, in each chamber, from the readings alone.
    #[test]
    fn oil_volume_is_conserved(
        model in model(), start in 0.3..0.7, pa in 1e6..8e6, pb in 1e6..8e6,
        speed in 0.01..0.2_f64, hertz in 0.5..5.0_f64, load in -5e3..5e3,
    ) {
        let plant = CylinderPlant::new(model).unwrap();
        let (stroke, bulk) = (model.cylinder.stroke_m, model.fluid.bulk_modulus_pa);
        let mut state = plant.state_at(start * stroke, 0.0, pa, pb);
        let drive = |t: f64| {
            let v = speed * stroke * (std::f64::consts::TAU * hertz * t).sin();
            Drive { qa_m3s: model.cylinder.area_a_m2 * v, qb_m3s: -model.cylinder.area_b_m2 * v, force_n: load }
        };
        let seen = |state: &CylinderState<f64>, t: f64| {
            let rates = plant.rates(state, &drive(t));
            let leaks = plant.leaks_m3s(&rates.signals);
            let m = rates.signals;
            let c = &model.cylinder;
            let vapour = plant.vapour_m3(state);
            [
                [m.qa_m3s - leaks.internal - leaks.external_a, m.pa_pa, c.volume_a_m3(m.x_m), vapour.0],
                [m.qb_m3s + leaks.internal - leaks.external_b, m.pb_pa, c.volume_b_m3(m.x_m), vapour.1],
            ]
        };
        let (step, first) = (1e-5, seen(&state, 0.0));
        let (mut before, mut inflow, mut compressed, mut passed) = (first, [0.0; 2], [0.0; 2], [1e-9; 2]);
        for i in 0..20_000 {
            let t = f64::from(i) * step;
            state = plant.step(&state, step, |elapsed| drive(t + elapsed));
            let now = seen(&state, t + step);
            for side in 0..2 {
                let (old, new) = (before[side], now[side]);
                inflow[side] += 0.5 * step * (old[0] + new[0]);
                passed[side] += 0.5 * step * (old[0] + new[0]).abs();
                compressed[side] += 0.5 * (old[2] + new[2] - old[3] - new[3]) / bulk * (new[1] - old[1]);
            }
            before = now;
        }
        for side in 0..2 {
            // In a cavity the oil has the density at vapour pressure, which is 1 − 1e5/β of that at zero.
            let stored = before[side][2] - first[side][2] - (before[side][3] - first[side][3]) + compressed[side];
            prop_assert!((inflow[side] - stored).abs() < 1e-5 * passed[side] + 1e-12,
                "side {side}: {} in, {stored} stored, {} passed", inflow[side], passed[side]);
        }
    }

    /// Sealed, the chambers keep their oil while the load pulls them into cavitation and back.
    #[test]
    fn sealed_oil_stays_through_cavitation(
        model in model(), start in 0.3..0.7, pa in 1e6..4e6, hertz in 5.0..40.0_f64,
    ) {
        let model = Model { leaks_m3spa: PerLeak::default(), ..model };
        let plant = CylinderPlant::new(model).unwrap();
        let cylinder = &model.cylinder;
        let pb = pa * cylinder.area_a_m2 / cylinder.area_b_m2;
        let mut state = plant.state_at(start * cylinder.stroke_m, 0.0, pa, pb);
        let before = oil_m3(&plant, &state);
        let (mut least, mut most, mut most_vapour) = (f64::MAX, 0.0_f64, 0.0_f64);
        for i in 0..4_000 {
            let t = f64::from(i) * 5e-5;
            state = plant.step(&state, 5e-5, |elapsed| Drive {
                force_n: -4.0 * pa * cylinder.area_a_m2 * (std::f64::consts::TAU * hertz * (t + elapsed)).sin(),
                ..Drive::default()
            });
            let pressures = plant.pressures_pa(&state);
            least = least.min(pressures.0).min(pressures.1);
            most = most.max(pressures.0).max(pressures.1);
            most_vapour = most_vapour.max(plant.vapour_m3(&state).0);
        }
        // At resonance the piston slams with thousands of bar; oil pressed above β is let go.
        prop_assume!(most < 0.9 * model.fluid.bulk_modulus_pa);
        let after = oil_m3(&plant, &state);
        // Oil may reach the least pressure in the very step that ends the pull.
        prop_assert!(least >= -1e5 && (most_vapour > 0.0 || least <= -1e5), "least pressure {least}, vapour {most_vapour}");
        prop_assert!((after.0 / before.0 - 1.0).abs() < 1e-9 && (after.1 / before.1 - 1.0).abs() < 1e-9,
            "{before:?} {after:?}");
    }

    /// Nothing but numbers, whatever comes in.
    #[test]
    fn every_state_stays_finite(
        x in any::<f64>(), v in any::<f64>(), pa in any::<f64>(), pb in any::<f64>(),
        inputs in proptest::collection::vec((any::<f64>(), any::<f64>(), any::<f64>(), 0..6u8), 1..30),
        which in 0..Effect::ALL.len(),
    ) {
        let mut cylinder = CylinderPlant::new(Model::paper()).unwrap();
        let effect = Effect::ALL[which];
        cylinder.effects.set(effect, effect.spec().upper, EffectConstants::default()).unwrap();
        let mut state = cylinder.state_at(x, v, pa, pb);
        for (a, b, c, bad) in inputs {
            let special = [a, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 0.0][usize::from(bad)];
            state = cylinder.step(&state, 1e-3, |_| Drive { qa_m3s: a, qb_m3s: special, force_n: b });
            state = cylinder.step(&state, special, |_| Drive { qa_m3s: b, qb_m3s: c, force_n: special });
            let p = cylinder.pressures_pa(&state);
            for value in [state.x_m, state.v_mps, state.oil_a_m3, state.oil_b_m3, p.0, p.1] {
                prop_assert!(value.is_finite(), "{state:?}");
            }
            prop_assert!((0.0..=0.2).contains(&state.x_m) && p.0 >= -1e5 && p.1 >= -1e5);
        }
    }
}

/// Free oscillation between two oil columns: the error of a step falls with its fourth power.
#[test]
fn plant_converges_with_the_fourth_power_of_the_step() {
    let model = Model::<f64>::paper();
    let plant = CylinderPlant::new(model).unwrap();
    let after = |steps: u32| {
        let step = 1e-2 / f64::from(steps);
        let mut state = plant.state_at(0.1, 0.01, 3e6, 3e6);
        for _ in 0..steps {
            state = plant.step(&state, step, |_| Drive { force_n: 900.0, ..Drive::default() });
        }
        let (pa, pb) = plant.pressures_pa(&state);
        [state.x_m / 1e-5, state.v_mps / 1e-2, pa / 1e5, pb / 1e5]
    };
    let reference = after(3200);
    let error = |steps: u32| {
        let squares = after(steps).into_iter().zip(reference).map(|(value, truth)| (value - truth).powi(2));
        squares.sum::<f64>().sqrt()
    };
    for steps in [80, 120, 160] {
        let order = (error(steps) / error(2 * steps)).log2();
        assert!((order - 4.0).abs() < 0.2, "order {order} at {steps} steps");
    }
}

/// The piston rests on the stop, with some oil left in a chamber without dead volume.
#[test]
fn end_stops_hold_full_pressure() {
    let plant = CylinderPlant::new(Model::<f64>::paper()).unwrap();
    for (start, load) in [(0.02, 12_000.0), (0.18, -12_000.0)] {
        let mut state = plant.state_at(start, 0.0, 1e6, 1e6);
        let push = f64::signum(load) * 3e-4;
        for _ in 0..4_000 {
            state =
                plant.step(&state, 5e-4, |_| Drive { qa_m3s: -push, qb_m3s: push * 0.746, force_n: load });
        }
        let end = if load > 0.0 { 0.0 } else { 0.2 };
        assert!((state.x_m - end).abs() < 3e-4, "rests at {}", state.x_m);
    }
}

/// In simulation an effect is exactly what the diagnosis will look for.
#[test]
fn residual_of_the_plain_model_is_the_effects_term() {
    // Such that each effect acts in the state below.
    let constants = EffectConstants { cracking_pa: 1e6, ..EffectConstants::default() };
    for effect in Effect::ALL.iter().copied() {
        let spec = effect.spec();
        if spec.kind == EffectKind::Sensor {
            continue;
        }
        let leaks = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 0.0 };
        let mut plant = CylinderPlant::new(Model::<f64> { leaks_m3spa: leaks, ..Model::paper() }).unwrap();
        (plant.temp_k, plant.time_s) = (323.0, 20.0);
        plant.effects.set(effect, spec.default_size, constants).unwrap();
        let state = plant.state_at(0.09, 0.02, 4e6, 2e6);
        let signals = plant.rates(&state, &Drive { qa_m3s: 5e-5, qb_m3s: -1e-5, force_n: 2e3 }).signals;
        let residual = plant.model.residual(&signals);
        let term = effect.unit_term(&signals, &plant.model, &constants);
        let expected = term.zip(term, |unit, _| unit * spec.default_size);
        let scale = [1e-4, 1e-4, 5e3];
        let pairs = [
            (residual.chamber_a_m3s, expected.chamber_a_m3s),
            (residual.chamber_b_m3s, expected.chamber_b_m3s),
            (residual.force_n, expected.force_n),
        ];
        for ((left, right), scale) in pairs.into_iter().zip(scale) {
            assert!((left - right).abs() < 1e-10 * scale, "{effect}: {residual:?} {expected:?}");
        }
        assert!(pairs.iter().any(|(_, right)| *right != 0.0), "{effect} has no term");
    }
}

/// An end stop only ever pushes the piston back into the stroke, with its stiffness times its depth.
#[test]
fn end_stops_push_inwards() {
    let plant = CylinderPlant::new(Model::<f64>::paper()).unwrap();
    let (stop, mass_kg) = (plant.end_stop, plant.model.cylinder.moving_mass_kg);
    let stroke_m = plant.model.cylinder.stroke_m;
    let drive = Drive::default();
    let accelerated = |x_m: f64| plant.rates(&plant.state_at(x_m, 0.0, 0.0, 0.0), &drive).signals.a_mps2;
    let force_n = stop.stiffness_npm * 0.5 * stop.gap_m;
    assert!((mass_kg * accelerated(0.5 * stop.gap_m) / force_n - 1.0).abs() < 1e-9);
    assert!((mass_kg * accelerated(stroke_m - 0.5 * stop.gap_m) / force_n + 1.0).abs() < 1e-9);
    assert!((mass_kg * accelerated(0.5 * stroke_m) / force_n).abs() < 1e-9);
}

/// Every edge passes oil from the higher pressure to the lower, the B edges by their area ratio.
#[test]
fn valve_edges_pass_the_rated_flow_downhill() {
    let valve = Valve::<f64> { underlap: 0.0, ..Valve::paper() };
    let (rated, drop, ratio) = (valve.rated_flow_m3s, valve.rated_drop_pa, valve.area_ratio_b);
    // Metering rounds the root off where it is laminar: by a per mille at this drop.
    let near = |flow: f64, expected: f64| (flow - expected).abs() < 2e-3 * rated;
    let extend = valve.flows(1.0, 2.0 * drop, drop, drop);
    assert!(near(extend.a_m3s, rated) && near(extend.b_m3s, -ratio * rated), "{extend:?}");
    assert!(near(extend.supply_m3s, rated), "{extend:?}");
    let retract = valve.flows(-1.0, 2.0 * drop, drop, drop);
    assert!(near(retract.a_m3s, -rated) && near(retract.b_m3s, ratio * rated), "{retract:?}");
    assert!(near(retract.supply_m3s, ratio * rated), "{retract:?}");
}

/// The supply's pressure goes back to where all of the pump's flow runs over the relief valve.
#[test]
fn supply_settles_at_its_idle_pressure() {
    let supply = Supply::<f64>::paper();
    let idle_pa = supply.idle_pressure_pa();
    assert!(idle_pa > supply.relief_pressure_pa);
    assert!((supply.rate_pas(idle_pa, 0.0) * supply.compliance_m3pa).abs() < 1e-12 * supply.pump_flow_m3s);
    assert!(supply.rate_pas(idle_pa + 1e4, 0.0) < 0.0 && supply.rate_pas(idle_pa - 1e4, 0.0) > 0.0);
    assert!(supply.rate_pas(idle_pa, supply.pump_flow_m3s) < 0.0, "what valves draw lowers it");
}

/// Where a motion is fast the step is divided: one long step comes near many short ones. (Each part may be as long as
/// the fastest motion's time constant: a few percent off, where too long a step diverges.)
#[test]
fn a_step_may_be_as_long_as_one_likes() {
    let model = Model::<f64>::paper();
    let plain = CylinderPlant::new(model).unwrap();
    let mut dragged = plain;
    dragged.effects.set(Effect::ViscousFriction, 1e6, EffectConstants::default()).unwrap();
    let stop = plain.end_stop.gap_m;
    // With hoses the stop is stiffer than the oil.
    let mut hosed = plain;
    hosed.model.cylinder.dead_volume_a_m3 = 2e-4;
    hosed.model.cylinder.dead_volume_b_m3 = 2e-4;
    let cases = [
        ("at the A end", plain, 0.002, 0.1),
        ("at the B end", plain, 0.198, -0.1),
        ("at mid stroke", plain, 0.1, 0.1),
        ("under heavy friction", dragged, 0.1, 0.1),
        ("on the A stop", plain, 0.5 * stop, 0.0),
        ("on the B stop", plain, 0.2 - 0.5 * stop, 0.0),
        ("on the A stop with hoses", hosed, 0.5 * stop, 0.0),
        ("on the B stop with hoses", hosed, 0.2 - 0.5 * stop, 0.0),
    ];
    for (place, plant, x_m, v_mps) in cases {
        let start = plant.state_at(x_m, v_mps, 4e6, 4e6 * 1.26 / 0.94);
        let after = |steps: u32| {
            let step_s = 1e-3 / f64::from(steps);
            let end = (0..steps).fold(start, |state, _| plant.step(&state, step_s, |_| Drive::default()));
            let (pa, pb) = plant.pressures_pa(&end);
            [end.x_m / 1e-4, end.v_mps / 0.1, pa / 4e6, pb / 4e6]
        };
        for (once, fine) in after(1).into_iter().zip(after(1000)) {
            assert!(
                (once - fine).abs() < 0.1 * fine.abs().max(1.0),
                "{place}: {once} at once, {fine} finely"
            );
        }
    }
}

/// The fastest piston is so many strokes a second, whatever the stroke.
#[test]
fn the_fastest_piston_goes_with_the_stroke() {
    let fastest = |share: f64| {
        let mut model = Model::<f64>::paper();
        model.cylinder.stroke_m *= share;
        CylinderPlant::new(model).unwrap().state_at(0.05, 1e9, 1e6, 1e6).v_mps
    };
    assert!((fastest(3.0) / fastest(1.0) - 3.0).abs() < 1e-12, "{} {}", fastest(3.0), fastest(1.0));
}
