//! `f32` beside `f64`, over recordings as they are searched for the worst sample: on the host, where there is time for many.

use super::scene::Scene;
use super::{farthest_of, sensors, stands_in_docs, told};
use pitchleak::Rig;
use pitchleak::core::{Cylinder, Fluid, Rls, RlsSettings, Sample, SensorSpread, Sensors, Update};
use pitchleak_testkit::seeded;
use std::fmt::Write as _;

const BEGIN: &str = "<!-- single precision: begin -->\n";
const END: &str = "<!-- single precision: end -->\n";
const HEADER: &str = "\
| estimator | settled, most | unsettled, median | above 0.05 | above 0.5 |
|---|---|---|---|---|
";
const SCENES: usize = 300;
/// So long after a jump or a gap what is told has settled, s.
const SETTLED_S: f64 = 10.0;

/// |f32 − f64| over the standard deviation, of estimates that both renewed after the same sample.
#[derive(Default)]
struct Apart {
    settled: Vec<f64>,
    unsettled: Vec<f64>,
}

#[test]
fn single_precision_tells_what_double_does_but_for_seconds_after_a_jump() {
    let rig = Rig::load("data/traces/rig.toml").unwrap();
    let mut table = String::from(HEADER);
    add_row(&mut table, "N = 4", apart::<4>(&rig, "clocks4"));
    add_row(&mut table, "N = 6", apart::<6>(&rig, "clocks6"));
    add_row(&mut table, "N = 9", apart::<9>(&rig, "clocks9"));
    println!("{table}");
    if let Some(stands) = stands_in_docs([BEGIN, END], &table) {
        assert_eq!(stands, table, "docs/edge.md has another table");
    }
}

fn add_row(table: &mut String, title: &str, Apart { settled, mut unsettled }: Apart) {
    unsettled.sort_by(f64::total_cmp);
    let most = settled.into_iter().fold(0.0, f64::max);
    let above = |limit: f64| {
        let count = unsettled.iter().filter(|apart| **apart > limit).count();
        100.0 * count as f64 / unsettled.len() as f64
    };
    let (median, some, much) = (unsettled[unsettled.len() / 2], above(0.05), above(0.5));
    writeln!(table, "| {title} | {most:.3} | {median:.4} | {some:.1} % | {much:.1} % |").unwrap();
}

fn apart<const N: usize>(rig: &Rig, program: &str) -> Apart {
    let (mut random, mut found) = (seeded(77), Apart::default());
    let sensors = sensors(rig, program);
    let settings = RlsSettings::default();
    for _ in 0..SCENES {
        let scene = Scene::drawn(&mut random);
        let mut double = Rls::<f64, N>::new(rig.cylinder, rig.fluid, &sensors, settings).unwrap();
        let mut single = in_single::<N>(rig, &sensors);
        let (mut jumps, mut since_s) = (0, 0.0);
        for record in scene.records(rig) {
            if record.after_gap || scene.jumps(record.t_s) != jumps {
                (jumps, since_s) = (scene.jumps(record.t_s), record.t_s);
            }
            let of_double = double.update_waiting(record.step_s(), &record.sample);
            let of_single = single.update_waiting(record.step_s() as f32, &sample(&record.sample));
            let both = (of_double, of_single);
            if matches!(both, (Update::Renewed { .. }, Update::Renewed { .. })) {
                let apart = farthest_of(&told(&single), &told(&double));
                let settled = record.t_s - since_s > SETTLED_S;
                if settled { found.settled.push(apart) } else { found.unsettled.push(apart) }
            }
        }
    }
    found
}

/// The estimator of a controller.
fn in_single<const N: usize>(rig: &Rig, sensors: &Sensors<f64>) -> Rls<f32, N> {
    let c = &rig.cylinder;
    let cylinder = Cylinder {
        area_a_m2: c.area_a_m2 as f32,
        area_b_m2: c.area_b_m2 as f32,
        stroke_m: c.stroke_m as f32,
        moving_mass_kg: c.moving_mass_kg as f32,
        dead_volume_a_m3: c.dead_volume_a_m3 as f32,
        dead_volume_b_m3: c.dead_volume_b_m3 as f32,
    };
    let fluid = Fluid {
        bulk_modulus_pa: rig.fluid.bulk_modulus_pa as f32,
        bulk_modulus_std_pa: rig.fluid.bulk_modulus_std_pa as f32,
    };
    let spread = |of: &SensorSpread<f64>| SensorSpread {
        noise_std: of.noise_std as f32,
        bias_std: of.bias_std as f32,
        gain_std: of.gain_std as f32,
        drift_std_ph: of.drift_std_ph as f32,
    };
    let sensors = Sensors {
        flow_a: spread(&sensors.flow_a),
        flow_b: spread(&sensors.flow_b),
        pressure: spread(&sensors.pressure),
        position: spread(&sensors.position),
        force: spread(&sensors.force),
    };
    Rls::new(cylinder, fluid, &sensors, RlsSettings::default()).unwrap()
}

fn sample(read: &Sample<f64>) -> Sample<f32> {
    let single = |reading: Option<f64>| reading.map(|value| value as f32);
    Sample {
        x_m: read.x_m as f32,
        pa_pa: read.pa_pa as f32,
        pb_pa: read.pb_pa as f32,
        qa_m3s: single(read.qa_m3s),
        qb_m3s: single(read.qb_m3s),
        force_n: single(read.force_n),
    }
}
