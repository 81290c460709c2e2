//! The noise that the signals really carry, held against the data sheets, and what moves between two samples. Where a valve closes and
//! the oil rings, slow samples show an image of the ringing and not its mean over a step: what they read there is as uncertain as their
//! fast part is large.

use super::declared::Declared;
use super::series::Series;
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{
    FALSE_RATE, FASTEST_MOTION_HZ, NEGLIGIBLE_SHARE, RIPPLE, SIGNIFICANT_SIGMA,
};
use pitchleak_core::Sensors;
use statrs::distribution::{Continuous, Normal};
use std::ops::Range;

/// How the noise of one kind of sensor compares with its data sheet.
pub(crate) struct SensorCheck {
    pub(crate) name: &'static str,
    pub(crate) declared_std: f64,
    pub(crate) found: FastNoise,
    /// What of a ripple is motion of the machine, since another sensor shows it too.
    shared_std: f64,
}

/// Noise beyond the declared one by so many standard deviations of its estimate is the sensor's own: one of six of a sound rig shows so
/// much by chance once in a thousand rigs.
fn noisier_sigma() -> f64 {
    statistics::bonferroni_sigma(FALSE_RATE, SIGNALS)
}

/// Position, pressures, flows and force.
const SIGNALS: usize = 6;

impl SensorCheck {
    pub(crate) fn is_noisier(&self) -> bool {
        self.found.std > (1.0 + noisier_sigma() * self.found.scatter) * self.declared_std
    }

    /// Whether it is white and less than declared: more can't hide, as motion only adds to it. None at all is a coarse reading.
    fn is_quieter(&self) -> bool {
        let is_white = self.found.std > 0.0 && self.found.colour < RIPPLE;
        is_white && self.found.std < (1.0 - noisier_sigma() * self.found.scatter) * self.declared_std
    }

    pub(crate) fn is_ripple(&self) -> bool {
        self.found.std > (1.0 + RIPPLE) * self.declared_std && self.found.colour > RIPPLE
    }

    /// Whether it is one without the motion that other sensors show too.
    pub(crate) fn is_ripple_of_its_own(&self) -> bool {
        let own = self.found.std.powi(2) - self.shared_std.powi(2);
        self.is_ripple() && own > ((1.0 + RIPPLE) * self.declared_std).powi(2)
    }
}

/// Compares each signal's fast part with the data sheet.
pub(crate) fn check_sensors(traces: &[Series], declared: &Declared) -> Vec<SensorCheck> {
    let declared = &declared.sensors;
    type Column = fn(&Series) -> &[f64];
    let signals: [(&'static str, f64, Column); SIGNALS] = [
        ("position", declared.position.noise_std, |s| &s.x_m),
        ("pressure a", declared.pressure.noise_std, |s| &s.pa_pa),
        ("pressure b", declared.pressure.noise_std, |s| &s.pb_pa),
        ("flow a", declared.flow_a.noise_std, |s| &s.qa_m3s),
        ("flow b", declared.flow_b.noise_std, |s| &s.qb_m3s),
        ("force", declared.force.noise_std, |s| &s.force_n),
    ];
    let order = difference_order(traces.iter().map(Series::step_s).fold(0.0, f64::max));
    let parts = signals.map(|(.., column)| FastPart::of(traces.iter().map(column), order));
    let shared = |at: usize| {
        let others = (0..parts.len()).filter(|other| *other != at);
        let of_other = |other: usize| parts[at].shared_with(&parts[other], signals[other].1);
        others.map(of_other).fold(0.0, f64::max)
    };
    let check = |at: usize| {
        let (name, declared_std, _) = signals[at];
        let check = SensorCheck { name, declared_std, found: parts[at].noise, shared_std: 0.0 };
        // Asked of a ripple alone: it is a pass over all signals for each lag.
        if check.is_ripple() { SensorCheck { shared_std: shared(at), ..check } } else { check }
    };
    (0..signals.len()).map(check).collect()
}

/// The declared noise, or what the traces really carry where that is more.
pub(crate) fn effective(declared: &Sensors<f64>, checks: &[SensorCheck]) -> Sensors<f64> {
    largest(declared, checks, |check| if check.is_noisier() { check.found.std } else { check.declared_std })
}

/// The noise from sample to sample that the traces carry, more or less than declared. A ripple averages away.
pub(crate) fn white(declared: &Sensors<f64>, checks: &[SensorCheck]) -> Sensors<f64> {
    largest(declared, checks, |check| {
        let differs = check.is_quieter() || check.is_noisier() && !check.is_ripple();
        if differs { check.found.std } else { check.declared_std }
    })
}

/// The sensors with the largest noise of the signals that they read.
fn largest(
    declared: &Sensors<f64>,
    checks: &[SensorCheck],
    noise_std: impl Fn(&SensorCheck) -> f64,
) -> Sensors<f64> {
    let mut sensors = *declared;
    for (spread, name) in [
        (&mut sensors.position, "position"),
        (&mut sensors.pressure, "pressure"),
        (&mut sensors.flow_a, "flow a"),
        (&mut sensors.flow_b, "flow b"),
        (&mut sensors.force, "force"),
    ] {
        let own = checks.iter().filter(|check| check.name.starts_with(name)).map(&noise_std);
        spread.noise_std = own.reduce(f64::max).unwrap_or(spread.noise_std);
    }
    sensors
}

/// Standard deviation and colour of the part of a signal that changes from sample to sample.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FastNoise {
    /// As if it were white, in the signal's unit.
    pub(crate) std: f64,
    /// Standard deviation of that as a share of it, were the noise white.
    pub(crate) scatter: f64,
    /// Largest autocorrelation of the differences at nine lags beyond their order, which is zero for white noise.
    pub(crate) colour: f64,
}

/// The least order, from three, whose differences see next to nothing of the machine's motion: three at 100 Hz, four at 50, six at 20.
pub(super) fn difference_order(step_s: f64) -> usize {
    let turn = 2.0 * (std::f64::consts::PI * FASTEST_MOTION_HZ * step_s).sin();
    let is_blind =
        |order: &usize| turn.powi(*order as i32) / binomials(2 * order)[*order].sqrt() < NEGLIGIBLE_SHARE;
    (3..6).find(is_blind).unwrap_or(6)
}

/// The binomial coefficients of a row of Pascal's triangle.
fn binomials(row: usize) -> Vec<f64> {
    let next = |last: &f64, k: usize| last * (row - k) as f64 / (k + 1) as f64;
    std::iter::successors(Some((1.0, 0)), |(last, k)| (*k < row).then(|| (next(last, *k), k + 1)))
        .map(|one| one.0)
        .collect()
}

/// So many differences of white noise say as much about its size as one independent number (Bartlett 1946).
fn correlated(order: usize) -> f64 {
    let row = binomials(2 * order);
    row.iter().map(|cell| (cell / row[order]).powi(2)).sum()
}

/// Differences of an order, oldest first, and their standard deviation for unit white noise.
pub(super) fn differences(signal: &[f64], order: usize) -> (Vec<f64>, f64) {
    let once = |values: Vec<f64>| values.windows(2).map(|w| w[1] - w[0]).collect();
    let fast = (0..order).fold(signal.to_vec(), |values, _| once(values));
    (fast, binomials(2 * order)[order].sqrt())
}

/// What of a signal changes from sample to sample, by differences of high order: what the machine does within so few samples is smooth,
/// so that only noise (and ripple faster than that) is left.
struct FastPart {
    /// Differences, a list for each trace.
    differences: Vec<Vec<f64>>,
    /// Their standard deviation for unit white noise.
    gain: f64,
    order: usize,
    noise: FastNoise,
}

impl FastPart {
    fn of<'a>(signals: impl Iterator<Item = &'a [f64]>, order: usize) -> Self {
        let (differences, gains): (Vec<_>, Vec<_>) = signals.map(|signal| differences(signal, order)).unzip();
        let mut part = Self {
            differences,
            gain: gains.into_iter().fold(1.0, f64::max),
            order,
            noise: FastNoise::default(),
        };
        part.noise = part.size();
        part
    }

    /// The middle size counts: a few jolts, as where a valve switches, are motion and no noise.
    fn size(&self) -> FastNoise {
        let sizes = self.differences.iter().flatten().filter(|d| d.is_finite());
        let mut sizes: Vec<f64> = sizes.map(|d| d.abs()).collect();
        let power: f64 = sizes.iter().map(|d| d * d).sum();
        if sizes.is_empty() || power <= 0.0 {
            return FastNoise::default();
        }
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        let lags = (self.order + 1..).take(9);
        let colour =
            lags.map(|lag| (self.product(self, lag, [f64::INFINITY; 2]) / power).abs()).fold(0.0, f64::max);
        let independent = sizes.len() as f64 / correlated(self.order);
        // Of the median of independent numbers (Rousseeuw and Croux 1993).
        let density = 2.0 * Normal::standard().pdf(NORMAL_MEDIAN);
        let scatter = 0.5 / (density * NORMAL_MEDIAN * independent.sqrt());
        FastNoise { std: median / NORMAL_MEDIAN / self.gain, scatter, colour }
    }

    /// Sum of products with another signal so many samples later, no difference of either counting more than so much.
    fn product(&self, other: &Self, lag: usize, [a, b]: [f64; 2]) -> f64 {
        let of_trace = |(own, other): (&Vec<f64>, &Vec<f64>)| {
            let pairs = own.iter().zip(other.get(lag..).unwrap_or_default());
            let products = pairs.map(|(own, other)| own.clamp(-a, a) * other.clamp(-b, b));
            products.filter(|product| product.is_finite()).sum::<f64>()
        };
        self.differences.iter().zip(&other.differences).map(of_trace).sum()
    }

    /// Standard deviation of the motion that another signal has in common with this one: all beyond its declared noise is motion there, and
    /// goes with what it is here. None where chance could do it.
    fn shared_with(&self, other: &Self, declared_std: f64) -> f64 {
        let count = self.differences.iter().map(Vec::len).sum::<usize>() as f64;
        let excess = other.noise.std.powi(2) - declared_std.powi(2);
        let lags = 0..=self.order;
        let both_ways = lags.flat_map(|lag| [(self, other, lag), (other, self, lag)]);
        let most = |part: &Self| SIGNIFICANT_SIGMA * part.noise.std * part.gain;
        let sums = both_ways
            .map(|(first, second, lag)| first.product(second, lag, [most(first), most(second)]).abs());
        let covariance = sums.fold(0.0, f64::max) / (count * self.gain * other.gain);
        let by_chance = self.noise.std * other.noise.std * (correlated(self.order) / count).sqrt();
        let is_shared = excess > 0.0 && covariance > noisier_sigma() * by_chance;
        if is_shared { covariance / excess.sqrt() } else { 0.0 }
    }
}

/// Median of the size of a standard normal number.
const NORMAL_MEDIAN: f64 = 0.674_489_750_196_082;

/// The fast part of each reading along a trace, held against the noise of its sensor.
pub(crate) struct Unresolved {
    /// Squares of differences in variances of the noise: position, pressures, flows, force.
    squares: [Vec<f64>; SIGNALS],
    order: usize,
}

impl Unresolved {
    pub(crate) fn of(series: &Series, sensors: &Sensors<f64>) -> Self {
        let order = difference_order(series.step_s());
        let squares = |values: &[f64], noise_std: f64| -> Vec<f64> {
            let (fast, of_white) = differences(values, order);
            let unit = of_white * noise_std.max(f64::MIN_POSITIVE);
            fast.into_iter().map(|d| (d / unit).powi(2)).collect()
        };
        let squares = [
            squares(&series.x_m, sensors.position.noise_std),
            squares(&series.pa_pa, sensors.pressure.noise_std),
            squares(&series.pb_pa, sensors.pressure.noise_std),
            squares(&series.qa_m3s, sensors.flow_a.noise_std),
            squares(&series.qb_m3s, sensors.flow_b.noise_std),
            squares(&series.force_n, sensors.force.noise_std),
        ];
        Self { squares, order }
    }

    /// Standard deviation of what is read in some samples, in those of the sensors' noise: one where noise explains it.
    pub(crate) fn noise_factor(&self, samples: Range<usize>) -> [f64; SIGNALS] {
        let of = |squares: &Vec<f64>| {
            // Differences count where their middle lies.
            let place = |sample: usize| sample.saturating_sub(self.order / 2).min(squares.len());
            let near =
                squares[place(samples.start)..place(samples.end)].iter().filter(|square| square.is_finite());
            let (sum, count) = near.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
            if sum > SIGNIFICANT_SIGMA.powi(2) * count { (sum / count).sqrt() } else { 1.0 }
        };
        self.squares.each_ref().map(of)
    }
}

#[cfg(test)]
mod sensor_noise_tests {
    use super::*;
    use crate::diagnose::testing::{declared, sound};
    use pitchleak_testkit::white_noise;

    #[test]
    fn a_ripple_is_coloured_and_a_smooth_signal_is_quiet() {
        let ripple: Vec<f64> = (0..2000).map(|i| (2.1 * f64::from(i)).sin()).collect();
        assert!(FastPart::of(std::iter::once(ripple.as_slice()), 3).noise.colour > 0.9);
        let smooth: Vec<f64> = (0..2000).map(|i| (0.06 * f64::from(i)).sin()).collect();
        assert!(FastPart::of(std::iter::once(smooth.as_slice()), 3).noise.std < 1e-4);
    }

    /// Flow A of a sound rig with a fast part, nearly regular, of so many standard deviations of its noise, flow B with another.
    fn flow_a(own: f64, others: f64) -> SensorCheck {
        let (mut series, declared) = (sound(60), declared());
        let Sensors { flow_a, flow_b, .. } = declared.sensors;
        let mut fast = 0.0;
        for (at, noise) in white_noise(5).take(series.len()).enumerate() {
            fast = -0.9 * fast + 0.436 * noise;
            series.qa_m3s[at] += own * flow_a.noise_std * fast;
            series.qb_m3s[at] -= others * flow_b.noise_std * fast;
        }
        check_sensors(&[series], &declared).swap_remove(3)
    }

    #[test]
    fn a_ripple_is_a_sensors_own_beyond_the_motion_that_another_shows_less_of() {
        let (own, shared, none) = (flow_a(0.8, 0.0), flow_a(0.8, 0.4), flow_a(0.0, 0.0));
        assert_eq!(own.name, "flow a");
        assert!(own.is_ripple_of_its_own() && !none.is_ripple());
        let ratios = [shared.found.std, shared.shared_std].map(|std| std / shared.declared_std);
        assert!(shared.is_ripple() && !shared.is_ripple_of_its_own(), "{ratios:?} {}", shared.found.colour);
    }

    #[test]
    fn slow_samples_take_differences_of_higher_order() {
        assert_eq!([0.005, 0.01, 0.02, 0.05].map(difference_order), [3, 3, 4, 6]);
        assert!((binomials(6)[3] - 20.0).abs() < 1e-12 && (binomials(6)[1] - 6.0).abs() < 1e-12);
        assert!((correlated(3) - 2.3).abs() < 0.05, "{}", correlated(3));
    }
}

#[cfg(test)]
mod unresolved_tests {
    use super::*;
    use crate::diagnose::testing::{declared, sound};
    use pitchleak_core::Sample;

    /// Every so many of the samples of 100 Hz, one of which jumps.
    fn every(step: usize, jolt_pa: f64) -> Series {
        let (full, mut series) = (sound(60), Series::default());
        for at in (0..full.len()).step_by(step) {
            let sample = Sample {
                x_m: full.x_m[at],
                pa_pa: full.pa_pa[at] + if at == 1500 { jolt_pa } else { 0.0 },
                pb_pa: full.pb_pa[at],
                qa_m3s: Some(full.qa_m3s[at]),
                qb_m3s: Some(full.qb_m3s[at]),
                force_n: Some(full.force_n[at]),
            };
            series.push(full.t_s[at], &sample, None);
        }
        series
    }

    #[test]
    fn a_jolt_is_loud_where_it_is_and_noise_is_not() {
        let sensors = declared().sensors;
        let jolt = 30.0 * sensors.pressure.noise_std;
        for step in [1, 5] {
            let [quiet, jolted] = [0.0, jolt].map(|jolt| Unresolved::of(&every(step, jolt), &sensors));
            let is_one = |times: &[f64; 6]| times.iter().all(|one| (one - 1.0).abs() < 1e-12);
            let rows = 5950 / step / 2;
            let loud = (0..rows).filter(|row| !is_one(&quiet.noise_factor(2 * row..2 * row + 4))).count();
            assert!(loud < rows / 100, "{loud} of {rows} by chance");
            let at = 1500 / step;
            let there = jolted.noise_factor(at - 2..at + 2);
            assert!(there[1] > 5.0 && there[2] < 2.0, "{there:?}");
            let beside = [&jolted, &quiet].map(|one| one.noise_factor(at + 20..at + 24)[1]);
            assert!((beside[0] - beside[1]).abs() < 1e-12, "{beside:?}");
        }
    }
}
