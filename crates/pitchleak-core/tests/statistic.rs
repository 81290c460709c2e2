//! Laws of the sufficient statistic: whitened noise is white, its products are foretold in closed form, segments add.

use pitchleak_core::continuity::{COLUMNS, ContinuityStatistic, EQUATIONS, RawSum, column};
use pitchleak_core::{Cylinder, Fluid, Sample, Sensors};
use pitchleak_testkit::{noisy, seeded};

const STEP_S: f64 = 0.01;

fn cylinder() -> Cylinder<f64> {
    Cylinder { dead_volume_a_m3: 5e-5, dead_volume_b_m3: 3e-5, ..Cylinder::paper() }
}

/// A cylinder at rest as these sensors would read it, noise and all.
fn at_rest(seed: u64, rows: usize) -> Vec<Sample<f64>> {
    let still =
        Sample { x_m: 0.07, pa_pa: 5e6, pb_pa: 3e6, qa_m3s: Some(0.0), qb_m3s: Some(0.0), force_n: None };
    let mut rng = seeded(seed);
    (0..rows).map(|_| noisy(&still, &Sensors::paper(), &mut rng)).collect()
}

fn statistic<const S: usize>(samples: &[Sample<f64>]) -> Box<ContinuityStatistic<f64, S>> {
    let mut statistic = Box::new(ContinuityStatistic::new(&cylinder(), &Fluid::paper(), &Sensors::paper()));
    for (index, sample) in samples.iter().enumerate() {
        statistic.push(if index == 0 { 0.0 } else { STEP_S }, sample);
    }
    statistic.close();
    statistic
}

/// y'y of the declared equations, and its rows.
fn left_side(statistic: &ContinuityStatistic<f64, 12>, equation: usize) -> (f64, f64) {
    let columns = [column(RawSum::ResidualA, 0), column(RawSum::ResidualB, 1)];
    let pairs = || columns.into_iter().flat_map(|i| columns.map(|j| (i, j)));
    let square = pairs()
        .map(|(i, j)| statistic.segments().iter().map(|s| s.product(equation, i, j)).sum::<f64>())
        .sum();
    let rows = statistic.segments().iter().map(|s| s.rows(equation)).sum();
    (square, rows)
}

#[test]
fn whitened_noise_is_of_unit_variance() {
    let (mut square, mut rows) = ([0.0; EQUATIONS], [0.0; EQUATIONS]);
    for seed in 0..20 {
        let statistic = statistic::<12>(&at_rest(seed, 3000));
        for equation in 0..EQUATIONS {
            let (s, n) = left_side(&statistic, equation);
            square[equation] += s;
            rows[equation] += n;
        }
    }
    for equation in 0..EQUATIONS {
        let std = (2.0 / rows[equation]).sqrt();
        let variance = square[equation] / rows[equation];
        assert!((variance - 1.0).abs() < 4.0 * std, "{equation} {variance} {std}");
    }
}

/// What noise adds to the products of columns is what the recursion foretells, per unit of each sensor's noise.
#[test]
fn noise_of_columns_is_foretold() {
    let sensors = Sensors::<f64>::paper();
    // The first of a pair of volumes: V_A² is the fourth product.
    let cases = [
        (RawSum::Travel, sensors.position.noise_std, 0),
        (RawSum::StorageA, 1e-6 * sensors.pressure.noise_std, 3),
    ];
    for (raw, std, power) in cases {
        for equation in 0..EQUATIONS {
            let (mut found, mut foretold) = (0.0, 0.0);
            for seed in 0..20 {
                for segment in statistic::<12>(&at_rest(100 + seed, 3000)).segments() {
                    found += segment.product(equation, column(raw, 0), column(raw, 0));
                    foretold += std * std * segment.end_noise(equation)[power][0];
                }
            }
            assert!((found / foretold - 1.0).abs() < 0.06, "{raw:?} {equation} {found} {foretold}");
        }
    }
}

/// One segment of the whole is the sum of its parts, moments in time included, but for noise that begins anew at a border.
#[test]
fn segments_add() {
    let samples = at_rest(7, 6000);
    let (few, many) = (statistic::<2>(&samples), statistic::<40>(&samples));
    assert_eq!((few.segments().len(), many.segments().len()), (2, 15));
    for equation in 0..EQUATIONS {
        for i in 0..COLUMNS {
            let total = |products: Vec<f64>| products.iter().sum::<f64>();
            let one = total(few.segments().iter().map(|s| s.product(equation, i, i)).collect());
            let is_aged = i % (COLUMNS / 2) >= RawSum::AgedPressureA as usize;
            if !is_aged {
                let other = total(many.segments().iter().map(|s| s.product(equation, i, i)).collect());
                assert!((one - other).abs() <= 1e-9 * one.abs(), "{equation} {i} {one} {other}");
            }
        }
    }
    // ∫t dt over a segment of length T is T²/2.
    for segment in few.segments() {
        let (time, aged) = (column(RawSum::Time, 0), column(RawSum::AgedTime, 0));
        let mean = segment.product(0, aged, time) / segment.product(0, time, time);
        assert!((mean / (0.5 * segment.time_s()) - 1.0).abs() < 0.05, "{mean} {}", segment.time_s());
    }
}

/// Where a flow is missing only its equation rests.
#[test]
fn a_missing_flow_rests() {
    let mut samples = at_rest(9, 3000);
    for sample in &mut samples[1000..2000] {
        sample.qb_m3s = None;
    }
    let statistic = statistic::<12>(&samples);
    let rows = |equation: usize| statistic.segments().iter().map(|s| s.rows(equation)).sum::<f64>();
    assert!((rows(0) - 79.0).abs() < 4.0, "{}", rows(0));
    assert!((rows(1) - 119.0).abs() < 4.0, "{}", rows(1));
}

/// When segments end, s.
fn ends_s(samples: &[Sample<f64>]) -> Vec<f64> {
    let mut end_s = 0.0;
    let mut ends = vec![end_s];
    for segment in statistic::<12>(samples).segments() {
        end_s += segment.time_s();
        ends.push(end_s);
    }
    ends
}

/// A leak that opens at once ends a segment there, whatever time that is; noise alone ends none.
#[test]
fn a_sudden_leak_ends_a_segment() {
    for (seed, onset) in [(11, 1015), (12, 1377), (13, 2000)] {
        let mut samples = at_rest(seed, 3000);
        for sample in &mut samples[onset..] {
            sample.qa_m3s = sample.qa_m3s.map(|q| q + 0.5 / 60e3);
        }
        let ends = ends_s(&samples);
        let onset_s = STEP_S * onset as f64;
        assert!(ends.iter().any(|end| (end - onset_s).abs() < 0.6), "{onset_s} {ends:?}");
        // The block left out is time all the same.
        assert!((ends.last().unwrap() - 29.75).abs() < 0.3, "{ends:?}");
        let calm = statistic::<12>(&at_rest(seed, 3000));
        let usual = calm.segments().iter().filter(|segment| (segment.time_s() / 4.0).fract() < 0.01).count();
        assert!(usual + 1 >= calm.segments().len(), "{usual}");
    }
}

/// A leak takes away the pressure that drives it, and is fed by what was stored: no falling pressure hides the block in which it opened,
/// and no long trace the border there.
#[test]
fn a_leak_that_takes_its_own_pressure_ends_a_segment_where_it_opens() {
    const FALLS_IN_S: f64 = 0.08;
    let (cylinder, fluid) = (cylinder(), Fluid::<f64>::paper());
    let by_volume = |x_m: f64| {
        let [a, b] = [cylinder.area_a_m2 * x_m, cylinder.area_b_m2 * (cylinder.stroke_m - x_m)];
        [cylinder.dead_volume_a_m3 + a, cylinder.dead_volume_b_m3 + b].map(|v| v / fluid.bulk_modulus_pa)
    };
    for seed in 21..33 {
        let mut samples = at_rest(seed, 6000);
        let [stored_a, stored_b] = by_volume(0.07);
        for (k, sample) in samples[3050..].iter_mut().enumerate() {
            let left = (-STEP_S * k as f64 / FALLS_IN_S).exp();
            let fall = [1.5e6, 1.6e6];
            let rate = fall.map(|fall| -fall * left / FALLS_IN_S);
            sample.pa_pa -= fall[0] * (1.0 - left);
            sample.pb_pa -= fall[1] * (1.0 - left);
            let leak = 0.2 / 60e3 * (3e6 - fall[1] * (1.0 - left)) / 1.4e6;
            sample.qa_m3s = sample.qa_m3s.map(|q| q + stored_a * rate[0]);
            sample.qb_m3s = sample.qb_m3s.map(|q| q + stored_b * rate[1] + leak);
        }
        let ends = ends_s(&samples);
        assert!(ends.iter().any(|end| (30.24..30.76).contains(end)), "{seed}: {ends:?}");
    }
}

/// However few segments there are, neighbours that differ stay apart.
#[test]
fn the_border_where_a_leak_opened_outlasts_a_long_trace() {
    let mut samples = at_rest(41, 12_000);
    for sample in &mut samples[3000..] {
        sample.qa_m3s = sample.qa_m3s.map(|q| q + 0.5 / 60e3);
    }
    let statistic = statistic::<4>(&samples);
    let lengths_s: Vec<f64> = statistic.segments().iter().map(|segment| segment.time_s()).collect();
    let ends_s = || (1..=lengths_s.len()).map(|count| lengths_s[..count].iter().sum::<f64>());
    assert!(ends_s().any(|end_s| (end_s - 30.0).abs() < 0.6), "{lengths_s:?}");
    assert!(ends_s().any(|end_s| (end_s - 119.9).abs() < 0.3), "{lengths_s:?}");
}

/// A stream forgets what is longer ago than its horizon once its place is needed, and no sooner.
#[test]
fn a_stream_forgets_what_lies_before_its_horizon() {
    for (horizon_s, kept_s) in [(10.0, 16.0), (1000.0, 60.0)] {
        let new = ContinuityStatistic::<f64, 4>::new(&cylinder(), &Fluid::paper(), &Sensors::paper());
        let mut statistic = new.forgetting(horizon_s);
        for (index, sample) in at_rest(43, 6000).iter().enumerate() {
            statistic.push(if index == 0 { 0.0 } else { STEP_S }, sample);
        }
        statistic.close();
        let found_s: f64 = statistic.segments().iter().map(|segment| segment.time_s()).sum();
        assert!((found_s - kept_s).abs() < 4.0, "{horizon_s}: {found_s}");
    }
}

/// Each goes on as the other would have, to the last bit.
#[test]
fn exchanged_segments_go_on_with_the_other_statistic() {
    let new = || ContinuityStatistic::<f64, 4>::new(&cylinder(), &Fluid::paper(), &Sensors::paper());
    let blocks = [51, 52].map(|seed| {
        let mut blocks = Vec::new();
        let mut statistic = new();
        for (index, sample) in at_rest(seed, 4000).iter().enumerate() {
            let step_s = if index == 0 { 0.0 } else { STEP_S };
            statistic.push_each(step_s, sample, &mut |block| blocks.push(*block));
        }
        blocks
    });
    let told = |statistic: &mut ContinuityStatistic<f64, 4>| {
        statistic.close();
        (statistic.taken(), format!("{:?}", statistic.segments()))
    };
    let alone = blocks.each_ref().map(|blocks| {
        let mut statistic = new();
        blocks.iter().for_each(|block| statistic.take(block));
        told(&mut statistic)
    });
    let [mut one, mut other] = [new(), new()];
    let ([first, _], half) = (&blocks, 90);
    first[..half].iter().for_each(|block| one.take(block));
    one.swap_segments(&mut other);
    first[half..].iter().for_each(|block| other.take(block));
    blocks[1].iter().for_each(|block| one.take(block));
    assert_eq!([told(&mut other), told(&mut one)], alone);
    assert_ne!(alone[0], alone[1]);
    assert_eq!(alone[0].0, blocks[0].len() as u64);
}

/// Mean roots weigh by time.
#[test]
fn mean_roots_are_means_over_time() {
    let sample = at_rest(1, 1)[0];
    let mut statistic = ContinuityStatistic::<f64, 2>::new(&cylinder(), &Fluid::paper(), &Sensors::paper());
    for (dt_s, pa_pa, pb_pa) in [(0.0, 64e6, 0.0), (0.03, 4e6, 5e6), (0.01, 16e6, 7e6)] {
        statistic.push(dt_s, &Sample { pa_pa, pb_pa, ..sample });
    }
    let roots = statistic.mean_roots();
    let mean = |often: f64, seldom: f64| (3.0 * often.sqrt() + seldom.sqrt()) / 4.0;
    assert!((roots.internal / mean(1e6, 9e6) - 1.0).abs() < 1e-3);
    assert!((roots.external_a / mean(4e6, 16e6) - 1.0).abs() < 1e-3);
    assert!((roots.external_b / mean(5e6, 7e6) - 1.0).abs() < 1e-3);
}

/// A flow that comes more rarely than the rows counts from its first reading on: no step of the rows is taken
/// for its own.
#[test]
fn a_slow_flow_counts_from_its_first_reading() {
    for of_a in [false, true] {
        let mut samples = at_rest(61, 400);
        for (_, sample) in samples.iter_mut().enumerate().filter(|(k, _)| k % 20 != 1) {
            *(if of_a { &mut sample.qa_m3s } else { &mut sample.qb_m3s }) = None;
        }
        let statistic = statistic::<12>(&samples);
        let [balances, of_one] =
            [0, 1].map(|equation| statistic.segments().iter().map(|s| s.rows(equation)).sum::<f64>());
        assert!((of_one - balances - 1.0).abs() < 1e-9, "{of_a}: {balances} of {of_one}");
    }
}

/// Within a block, too, and where it is the only flow: of what was not read nothing is integrated.
#[test]
fn a_hole_of_more_than_four_steps_is_no_reading() {
    let rows = |hole: std::ops::Range<usize>| {
        let mut samples = at_rest(9, 3000);
        samples.iter_mut().for_each(|sample| sample.qb_m3s = None);
        samples[hole].iter_mut().for_each(|sample| sample.qa_m3s = None);
        statistic::<12>(&samples).segments().iter().map(|s| s.rows(1)).sum::<f64>()
    };
    let missing = [1005..1008, 1005..1018].map(|hole| rows(0..0) - rows(hole));
    assert_eq!(missing.map(|rows| rows.round() as i64), [0, 1]);
}
