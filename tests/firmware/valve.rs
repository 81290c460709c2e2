//! A calibrated valve on the controller: a minute of a cylinder that leaks inside, as the program calibrated it.

use super::{Renewals, Rig, Run, declared, emulate};
use pitchleak::core::{AlarmSettings, LeakDetector, ValveFilter, ValveSample, ValveUpdate};
use pitchleak::trace::{Record, TraceReader};
use pitchleak::valve::{Calibration, Calibrator, LeaksThen};
use pitchleak_testkit::rig::with_valve;
use pitchleak_testkit::valve::ValveCylinder;
use std::io::Cursor;

/// What controller and host tell of it.
pub fn run() -> (Run, Renewals) {
    let rig = Rig::parse(&with_valve(""), "valve").unwrap();
    let cylinder = ValveCylinder::drawn(1);
    let calibration = calibrated(&cylinder, &rig);
    let leaking = ValveCylinder { seed: 2, ..cylinder }.leaking(0, 0.1);
    let samples = samples(&leaking.trace(60.0, 100.0, 3e-3), &rig);
    let run = emulate("valve", &read(&rig, &calibration, &samples));
    (run, on_host(&rig, &calibration, &samples))
}

fn reader<'a>(text: &str, rig: &Rig) -> TraceReader<'a> {
    TraceReader::from_stream("valve", Box::new(Cursor::new(text.to_owned())), rig).unwrap()
}

fn calibrated(cylinder: &ValveCylinder, rig: &Rig) -> Calibration {
    let mut calibrator = Calibrator::new(rig, LeaksThen::Zero).unwrap();
    calibrator.read(&mut reader(&cylinder.trace(300.0, 100.0, 3e-3), rig)).unwrap();
    calibrator.finish().unwrap()
}

fn samples(text: &str, rig: &Rig) -> Vec<(f64, ValveSample<f64>)> {
    let (mut reader, mut record) = (reader(text, rig), Record::default());
    let next = || {
        reader.next_record(&mut record).unwrap().then(|| {
            let (sample, valve) = (record.sample, record.valve.unwrap());
            let ps_pa = valve.supply_pa.unwrap();
            let sample = ValveSample {
                x_m: sample.x_m,
                pa_pa: sample.pa_pa,
                pb_pa: sample.pb_pa,
                spool: valve.spool,
                ps_pa,
            };
            (record.step_s(), sample)
        })
    };
    std::iter::from_fn(next).collect()
}

/// Spool and supply pressure stand where meters would.
fn read(rig: &Rig, calibration: &Calibration, samples: &[(f64, ValveSample<f64>)]) -> Vec<f64> {
    let (valve, noise) = calibration.for_controller(rig).unwrap();
    let mut numbers = declared(rig, &rig.sensors());
    numbers.extend(valve.mean.iter().chain(&valve.covariance));
    numbers.extend([valve.rated_flow_m3s, valve.rated_drop_pa, valve.tank_pa, valve.hysteresis]);
    numbers.extend([valve.null_leak, valve.gain_drift, valve.lap_drift, valve.null_leak_drift]);
    numbers.extend([noise.position_m, noise.pressure_pa, noise.spool, noise.supply_pa]);
    for (step_s, ValveSample { x_m, pa_pa, pb_pa, spool, ps_pa }) in samples {
        numbers.extend([*step_s, *x_m, *pa_pa, *pb_pa, *spool, *ps_pa, f64::NAN]);
    }
    numbers
}

fn on_host(rig: &Rig, calibration: &Calibration, samples: &[(f64, ValveSample<f64>)]) -> Renewals {
    let (valve, noise) = calibration.for_controller(rig).unwrap();
    let mut filter = ValveFilter::new(&rig.cylinder, &rig.fluid, &valve, &noise, 0.5).unwrap();
    let mut detector = LeakDetector::new(AlarmSettings::default());
    let mut told = Renewals::new();
    for (at, (step_s, sample)) in (1..).zip(samples) {
        let ValveUpdate::Renewed { elapsed_s, .. } = filter.update(*step_s, sample) else { continue };
        let found = filter.estimates();
        if found.is_explained {
            detector.update(elapsed_s, &found.mean_leaks_m3s);
        }
        let (kappa, leaks) = (found.compressibility_per_pa, found.leaks_m3spa);
        let all = [kappa, leaks.internal, leaks.external_a, leaks.external_b];
        told.insert(
            at,
            std::array::from_fn(|k| if k.is_multiple_of(2) { all[k / 2].value } else { all[k / 2].std }),
        );
    }
    told
}
