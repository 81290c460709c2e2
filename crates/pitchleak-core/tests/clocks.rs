//! Channels on clocks of their own: a flow of 10 Hz beside a position of 100 Hz is no special case, and what is told of the
//! leaks is as uncertain as the readings that there are.

use pitchleak_core::continuity::{PerChannel, Readings};
use pitchleak_core::{Cylinder, Fluid, PerLeak, Rls, RlsSettings, Sample, Sensors, Update};
use pitchleak_testkit::{Motion, white_noise};

const LEAKS: PerLeak<f64> = PerLeak { internal: 8e-12, external_a: 3e-12, external_b: 1e-12 };
const SECONDS: u32 = 60;
/// The bounds below were chosen on seeds 0 to 39.
const SEEDS: core::ops::Range<u64> = 200..240;

/// Noisy readings of every channel at 100 Hz.
fn noisy(seed: u64) -> Vec<Sample<f64>> {
    let sensors = Sensors::<f64>::paper();
    let mut noise = white_noise(seed);
    let mut next = |std: f64| std * noise.next().expect("no end");
    let samples = Motion::wind_like(LEAKS).samples(SECONDS);
    let read = |s: &Sample<f64>| Sample {
        x_m: s.x_m + next(sensors.position.noise_std),
        pa_pa: s.pa_pa + next(sensors.pressure.noise_std),
        pb_pa: s.pb_pa + next(sensors.pressure.noise_std),
        qa_m3s: s.qa_m3s.map(|q| q + next(sensors.flow_a.noise_std)),
        qb_m3s: s.qb_m3s.map(|q| q + next(sensors.flow_b.noise_std)),
        force_n: None,
    };
    samples.iter().map(read).collect()
}

fn new() -> Rls<f64, 4> {
    Rls::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), RlsSettings::default())
        .expect("a rig that can be")
}

/// Estimates from these rows, where of every channel `lost` of the readings are missing and the flows come with every
/// `every`th row, that of B `later` rows after that of A.
fn estimate(samples: &[Sample<f64>], every: usize, later: usize, lost: f64, seed: u64) -> Rls<f64, 4> {
    let mut rls = new();
    // A standard normal number is below this in a tenth of all cases.
    let mut dice = white_noise(seed + 1_000_000);
    let mut there = || lost <= 0.0 || dice.next().expect("no end") > -1.2816;
    for (k, sample) in samples.iter().enumerate() {
        let Readings { x, pa, pb, qa, qb } = Readings::from(sample);
        let mut keep = |reading: Option<f64>| reading.filter(|_| there());
        let row = PerChannel {
            x: keep(x),
            pa: keep(pa),
            pb: keep(pb),
            qa: keep(qa).filter(|_| k % every == 0),
            qb: keep(qb).filter(|_| k % every == later),
        };
        rls.update_readings(0.01, &row);
    }
    rls
}

struct Scatter {
    /// Root mean square error and mean declared standard deviation of each leak, m³/(s·Pa).
    rms: [f64; 3],
    std: [f64; 3],
    /// Share of 95 % intervals that hold the truth, and how many there were.
    coverage: f64,
    count: usize,
}

fn scatter(every: usize, later: usize, lost: f64) -> Scatter {
    let truth = [LEAKS.internal, LEAKS.external_a, LEAKS.external_b];
    let (mut square, mut std, mut held) = ([0.0; 3], [0.0; 3], 0);
    for seed in SEEDS {
        let rls = estimate(&noisy(seed), every, later, lost, seed);
        for (i, (_, found)) in rls.leak_coefficients().into_iter().enumerate() {
            let error = found.value - truth[i];
            square[i] += error * error / SEEDS.count() as f64;
            std[i] += found.std / SEEDS.count() as f64;
            held += usize::from(error.abs() <= found.half_width95());
        }
    }
    let count = 3 * SEEDS.count();
    Scatter { rms: square.map(f64::sqrt), std, coverage: held as f64 / count as f64, count }
}

/// Flows at 100, 50, 20 and 10 Hz, and every tenth reading of every channel lost: intervals hold the truth as often as they say.
/// The flows' noise is white from reading to reading, so a tenth of them tells of a leak up to √10 times less exactly. A straight
/// line across a lost reading costs a fifth of what the others tell: E g² / E g of its steps g is 1.22 of theirs; and with it go a
/// tenth of the positions, 1.22/0.9 in all.
#[test]
fn leaks_are_as_uncertain_as_the_readings_that_there_are() {
    let full = scatter(1, 0, 0.0);
    for (every, later, lost) in
        [(1, 0, 0.0), (1, 0, 0.1), (2, 0, 0.1), (5, 0, 0.1), (10, 0, 0.0), (10, 0, 0.1), (10, 5, 0.1)]
    {
        let Scatter { rms, std, coverage, count } = scatter(every, later, lost);
        let of_full = |of: &[f64; 3], full: &[f64; 3]| [0, 1, 2].map(|i| of[i] / full[i]);
        let (by_rms, by_std) = (of_full(&rms, &full.rms), of_full(&std, &full.std));
        println!(
            "flows with every {every}. row, B {later} later, {lost} lost: rms × {by_rms:.2?}, std × {by_std:.2?}, \
             coverage {coverage:.3} of {count}"
        );
        // 95 % of 120 intervals, which share their noise by threes, less three standard deviations.
        assert!(coverage >= 0.95 - 3.0 * (0.05 * 0.95 / 40.0_f64).sqrt(), "{coverage}");
        let fewer = every as f64 * if lost > 0.0 { 1.22 / 0.9 } else { 1.0 };
        assert!(by_std.iter().all(|ratio| *ratio <= fewer.sqrt()), "{by_std:?}");
        // A ratio of two root mean squares of 40 errors each scatters by a sixth.
        let scatter: f64 = by_rms.iter().zip(by_std).map(|(rms, std)| rms / std).sum::<f64>() / 3.0;
        assert!((scatter - 1.0).abs() < 0.3, "{by_rms:?} for {by_std:?}");
    }
}

/// Rows that lack nothing are taken in as samples, to the last bit; and a row of nonsense is left out.
#[test]
fn whole_rows_are_samples() {
    let (mut by_rows, mut by_samples) = (new(), new());
    for sample in noisy(1) {
        let row = Readings::from(&sample);
        assert_eq!(by_rows.update_readings(0.01, &row), by_samples.update(0.01, &sample));
        let wild = Readings { pb: Some(f64::NAN), x: None, ..row };
        assert_eq!(by_rows.update_readings(0.01, &wild), Update::Rejected);
    }
    assert_eq!(by_rows.estimates(), by_samples.estimates());
}

/// While a pressure is missing for long nothing is learnt, and afterwards all goes on.
#[test]
fn without_a_pressure_nothing_is_learnt() {
    let mut rls = new();
    let mut ends = Vec::new();
    for (k, sample) in noisy(2).iter().enumerate() {
        let row = Readings::from(sample);
        let there = !(2000..4000).contains(&k);
        let update = rls.update_readings(0.01, &Readings { pb: row.pb.filter(|_| there), ..row });
        if matches!(update, Update::Started) {
            ends.push(k);
        }
        // The pressure is waited for while it may yet come.
        if (2010..4000).contains(&k) {
            assert_eq!(update, Update::Accepted, "row {k}");
        }
    }
    assert_eq!(ends, [0, 4000]);
    for (leak, found) in rls.leak_coefficients() {
        assert!((found.value - LEAKS[leak]).abs() < 4.0 * found.std, "{leak:?}: {found:?}");
    }
}

/// A position between two readings is none: what the sensor reads is as far from what the flows say as its noise, ten times as
/// rarely or not.
#[test]
fn a_position_between_readings_is_no_reading() {
    for every in [1, 10] {
        let mut rls = new();
        for (k, sample) in noisy(3).iter().enumerate() {
            let row = Readings::from(sample);
            rls.update_readings(0.01, &Readings { x: row.x.filter(|_| k % every == 0), ..row });
        }
        let [_, position] = rls.normalised_innovation();
        println!("position with every {every}. row: {position:.3}");
        assert!((position - 1.0).abs() < 0.15, "{position}");
    }
}

/// Who waits for a flow and then reads all at once by [`Rls::update`] begins anew: nothing is integrated over what waited.
#[test]
fn a_sample_that_does_not_wait_forgets_those_that_do() {
    let samples = noisy(SEEDS.start);
    let mut rls = new();
    for sample in &samples[..500] {
        rls.update_readings(0.01, &Readings::from(sample));
    }
    let told = |update: Update<f64>| core::mem::discriminant(&update);
    let waits = Readings { qa: None, ..Readings::from(&samples[500]) };
    assert_eq!(told(rls.update_readings(0.01, &waits)), told(Update::Accepted));
    assert_eq!(told(rls.update(0.01, &samples[501])), told(Update::Started));
    assert_ne!(told(rls.update(0.01, &samples[502])), told(Update::Started));
}

/// A flow that rests by [`Rls::update`] tells nothing over the steps beside it; the leak is found all the same, if less exactly.
#[test]
fn a_flow_may_rest_for_a_sample() {
    let (mut all, mut some) = (new(), new());
    for (k, sample) in noisy(SEEDS.start).iter().enumerate() {
        all.update(0.01, sample);
        let qa_m3s = sample.qa_m3s.filter(|_| k % 10 > 0);
        let qb_m3s = sample.qb_m3s.filter(|_| k % 25 > 0);
        some.update(0.01, &Sample { qa_m3s, qb_m3s, ..*sample });
    }
    for ((name, whole), (_, found)) in all.leak_coefficients().into_iter().zip(some.leak_coefficients()) {
        let apart = (found.value - whole.value) / found.std;
        assert!(apart.abs() < 3.0 && found.std < 4.0 * whole.std, "{name:?}: {found:?} {whole:?}");
    }
}
