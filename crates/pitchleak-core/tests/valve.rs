//! Leaks by a calibrated valve's flows, sample by sample, against a plant that shares no code with the program.

use pitchleak_core::{
    AlarmSettings, AlarmState, Cylinder, Estimate, Fluid, Leak, LeakDetector, PerLeak, Real,
    VALVE_COVARIANCES, VALVE_UNKNOWNS, ValveCalibration, ValveError, ValveFilter, ValveNoise, ValveSample,
    ValveUpdate,
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
const NULL_LEAK: f64 = 0.02;
const NULL_LEAK_DRIFT: f64 = 0.1;
/// Of half the leakage of 4 L/min at 35 bar, at 50 bar.
const CLEARANCE_DRIFT_LPM: f64 = NULL_LEAK_DRIFT * 0.5 * NULL_LEAK * 4.0 * 50.0 / 35.0;

/// What the environment asks for, else as usual: `PITCHLEAK_RUNS` cylinders of each kind, from `PITCHLEAK_SEED` on.
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
        null_leak: T::lit(NULL_LEAK),
        gain_drift: T::lit(GAIN_DRIFT),
        lap_drift: T::lit(LAP_DRIFT),
        null_leak_drift: T::lit(NULL_LEAK_DRIFT),
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
    let of = &of;
    std::thread::scope(|scope| {
        let part = |first: u64| {
            scope.spawn(move || (first..seeds).step_by(threads as usize).map(of).collect::<Vec<_>>())
        };
        let parts: Vec<_> = (0..threads).map(part).collect();
        parts.into_iter().flat_map(|part| part.join().expect("no panic")).collect()
    })
}

/// Error and standard deviation of each leak at the end of a trace, L/min at 50 bar, …
type Errors = PerLeak<(f64, f64)>;

fn errors<T: Real>(filter: &ValveFilter<T>, leaks_lpm: [f64; 3]) -> Errors {
    let found = filter.estimates().leaks_m3spa;
    PerLeak::from_fn(|leak| {
        let Estimate { value, std } = found[leak];
        (value.as_f64() / UNIT - leaks_lpm[leak as usize], std.as_f64() / UNIT)
    })
}

fn rms(values: impl Iterator<Item = f64> + Clone) -> f64 {
    (values.clone().map(|value| value * value).sum::<f64>() / values.count() as f64).sqrt()
}

/// … of cylinders in four winds that leak in any way, or not, a day after their calibration.
#[test]
fn intervals_of_a_minute_hold_and_are_narrow() {
    let (runs, first) = (asked("PITCHLEAK_RUNS", 6), asked("PITCHLEAK_SEED", 10_000));
    let one = |index: u64| {
        let (wind, seed) = (WINDS[(index % 4) as usize], first + index);
        let (leak, size) = ((index / 4 % 3) as usize, [0.02, 0.0, 0.1][(index / 12 % 3) as usize]);
        let cylinder = ValveCylinder { wind, ..ValveCylinder::drawn(seed) };
        let later = drifted(&cylinder, 60.0).leaking(leak, size);
        let mut filter = filter::<f64>(&calibration(&cylinder, seed));
        let mut changes = 0;
        feed(&mut filter, &rows(&later.trace(60.0, 100.0, 3e-3)), |_, _, changed| {
            changes += u32::from(changed);
        });
        let found = filter.estimates();
        assert!(found.is_explained && changes == 0, "{seed}: {found:?}");
        (errors(&filter, later.leaks_lpm), found.normalised_innovation)
    };
    let all: Vec<(Errors, f64)> = of_all(4 * runs, one);
    let noise = all.iter().map(|one| one.1).sum::<f64>() / all.len() as f64;
    // A little below 1: the zero of this valve walks less evenly than is declared.
    assert!((0.85..1.05).contains(&noise), "{noise}");
    for (leak, most) in [(Leak::Internal, 0.0025), (Leak::ExternalA, 0.009), (Leak::ExternalB, 0.009)] {
        let of_leak = || all.iter().map(move |one| one.0[leak]);
        let held =
            of_leak().filter(|(error, std)| error.abs() <= 1.96 * std).count() as f64 / all.len() as f64;
        let [error, bound] = [rms(of_leak().map(|one| one.0)), rms(of_leak().map(|one| one.1))];
        println!("{}: rms {error:.5} of {bound:.5} L/min, held {held:.3} of {}", leak.label(), all.len());
        assert!(held >= coverage_bounds(0.95, 4 * runs)[0] && error < most, "{leak:?}: {held} {error}");
    }
}

/// A leak that sets in is told as it is, the change of an external one far better than what the clearance may have become.
#[test]
fn a_leak_that_sets_in_is_told_within_a_minute() {
    for (leak, size, within) in
        [(Leak::Internal, 0.05, 0.005), (Leak::ExternalA, 0.02, 0.003), (Leak::ExternalB, 0.5, 0.005)]
    {
        let found = of_all(asked("PITCHLEAK_RUNS", 4), |seed| {
            let cylinder = ValveCylinder::drawn(300 + seed);
            let mut later = drifted(&cylinder, 180.0).leaking(leak as usize, size);
            // At any moment of the five seconds that are judged together.
            later.leaks_from_s = 93.0 + 0.45 * seed as f64;
            let mut filter = filter::<f64>(&calibration(&cylinder, seed));
            let (mut before, mut changes) = (0.0, Vec::new());
            feed(&mut filter, &rows(&later.trace(160.0, 100.0, 3e-3)), |t_s, filter, changed| {
                if t_s < later.leaks_from_s {
                    before = filter.estimates().leaks_m3spa[leak].value;
                }
                changes.extend(changed.then_some(t_s - later.leaks_from_s));
            });
            let found = filter.estimates();
            assert!(found.is_explained, "{found:?}");
            ((found.leaks_m3spa[leak].value - before) / UNIT, changes)
        });
        println!("{} of {size} L/min: {found:.4?}", leak.label());
        for (change, after_s) in found {
            assert!((change - size).abs() < within, "{leak:?}: {change} of {size}");
            assert!(matches!(after_s[..], [after_s] if (0.0..30.0).contains(&after_s)), "{after_s:?}");
        }
    }
}

/// Alarms of a trace, raised while the valve explains it, and how often it did of all renewals.
fn alarms(filter: &mut ValveFilter<f64>, rows: &[(f64, ValveSample<f64>)]) -> (Vec<(f64, Leak)>, [u32; 2]) {
    let mut detector = LeakDetector::new(AlarmSettings::default());
    let (mut raised, mut explained) = (Vec::new(), [0; 2]);
    feed(filter, rows, |t_s, filter, _| {
        let found = filter.estimates();
        explained[1] += 1;
        if found.is_explained {
            explained[0] += 1;
            let changes = detector.update(0.25, &found.mean_leaks_m3s);
            let is_raised = |change: &Option<AlarmState>| *change == Some(AlarmState::Raised);
            raised
                .extend(changes.iter().filter(|(_, change)| is_raised(change)).map(|(leak, _)| (t_s, leak)));
        }
    });
    (raised, explained)
}

#[test]
fn a_leak_that_sets_in_raises_its_alarm_and_no_other() {
    // At 50 bar; P_L is a fifth of that.
    for (leak, size) in [(Leak::Internal, 2.0), (Leak::ExternalA, 0.6), (Leak::ExternalB, 0.6)] {
        let found = of_all(asked("PITCHLEAK_RUNS", 2), |seed| {
            let cylinder = ValveCylinder::drawn(20_000 + seed);
            let mut later = drifted(&cylinder, 180.0).leaking(leak as usize, size);
            later.leaks_from_s = 103.0;
            let mut filter = filter::<f64>(&calibration(&cylinder, seed));
            alarms(&mut filter, &rows(&later.trace(180.0, 100.0, 3e-3))).0
        });
        println!("{} of {size} L/min after 103 s: {found:?}", leak.label());
        for raised in found {
            let is_its_own =
                matches!(raised[..], [(t_s, own)] if own == leak && (103.0..143.0).contains(&t_s));
            assert!(is_its_own, "{leak:?}: {raised:?}");
        }
    }
}

#[test]
fn what_befalls_a_valve_later_raises_no_alarm() {
    type Flaw = fn(&mut ValveCylinder);
    // Whether it is explained for most of the time, or never; where cylinders differ, neither.
    let flaws: [(&str, Option<bool>, Flaw); 7] = [
        ("drift as declared", Some(true), |_| {}),
        ("null drift of 0.5 %", Some(true), |one| one.valve.null_drift = 0.005),
        ("supply droops by 3 bar", Some(true), |one| one.valve.droop_pa = 3e5),
        ("pressure A 10 ms late", None, |one| one.pressure_lag_s = 0.01),
        ("spool 10 ms late", None, |one| one.valve.spool_lag_s = 0.01),
        ("hysteresis of 1 %", None, |one| one.valve.hysteresis = 0.01),
        ("accumulator at A", Some(false), |one| one.accumulator_m3pa = 2e-13),
    ];
    for (name, is_explained, flaw) in flaws {
        let found = of_all(asked("PITCHLEAK_RUNS", 2), |seed| {
            let wind = WINDS[(seed % 4) as usize];
            let cylinder = ValveCylinder { wind, ..ValveCylinder::drawn(25_000 + seed) };
            let mut later = drifted(&cylinder, 180.0);
            flaw(&mut later);
            let mut filter = filter::<f64>(&calibration(&cylinder, seed));
            alarms(&mut filter, &rows(&later.trace(180.0, 100.0, 3e-3)))
        });
        println!("{name}: {found:?}");
        for (raised, [explained, renewals]) in found {
            assert!(raised.is_empty(), "{name}: {raised:?}");
            let is_right = match is_explained {
                Some(true) => explained * 2 > renewals,
                Some(false) => explained == 0,
                None => true,
            };
            assert!(is_right, "{name}: {explained} of {renewals}");
        }
    }
}

#[test]
fn single_precision_tells_what_double_does_in_three_kilobytes() {
    assert!(size_of::<ValveFilter<f32>>() + size_of::<LeakDetector<f32>>() <= 3072);
    let cylinder = ValveCylinder::drawn(7).leaking(0, 0.3);
    let rows = rows(&drifted(&cylinder, 60.0).trace(60.0, 100.0, 3e-3));
    let mut single = filter::<f32>(&calibration(&cylinder, 7));
    let mut double = filter::<f64>(&calibration(&cylinder, 7));
    feed(&mut single, &rows, |_, _, _| {});
    feed(&mut double, &rows, |_, _, _| {});
    let [single, double] = [errors(&single, [0.0; 3]), errors(&double, [0.0; 3])];
    for (leak, (value, std)) in double {
        assert!((single[leak].0 - value).abs() < 0.01 * std, "{leak:?}: {single:?} {double:?}");
    }
}

/// A pause, a reading that is none, and one that no cylinder gives.
#[test]
fn gaps_and_nonsense_are_left_out() {
    let cylinder = ValveCylinder::drawn(8).leaking(1, 0.1);
    let mut rows = rows(&cylinder.trace(120.0, 100.0, 3e-3));
    rows[5000].0 = 900.0;
    let mut filter = filter::<f64>(&calibration(&cylinder, 8));
    let nonsense = [
        ValveSample { pa_pa: f64::NAN, ..rows[0].1 },
        ValveSample { spool: 3.0, ..rows[0].1 },
        ValveSample { ps_pa: f64::INFINITY, ..rows[0].1 },
        ValveSample { x_m: 1.0, ..rows[0].1 },
    ];
    assert!(nonsense.iter().all(|one| filter.update(0.01, one) == ValveUpdate::Rejected));
    feed(&mut filter, &rows[..5000], |_, _, _| {});
    assert_eq!(filter.update(rows[5000].0, &rows[5000].1), ValveUpdate::Started);
    feed(&mut filter, &rows[5001..], |_, _, changed| assert!(!changed));
    for (leak, (error, std)) in errors(&filter, cylinder.leaks_lpm) {
        assert!(error.abs() < 4.0 * std && std < 0.01, "{leak:?}: {error} {std}");
    }
    // A day in which nothing was read: the valve is as uncertain as a day after its calibration.
    let [before, after] = [1.0, 86_400.0].map(|gap_s| {
        let mut later = filter;
        assert_eq!(later.update(gap_s, &rows[0].1), ValveUpdate::Started);
        errors(&later, [0.0; 3]).external_a.1
    });
    assert!(after > 1.2 * before, "{before} {after}");
}

#[test]
fn what_cannot_be_is_refused() {
    let sound = calibration::<f64>(&ValveCylinder::drawn(9), 9);
    let new = |calibration: &ValveCalibration<f64>, noise: &ValveNoise<f64>, max_step_s: f64| {
        ValveFilter::new(&geometry(), &fluid(), calibration, noise, max_step_s).err()
    };
    assert_eq!(new(&sound, &noise(), 0.5), None);
    let mut broken = sound;
    broken.covariance[7] = f64::NAN;
    assert_eq!(new(&broken, &noise(), 0.5), Some(ValveError::Calibration));
    let no_drop = ValveCalibration { rated_drop_pa: 0.0, ..sound };
    assert_eq!(new(&no_drop, &noise(), 0.5), Some(ValveError::Calibration));
    assert_eq!(new(&sound, &ValveNoise { spool: 0.0, ..noise() }, 0.5), Some(ValveError::Noise));
    assert_eq!(new(&sound, &noise(), f64::NAN), Some(ValveError::Noise));
}
