//! Leaks by a calibrated valve's flows, sample by sample, against a plant that shares no code with the program.

use pitchleak_core::{
    AlarmSettings, AlarmState, Cylinder, Fluid, Leak, LeakDetector, PerLeak, Real, VALVE_COVARIANCES,
    VALVE_UNKNOWNS, ValveCalibration, ValveError, ValveFilter, ValveNoise, ValveSample, ValveUpdate,
};
use pitchleak_testkit::valve::{TrueValve, ValveCylinder};
use pitchleak_testkit::{coverage_bounds, white_noise};

const WINDS: [f64; 4] = [0.5, 1.0, 1.5, 2.5];
/// 1 L/min at 50 bar, m³/(s·Pa).
const UNIT: f64 = 1.0 / 60e3 / 50e5;
/// What five minutes tell of κ, each gain, lap, of rounding, saturation, tank, lag, each clearance, hysteresis, supply and droop, 1 σ in
/// the units of `valve.toml`.
const CALIBRATED: [(usize, f64); 10] = [
    (1, 0.002),
    (4, 0.001),
    (4, 1.2e-4),
    (1, 2e-4),
    (1, 0.014),
    (1, 0.05),
    (1, 0.12),
    (4, 4e-4),
    (1, 6e-5),
    (1, 0.04),
];
const DROOP_STD_BAR: f64 = 0.15;
const GAIN_DRIFT: f64 = 0.03;
const LAP_DRIFT: f64 = 0.001;
const CLEARANCE_DRIFT_LPM: f64 = 0.1 * 0.057;

/// Cylinders of each wind: six, or `PITCHLEAK_RUNS`; others with `PITCHLEAK_SEED`.
fn asked(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

fn stds() -> [f64; VALVE_UNKNOWNS] {
    let mut stds = [0.0; VALVE_UNKNOWNS];
    let all = CALIBRATED.iter().flat_map(|(count, std)| std::iter::repeat_n(*std, *count));
    stds[3..22].iter_mut().zip(all).for_each(|(place, std)| *place = std);
    stds[22] = DROOP_STD_BAR;
    stds
}

/// As `pitchleak calibrate` would have found this valve, give or take.
fn calibration<T: Real>(cylinder: &ValveCylinder, seed: u64) -> ValveCalibration<T> {
    let TrueValve { gains, laps, rounding, saturation, clearances_lpm, .. } = cylinder.valve;
    let stds = stds();
    let mut mean = [0.0; VALVE_UNKNOWNS];
    mean[3] = 0.8e9 / cylinder.bulk_pa;
    mean[4..8].copy_from_slice(&gains);
    mean[8..12].copy_from_slice(&laps);
    (mean[12], mean[13]) = (rounding, saturation);
    // What the calibration makes of a clearance to a tank of 2 bar, which it sees as one to the outside, at 50 bar.
    let to_outside = 48.0 / 50.0;
    let [pa, at, pb, bt] = clearances_lpm;
    mean[16..20].copy_from_slice(&[pa, to_outside * at, pb, to_outside * bt]);
    let mut normal = white_noise(80_000 + seed);
    mean.iter_mut().zip(stds).for_each(|(mean, std)| *mean += std * normal.next().unwrap_or_default());
    let mut covariance = [T::zero(); VALVE_COVARIANCES];
    for (row, std) in stds.iter().enumerate() {
        covariance[row * (row + 3) / 2] = T::lit(std * std);
    }
    ValveCalibration {
        mean: mean.map(T::lit),
        covariance,
        rated_flow_m3s: T::lit(4.0 / 60e3),
        rated_drop_pa: T::lit(35e5),
        tank_pa: T::lit(2e5),
        hysteresis: T::zero(),
        gain_drift: T::lit(GAIN_DRIFT),
        lap_drift: T::lit(LAP_DRIFT),
        clearance_drift_m3spa: T::lit(CLEARANCE_DRIFT_LPM * UNIT),
    }
}

fn fluid<T: Real>() -> Fluid<T> {
    Fluid { bulk_modulus_pa: T::lit(0.8e9), bulk_modulus_std_pa: T::lit(0.2e9) }
}

fn geometry<T: Real>() -> Cylinder<T> {
    Cylinder {
        area_a_m2: T::lit(12.6e-4),
        area_b_m2: T::lit(9.4e-4),
        stroke_m: T::lit(0.2),
        moving_mass_kg: T::lit(60.0),
        dead_volume_a_m3: T::lit(5e-5),
        dead_volume_b_m3: T::lit(5e-5),
    }
}

/// Sensors of 0.3 %.
fn noise<T: Real>() -> ValveNoise<T> {
    ValveNoise {
        position_m: T::lit(0.2e-3),
        pressure_pa: T::lit(16e3),
        spool: T::lit(1e-3),
        supply_pa: T::lit(16e3),
    }
}

fn filter<T: Real>(calibration: &ValveCalibration<T>) -> ValveFilter<T> {
    ValveFilter::new(&geometry(), &fluid(), calibration, &noise(), T::lit(0.5)).expect("a valve")
}

/// The valve as it is a day later, its zero on its way for the time of the trace.
fn drifted(cylinder: &ValveCylinder, seconds: f64) -> ValveCylinder {
    let mut normal = white_noise(90_000 + cylinder.seed);
    let mut walk = |std: f64| std * normal.next().unwrap_or_default();
    let mut later = *cylinder;
    for edge in 0..4 {
        later.valve.gains[edge] *= 1.0 + walk(GAIN_DRIFT);
        later.valve.laps[edge] += walk(LAP_DRIFT);
        later.valve.clearances_lpm[edge] += walk(CLEARANCE_DRIFT_LPM);
    }
    later.valve.null_drift = walk(LAP_DRIFT) * (seconds / 600.0).sqrt();
    later.bulk_pa /= 1.0 + walk(0.05);
    later.seed += 50_000;
    later
}

/// Step, s, and reading.
fn rows(text: &str) -> Vec<(f64, ValveSample<f64>)> {
    let mut before_s = f64::NAN;
    let row = |line: &str| {
        let numbers: Vec<f64> = line.split(',').filter_map(|cell| cell.parse().ok()).collect();
        let [t_s, x_mm, pa, pb, spool, ps] = numbers.try_into().expect("six numbers");
        let dt_s = t_s - before_s;
        before_s = t_s;
        let sample = ValveSample {
            x_m: 1e-3 * x_mm,
            pa_pa: 1e5 * pa,
            pb_pa: 1e5 * pb,
            spool: 1e-2 * spool,
            ps_pa: 1e5 * ps,
        };
        (dt_s, sample)
    };
    text.lines().skip(1).map(row).collect()
}

fn feed<T: Real>(
    filter: &mut ValveFilter<T>,
    rows: &[(f64, ValveSample<f64>)],
    mut each: impl FnMut(f64, &ValveFilter<T>, bool),
) {
    let mut t_s = 0.0;
    for (dt_s, sample) in rows {
        let ValveSample { x_m, pa_pa, pb_pa, spool, ps_pa } = *sample;
        let lit = T::lit;
        let sample = ValveSample {
            x_m: lit(x_m),
            pa_pa: lit(pa_pa),
            pb_pa: lit(pb_pa),
            spool: lit(spool),
            ps_pa: lit(ps_pa),
        };
        t_s += if dt_s.is_nan() { 0.0 } else { *dt_s };
        if let ValveUpdate::Renewed { changed, .. } = filter.update(lit(*dt_s), &sample) {
            each(t_s, filter, changed);
        }
    }
}

/// What `of` makes of each seed, on all processors.
fn of_all<V: Send>(seeds: u64, of: impl Fn(u64) -> V + Sync) -> Vec<V> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let mut all: Vec<(u64, V)> = std::thread::scope(|scope| {
        let part = |first| {
            let of = &of;
            scope.spawn(move || {
                (first..seeds).step_by(threads as usize).map(|seed| (seed, of(seed))).collect::<Vec<_>>()
            })
        };
        let parts: Vec<_> = (0..threads).map(part).collect();
        parts.into_iter().flat_map(|part| part.join().expect("no panic")).collect()
    });
    all.sort_by_key(|(seed, _)| *seed);
    all.into_iter().map(|(_, value)| value).collect()
}

/// An error and its standard deviation, L/min at 50 bar.
type Error = (f64, f64);

fn rms(values: impl Iterator<Item = f64> + Clone) -> f64 {
    (values.clone().map(|value| value * value).sum::<f64>() / values.count() as f64).sqrt()
}

#[test]
fn intervals_hold_and_are_as_narrow_as_those_of_a_whole_window() {
    let (runs, first) = (asked("PITCHLEAK_RUNS", 6), asked("PITCHLEAK_SEED", 10_000));
    let one = |index: u64| {
        let (wind, seed) = (WINDS[(index % 4) as usize], first + index);
        let leak = (index / 4 % 3) as usize;
        let cylinder = ValveCylinder { wind, ..ValveCylinder::drawn(seed) };
        let later = drifted(&cylinder, 60.0).leaking(leak, [0.02, 0.0, 0.1][(index / 12 % 3) as usize]);
        let mut filter = filter::<f64>(&calibration(&cylinder, seed));
        let mut changes = 0;
        feed(&mut filter, &rows(&later.trace(60.0, 100.0, 3e-3)), |_, _, changed| {
            changes += u32::from(changed)
        });
        let found = filter.estimates();
        let errors = PerLeak::from_fn(|leak| {
            let estimate = found.leaks_m3spa[leak];
            (estimate.value / UNIT - later.leaks_lpm[leak as usize], estimate.std / UNIT)
        });
        (errors, found.is_explained, found.normalised_innovation, changes)
    };
    let all: Vec<(PerLeak<Error>, bool, f64, u32)> = of_all(4 * runs, one);
    let explained = all.iter().filter(|one| one.1).count();
    let noise = all.iter().map(|one| one.2).sum::<f64>() / all.len() as f64;
    println!(
        "explained {explained} of {}; noise {noise:.3}; changes {}",
        all.len(),
        all.iter().map(|one| one.3).sum::<u32>()
    );
    for leak in Leak::ALL {
        let errors: Vec<Error> = all.iter().map(|one| one.0[leak]).collect();
        let held = errors.iter().filter(|(error, std)| error.abs() <= 1.96 * std).count() as f64
            / errors.len() as f64;
        let error = rms(errors.iter().map(|error| error.0));
        let bound = rms(errors.iter().map(|error| error.1));
        let z = errors.iter().map(|(error, std)| error / std).sum::<f64>() / errors.len() as f64;
        for w in 0..4 {
            let e: Vec<_> = errors.iter().enumerate().filter(|(i, _)| i % 4 == w).map(|(_, e)| *e).collect();
            println!(
                "   wind {w} rms {:.5} std {:.5} bias {:.2}",
                rms(e.iter().map(|e| e.0)),
                rms(e.iter().map(|e| e.1)),
                e.iter().map(|e| e.0 / e.1).sum::<f64>() / e.len() as f64
            );
        }
        println!("{}: rms {error:.5}, std {bound:.5}, held {held:.3}, bias {z:.2} std", leak.label());
        assert!(held >= coverage_bounds(0.95, 4 * runs)[0], "{held}");
    }
}

/// Alarms of a trace, raised while the valve explains it.
fn alarms(filter: &mut ValveFilter<f64>, rows: &[(f64, ValveSample<f64>)]) -> (Vec<(f64, Leak)>, [u32; 2]) {
    let mut detector = LeakDetector::new(AlarmSettings::default());
    let (mut raised, mut counts) = (Vec::new(), [0; 2]);
    feed(filter, rows, |t_s, filter, _| {
        let found = filter.estimates();
        counts[usize::from(found.is_explained)] += 1;
        if found.is_explained {
            let changes = detector.update(0.25, &found.mean_leaks_m3s);
            raised.extend(
                changes
                    .iter()
                    .filter(|(_, change)| **change == Some(AlarmState::Raised))
                    .map(|(leak, _)| (t_s, leak)),
            );
        }
    });
    (raised, counts)
}

#[test]
fn what_befalls_a_valve_later_raises_no_alarm() {
    type Flaw = fn(&mut ValveCylinder);
    let flaws: [(&str, Flaw); 7] = [
        ("none", |_| {}),
        ("null drift of 0.5 %", |one| one.valve.null_drift = 0.005),
        ("hysteresis of 1 %", |one| one.valve.hysteresis = 0.01),
        ("supply droops by 3 bar", |one| one.valve.droop_pa = 3e5),
        ("pressure A 10 ms late", |one| one.pressure_lag_s = 0.01),
        ("accumulator at A", |one| one.accumulator_m3pa = 2e-13),
        ("spool 10 ms late", |one| one.valve.spool_lag_s = 0.01),
    ];
    for (name, flaw) in flaws {
        let runs = asked("PITCHLEAK_RUNS", 2);
        let found = of_all(runs, |seed| {
            let cylinder =
                ValveCylinder { wind: WINDS[(seed % 4) as usize], ..ValveCylinder::drawn(25_000 + seed) };
            let mut later = drifted(&cylinder, 240.0);
            flaw(&mut later);
            let mut filter = filter::<f64>(&calibration(&cylinder, seed));
            let (raised, counts) = alarms(&mut filter, &rows(&later.trace(240.0, 100.0, 3e-3)));
            let end = filter.estimates();
            (
                raised,
                counts,
                end.mean_leaks_m3s.map(|one| (one.value * 60e3, one.std * 60e3)),
                end.normalised_innovation,
            )
        });
        for one in &found {
            println!("{name}: {one:?}");
        }
    }
}
