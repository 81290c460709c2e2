//! A calibrated valve on a controller: the core's filter beside the program's maximum likelihood, on the same traces of a plant that
//! shares no code with either.

use pitchleak::Rig;
use pitchleak::core::{Estimate, Leak, PerLeak, ValveEstimates, ValveFilter, ValveSample, ValveUpdate};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::trace::{Record, TraceReader};
use pitchleak::valve::{Calibration, Calibrator, LeaksThen};
use pitchleak_testkit::rig::with_valve;
use pitchleak_testkit::valve::ValveCylinder;
use rayon::prelude::*;
use std::io::Cursor;

const WINDS: [f64; 4] = [0.5, 1.0, 1.5, 2.5];
const UNIT: f64 = 1.0 / 60e3 / 50e5;

fn runs() -> u64 {
    std::env::var("PITCHLEAK_RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(6)
}

fn first_seed() -> u64 {
    std::env::var("PITCHLEAK_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(40_000)
}

fn rig(valve: &str) -> Rig {
    Rig::parse(&with_valve(valve), "valve").expect("a rig")
}

fn reader<'a>(text: &str, rig: &Rig) -> TraceReader<'a> {
    TraceReader::from_stream("valve", Box::new(Cursor::new(text.to_owned())), rig).expect("a trace")
}

fn calibrated(cylinder: &ValveCylinder, rig: &Rig) -> Calibration {
    let mut calibrator = Calibrator::new(rig, LeaksThen::Zero).expect("a valve");
    let sound = ValveCylinder { leaks_lpm: [0.0; 3], ..*cylinder };
    calibrator.read(&mut reader(&sound.trace(300.0, 100.0, 3e-3), rig)).expect("rows");
    calibrator.finish().expect("calibrated")
}

/// As the valve may be later: drifted as declared.
fn later(cylinder: &ValveCylinder) -> ValveCylinder {
    let mut normal = pitchleak_testkit::white_noise(90_000 + cylinder.seed);
    let mut walk = |std: f64| std * normal.next().unwrap_or_default();
    let mut later = *cylinder;
    let zero = walk(0.001);
    for edge in 0..4 {
        later.valve.gains[edge] *= 1.0 + walk(0.03);
        later.valve.laps[edge] += zero * if edge == 0 || edge == 3 { 1.0 } else { -1.0 };
        let clearance_lpm = &mut later.valve.clearances_lpm[edge];
        *clearance_lpm = (*clearance_lpm + walk(0.1 * 0.057)).max(0.0);
    }
    later.seed += 50_000;
    if let Some(seconds) = std::env::var("SECONDS_").ok().and_then(|s| s.parse::<f64>().ok()) {
        later.valve.null_drift = walk(0.001) * (seconds / 600.0).sqrt();
    }
    later
}

fn filter(calibration: &Calibration, rig: &Rig) -> ValveFilter<f64> {
    let (valve, noise) = calibration.for_controller(rig).expect("a valve");
    ValveFilter::new(&rig.cylinder, &rig.fluid, &valve, &noise, 0.5).expect("a filter")
}

fn feed(
    filter: &mut ValveFilter<f64>,
    text: &str,
    rig: &Rig,
    mut each: impl FnMut(f64, &ValveFilter<f64>, bool),
) {
    let mut reader = reader(text, rig);
    let (mut record, mut last_s) = (Record::default(), f64::NAN);
    while reader.next_record(&mut record).expect("a row") {
        let (sample, valve) = (record.sample, record.valve.expect("a spool"));
        let sample = ValveSample {
            x_m: sample.x_m,
            pa_pa: sample.pa_pa,
            pb_pa: sample.pb_pa,
            spool: valve.spool,
            ps_pa: valve.supply_pa.expect("a supply"),
        };
        let update = filter.update(record.t_s - last_s, &sample);
        last_s = record.t_s;
        if let ValveUpdate::Renewed { changed, .. } = update {
            each(record.t_s, filter, changed);
        }
    }
}

fn spread(name: &str, errors: &[(f64, f64)]) -> (f64, f64) {
    let n = errors.len() as f64;
    let rms = (errors.iter().map(|(error, _)| error * error).sum::<f64>() / n).sqrt();
    let bound = (errors.iter().map(|(_, std)| std * std).sum::<f64>() / n).sqrt();
    let held = errors.iter().filter(|(error, std)| error.abs() <= 1.96 * std).count() as f64 / n;
    let z = (errors.iter().map(|(error, std)| (error / std).powi(2)).sum::<f64>() / n).sqrt();
    println!("{name}: rms {rms:.5} std {bound:.5} held {held:.3} z {z:.2} of {n}");
    (rms, held)
}

#[test]
fn a_calibrated_valve_on_a_controller() {
    for wind in WINDS {
        let one = |seed: u64| {
            let lpm = [0.02, 0.0, 0.05][(seed % 3) as usize];
            let leak = ((seed / 3) % 3) as usize;
            let cylinder = ValveCylinder { wind, ..ValveCylinder::drawn(first_seed() + seed) };
            let sheet = rig("");
            let found = calibrated(&cylinder, &sheet);
            let later = later(&cylinder).leaking(leak, lpm);
            let text = later.trace(60.0, 100.0, 3e-3);
            let mut filter = filter(&found, &sheet);
            let mut changes = 0;
            feed(&mut filter, &text, &sheet, |_, _, changed| changes += u32::from(changed));
            let edge = filter.estimates();
            let folder = tempfile::tempdir().expect("a folder");
            let file = folder.path().join("valve.toml");
            std::fs::write(&file, found.to_toml().expect("a file")).expect("written");
            let rig = rig(&format!("calibration = {:?}", file.display().to_string()));
            let report =
                replay(&mut reader(&text, &rig), &rig, |_, _, _| Ok::<_, ReplayError>(())).expect("a report");
            let host = report
                .estimates
                .leaks()
                .map(|one| Estimate { value: one.value, std: one.std.unwrap_or(f64::NAN) });
            (later.leaks_lpm, edge, host, changes)
        };
        let all: Vec<([f64; 3], ValveEstimates<f64>, PerLeak<Estimate<f64>>, u32)> =
            (0..runs()).into_par_iter().map(one).collect();
        println!("wind {wind}: changes {:?}", all.iter().map(|one| one.3).collect::<Vec<_>>());
        let nis = all.iter().map(|one| one.1.normalised_innovation).sum::<f64>() / all.len() as f64;
        println!(
            "  noise {nis:.3}; explained {} of {}",
            all.iter().filter(|one| one.1.is_explained).count(),
            all.len()
        );
        for leak in Leak::ALL {
            let error =
                |found: Estimate<f64>, true_lpm: f64| (found.value / UNIT - true_lpm, found.std / UNIT);
            let edge: Vec<_> =
                all.iter().map(|one| error(one.1.leaks_m3spa[leak], one.0[leak as usize])).collect();
            let host: Vec<_> = all.iter().map(|one| error(one.2[leak], one.0[leak as usize])).collect();
            spread(&format!("  {leak:?} controller"), &edge);
            spread(&format!("  {leak:?} host      "), &host);
        }
    }
}

/// DUMP
#[test]
fn dump() {
    let Ok(folder) = std::env::var("DUMP") else { return };
    let seconds: f64 = std::env::var("SECONDS_").ok().and_then(|s| s.parse().ok()).unwrap_or(60.0);
    (0..4 * runs()).into_par_iter().for_each(|index| {
        let (wind, seed) = (WINDS[(index % 4) as usize], index / 4);
        let lpm = [0.02, 0.0, 0.05][(seed % 3) as usize];
        let leak = ((seed / 3) % 3) as usize;
        let cylinder = ValveCylinder { wind, ..ValveCylinder::drawn(first_seed() + seed) };
        let sheet = rig("");
        let found = calibrated(&cylinder, &sheet);
        let later = later(&cylinder).leaking(leak, lpm);
        let text = later.trace(seconds, 100.0, 3e-3);
        let (valve, noise) = found.for_controller(&sheet).expect("a valve");
        let mut out: Vec<f64> = Vec::new();
        out.extend(valve.mean);
        out.extend(valve.covariance);
        out.extend([
            valve.rated_flow_m3s,
            valve.rated_drop_pa,
            valve.tank_pa,
            valve.hysteresis,
            valve.gain_drift,
            valve.lap_drift,
            valve.clearance_drift_m3spa,
        ]);
        out.extend([noise.position_m, noise.pressure_pa, noise.spool, noise.supply_pa]);
        let folder_ = tempfile::tempdir().expect("a folder");
        let file = folder_.path().join("valve.toml");
        std::fs::write(&file, found.to_toml().expect("a file")).expect("written");
        let rig = rig(&format!("calibration = {:?}", file.display().to_string()));
        let report =
            replay(&mut reader(&text, &rig), &rig, |_, _, _| Ok::<_, ReplayError>(())).expect("a report");
        let host = report.estimates.leaks();
        out.push(report.valve.as_ref().map_or(0.0, |valve| valve.scatter));
        for leak in Leak::ALL {
            out.extend([
                host[leak].value,
                host[leak].std.unwrap_or(f64::NAN),
                later.leaks_lpm[leak as usize],
            ]);
        }
        let mut rows = reader(&text, &sheet);
        let (mut record, mut last_s) = (Record::default(), f64::NAN);
        while rows.next_record(&mut record).expect("a row") {
            let (sample, valve) = (record.sample, record.valve.expect("a spool"));
            out.extend([
                record.t_s - last_s,
                sample.x_m,
                sample.pa_pa,
                sample.pb_pa,
                valve.spool,
                valve.supply_pa.expect("a supply"),
            ]);
            last_s = record.t_s;
        }
        let bytes: Vec<u8> = out.into_iter().flat_map(f64::to_le_bytes).collect();
        std::fs::write(format!("{folder}/{index:04}.bin"), bytes).expect("written");
    });
}
