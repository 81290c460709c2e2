//! The rig's integration against one of steps ten times finer, in shares of what the paper's sensors scatter.

use super::*;

/// 3 σ is 1 % of full scale: 200 mm, 16 MPa, 20 L/min, 10 kN.
const NOISE: [(&str, f64); 6] =
    [("x", 0.2), ("pa", 16e6), ("pb", 16e6), ("qa", 20.0 / 60e3), ("qb", 20.0 / 60e3), ("force", 10e3)];
const SHARE: f64 = 0.01 / 3.0;

/// Position about a middle, m, and load, N: slow and fast motion together, faster than in any wind.
fn reference(middle_m: f64, t_s: f64) -> (f64, f64) {
    let x_m = middle_m + 0.04 * (0.5 * t_s).sin() + 0.01 * (2.3 * t_s).sin() + 0.002 * (9.0 * t_s).sin();
    let load_n = 2e3 + 1.5e3 * (0.7 * t_s).sin() + 400.0 * (5.0 * t_s).sin() + 100.0 * (20.0 * t_s).sin();
    (x_m, load_n)
}

/// Readings at 100 Hz of a leaking rig, after a second of running in.
fn readings(middle_m: f64, internal_step_s: f64, finer: u32) -> Vec<[f64; 6]> {
    let mut params = EmulatorParams::<f64>::for_model(Model::paper()).unwrap();
    params.internal_step_s = internal_step_s;
    let (x_m, load_n) = reference(middle_m, 0.0);
    let mut rig = Emulator::new(params, x_m, load_n).unwrap();
    rig.set_leaks(PerLeak { internal: 2e-12, external_a: 1e-12, external_b: 0.0 }).unwrap();
    let mut all = Vec::new();
    let looks = (0.01 / internal_step_s).round() as u32;
    for sample in 0..1200 {
        for look in 1..=looks {
            let (x_m, load_n) =
                reference(middle_m, (f64::from(sample) + f64::from(look) / f64::from(looks)) * 0.01);
            rig.step_finer(finer, internal_step_s, x_m, load_n).unwrap();
        }
        let now = rig.reading().signals;
        all.push([now.x_m, now.pa_pa, now.pb_pa, now.qa_m3s, now.qb_m3s, now.force_n]);
    }
    all.split_off(100)
}

/// What the steps err by in each channel, in shares of its noise.
fn errors(middle_m: f64, internal_step_s: f64) -> [Vec<f64>; 6] {
    let of = |finer| readings(middle_m, internal_step_s, finer);
    let (fine, coarse) = (of(10), of(1));
    std::array::from_fn(|channel| {
        let one = SHARE * NOISE[channel].1;
        fine.iter().zip(&coarse).map(|(fine, coarse)| (coarse[channel] - fine[channel]) / one).collect()
    })
}

/// A simulation's step, and one that is too long for the oil and has to be divided: with half as many it would err by more.
#[test]
fn the_steps_err_by_less_than_a_hundredth_of_what_sensors_scatter() {
    for internal_step_s in [1e-3, 2e-3] {
        for ((name, _), errors) in NOISE.into_iter().zip(errors(0.1, internal_step_s)) {
            let worst = errors.into_iter().map(f64::abs).fold(0.0, f64::max);
            println!("{internal_step_s} s, {name}: {worst:.1e} of the noise");
            assert!(worst < 0.01, "{internal_step_s} s, {name}: {worst} of the noise");
        }
    }
}

/// Where the piston strikes the stop, chamber A is a thousandth of itself and its pressure leaps: there a sample may be
/// off by more, and few are.
#[test]
fn at_an_end_stop_the_steps_err_as_little_in_the_mean() {
    for ((name, _), errors) in NOISE.into_iter().zip(errors(0.03, 1e-3)) {
        let mean_square = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
        println!("{name}: {:.1e} of the noise", mean_square.sqrt());
        assert!(mean_square.sqrt() < 0.01, "{name}: {} of the noise", mean_square.sqrt());
    }
}

/// With P_A + P_B = P_S both edges drop the same, and the valve fed forward gives just the flows of the speed;
/// metering rounds the root off where it is laminar, by less than a per mille here.
#[test]
fn the_opening_fed_forward_gives_the_speed() {
    let mut axis = EmulatorParams::<f64>::for_model(Model::paper()).unwrap().pitch;
    axis.valve.underlap = 0.0;
    let (supply_pa, cylinder) = (10e6, axis.plant.model.cylinder);
    for pa_pa in [2e6, 5e6, 7e6] {
        let state = axis.plant.state_at(0.1, 0.0, pa_pa, supply_pa - pa_pa);
        for speed_mps in [0.02, -0.02] {
            let spool = axis.opening(axis.plant.pressures_pa(&state), supply_pa, speed_mps);
            let flows = axis.valve.flows(spool, supply_pa, pa_pa, supply_pa - pa_pa);
            let expected = [cylinder.area_a_m2 * speed_mps, -cylinder.area_b_m2 * speed_mps];
            for (flow, expected) in [flows.a_m3s, flows.b_m3s].into_iter().zip(expected) {
                assert!((flow / expected - 1.0).abs() < 1e-3, "{flow} for {expected} m³/s, P_A {pa_pa} Pa");
            }
        }
    }
}
