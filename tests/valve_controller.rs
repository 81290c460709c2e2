//! A calibrated valve on a controller: the core's filter beside the program's maximum likelihood, on the same traces of a plant that
//! shares no code with either, by the same calibration.

use pitchleak::Rig;
use pitchleak::core::{Estimate, Leak, PerLeak, ValveFilter, ValveSample};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::trace::{Record, TraceReader};
use pitchleak::valve::{Calibration, Calibrator, LeaksThen};
use pitchleak_testkit::rig::with_valve;
use pitchleak_testkit::valve::ValveCylinder;
use pitchleak_testkit::{coverage_bounds, white_noise};
use rayon::prelude::*;
use std::io::Cursor;

const WINDS: [f64; 4] = [0.5, 1.0, 1.5, 2.5];
const SECONDS: f64 = 60.0;
/// 1 L/min at 50 bar, m³/(s·Pa).
const UNIT: f64 = 1.0 / 60e3 / 50e5;

/// `PITCHLEAK_RUNS` cylinders in each wind, from `PITCHLEAK_SEED` on.
fn asked(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

fn rig(valve: &str) -> Rig {
    Rig::parse(&with_valve(valve), "valve").expect("a rig")
}

fn reader<'a>(text: &str, rig: &Rig) -> TraceReader<'a> {
    TraceReader::from_stream("valve", Box::new(Cursor::new(text.to_owned())), rig).expect("a trace")
}

fn calibrated(cylinder: &ValveCylinder, rig: &Rig) -> Calibration {
    let mut calibrator = Calibrator::new(rig, LeaksThen::Zero).expect("a valve");
    calibrator.read(&mut reader(&cylinder.trace(300.0, 100.0, 3e-3), rig)).expect("rows");
    calibrator.finish().expect("calibrated")
}

/// A day later, changed as the rig file declares, its zero on its way.
fn later(cylinder: &ValveCylinder) -> ValveCylinder {
    let mut normal = white_noise(90_000 + cylinder.seed);
    let mut walk = |std: f64| std * normal.next().unwrap_or_default();
    let mut later = *cylinder;
    for edge in 0..4 {
        later.valve.gains[edge] *= 1.0 + walk(0.03);
        later.valve.laps[edge] += walk(0.001);
        let clearance_lpm = &mut later.valve.clearances_lpm[edge];
        *clearance_lpm = (*clearance_lpm + walk(0.1 * 0.057)).max(0.0);
    }
    later.valve.null_drift = walk(0.001) * (SECONDS / 600.0).sqrt();
    later.seed += 50_000;
    later
}

fn on_controller(calibration: &Calibration, text: &str, rig: &Rig) -> PerLeak<Estimate<f64>> {
    let (valve, noise) = calibration.for_controller(rig).expect("a valve");
    let mut filter = ValveFilter::new(&rig.cylinder, &rig.fluid, &valve, &noise, 0.5).expect("a filter");
    let (mut reader, mut record) = (reader(text, rig), Record::default());
    while reader.next_record(&mut record).expect("a row") {
        let (sample, valve) = (record.sample, record.valve.expect("a spool"));
        let ps_pa = valve.supply_pa.expect("a supply");
        let sample = ValveSample {
            x_m: sample.x_m,
            pa_pa: sample.pa_pa,
            pb_pa: sample.pb_pa,
            spool: valve.spool,
            ps_pa,
        };
        filter.update(record.step_s(), &sample);
    }
    let found = filter.estimates();
    assert!(found.is_explained, "{found:?}");
    found.leaks_m3spa
}

fn by_program(calibration: &Calibration, text: &str) -> PerLeak<Estimate<f64>> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("valve.toml");
    std::fs::write(&file, calibration.to_toml().expect("a file")).expect("written");
    let rig = rig(&format!("calibration = {:?}", file.display().to_string()));
    let report = replay(&mut reader(text, &rig), &rig, |_, _, _| Ok::<_, ReplayError>(())).expect("a report");
    report.estimates.leaks().map(|one| Estimate { value: one.value, std: one.std.expect("a spread") })
}

#[test]
fn a_controller_finds_leaks_as_well_as_the_program() {
    let (runs, first) = (4 * asked("PITCHLEAK_RUNS", 4), asked("PITCHLEAK_SEED", 40_000));
    let one = |index: u64| {
        let cylinder =
            ValveCylinder { wind: WINDS[(index % 4) as usize], ..ValveCylinder::drawn(first + index) };
        let (sheet, size) = (rig(""), [0.02, 0.0, 0.05][(index / 4 % 3) as usize]);
        let found = calibrated(&cylinder, &sheet);
        let later = later(&cylinder).leaking((index / 12 % 3) as usize, size);
        let text = later.trace(SECONDS, 100.0, 3e-3);
        [on_controller(&found, &text, &sheet), by_program(&found, &text)].map(|found| {
            PerLeak::from_fn(|leak| {
                (found[leak].value / UNIT - later.leaks_lpm[leak as usize], found[leak].std / UNIT)
            })
        })
    };
    let all: Vec<[PerLeak<(f64, f64)>; 2]> = (0..runs).into_par_iter().map(one).collect();
    for leak in Leak::ALL {
        let [[rms, held], [program, of_program]] = [0, 1].map(|which| {
            let of_leak = || all.iter().map(move |both| both[which][leak]);
            let held = of_leak().filter(|(error, std)| error.abs() <= 1.96 * std).count() as f64;
            let square: f64 = of_leak().map(|(error, _)| error * error).sum();
            [(square / runs as f64).sqrt(), held / runs as f64]
        });
        println!(
            "{}: rms {rms:.5} L/min, held {held:.3}; by the program {program:.5}, {of_program:.3}; of {runs}",
            leak.label()
        );
        assert!(held >= coverage_bounds(0.95, runs)[0], "{leak:?}: {held}");
        // So few scatter.
        assert!(rms < 2.0 * program, "{leak:?}: {rms} {program}");
    }
}
