//! What the balance's innovations say: whether the noise is as declared, and whether a leak has changed at once.

use super::Innovation;
use super::information::Solution;
use super::prior::{LEAKS, leak_column};
use crate::Real;
use crate::continuity::Equation;

/// Watches the innovations: are they as large as the declared noise says?
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Innovations<T> {
    balance_sum: T,
    balance_count: T,
    position_sum: T,
    position_count: T,
}

impl<T: Real> Innovations<T> {
    /// Takes one innovation of the balance.
    pub fn balance(&mut self, innovation: &Innovation<T>) {
        let ratio = innovation.value * innovation.value / innovation.variance;
        self.balance_sum += ratio;
        self.balance_count += T::one();
    }

    /// Takes the χ² of `count` innovations of the position equation.
    pub fn position(&mut self, chi_square: T, count: T) {
        self.position_sum += chi_square;
        self.position_count += count;
    }

    pub fn forget(&mut self, keep: T) {
        self.balance_sum *= keep;
        self.balance_count *= keep;
        self.position_sum *= keep;
        self.position_count *= keep;
    }

    /// Mean ν²/S of balance and position equation.
    pub fn ratios(&self) -> [T; 2] {
        let ratio = |sum: T, count: T| if count > T::zero() { sum / count } else { T::zero() };
        [ratio(self.balance_sum, self.balance_count), ratio(self.position_sum, self.position_count)]
    }

    /// Factor on the variances: where the residuals are larger than declared by more than two standard
    /// deviations of their own scatter, the intervals grow with them; they never shrink (Birge 1932, "The
    /// calculation of errors by the method of least squares").
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn inflation(&self) -> T {
        let balance = significant_ratio(self.balance_sum, self.balance_count);
        balance.at_least(significant_ratio(self.position_sum, self.position_count)).at_least(T::one())
    }
}

/// Mean of χ²₁ terms over what such a mean may be by chance (its variance is 2/count).
fn significant_ratio<T: Real>(sum: T, count: T) -> T {
    // Short of two standard deviations, (sum − count)² = 8 count, it is below one, which tells nothing: a root is dear on a
    // microcontroller. 7, so that rounding at the edge changes nothing.
    let beyond = sum - count;
    let may_be = beyond > T::zero() && beyond * beyond > T::lit(7.0) * count;
    if may_be { sum / (count + T::lit(2.0) * (T::lit(2.0) * count).sqrt()) } else { T::zero() }
}

/// Page's test on ν²/S, which is χ²₁ as long as nothing changes: drift, largest step and bound. A false
/// change comes at most once per exp(0.398 · 40) ≈ 8·10⁶ blocks, three weeks at four blocks a second
/// (Page 1954; Basseville & Nikiforov 1993, Detection of Abrupt Changes, §2.2 and §5.2). Three blocks it takes
/// at least: a single wild reading stands in two.
const CUSUM_DRIFT: f64 = 2.0;
const CUSUM_STEP: f64 = 16.0;
const CUSUM_BOUND: f64 = 40.0;
/// Variance of a forecast, in that of the noise, from which on it must not stand still: its own error would then
/// pass from block to block for a change.
const VAGUE: f64 = 1.2;
/// A change that takes longer, s, is not sudden: the trends follow it.
const SUDDEN_S: f64 = 3.0;

/// Says when a leak changes at once, by the balance's innovations.
///
/// As soon as they are larger than usual the forecast stands still: what was known before has to foretell the
/// blocks that follow, as hypotheses that adapt quickly would hide the change in their own uncertainty.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct ChangeDetector<T, const N: usize> {
    /// Of use only while `cusum` is above zero.
    forecast: Solution<T, N>,
    slopes_ps: [T; LEAKS],
    cusum: T,
    since_s: T,
}

impl<T: Real, const N: usize> ChangeDetector<T, N> {
    pub fn new(forecast: &Solution<T, N>) -> Self {
        Self { forecast: *forecast, slopes_ps: [T::zero(); LEAKS], cusum: T::zero(), since_s: T::zero() }
    }

    /// Holds a whitened balance over `time_s` against the forecast; `known` and `slopes_ps` (prior units, per s) are
    /// what is known before it, `by_known` the balance's innovation by that, and `inflation` how much larger than
    /// declared the noise is. Says whether the leak has changed.
    pub fn update(
        &mut self,
        balance: &Equation<T, N>,
        time_s: T,
        known: &Solution<T, N>,
        by_known: Innovation<T>,
        slopes_ps: &[T; LEAKS],
        inflation: T,
    ) -> bool {
        let mut by_forecast = None;
        if self.cusum > T::zero() && self.since_s <= T::lit(SUDDEN_S) {
            by_forecast = Some(self.forecast.predict(balance)).filter(|by| by.variance <= T::lit(VAGUE));
        } else {
            self.cusum = T::zero();
        }
        if by_forecast.is_none() {
            self.slopes_ps = *slopes_ps;
            self.since_s = T::zero();
        }
        self.since_s += time_s;
        let Innovation { value: mut innovation, variance } = by_forecast.unwrap_or(by_known);
        for (leak, slope) in self.slopes_ps.iter().enumerate() {
            innovation -= balance.columns[leak_column(leak)] * *slope * self.since_s;
        }
        let ratio = innovation * innovation / (variance * inflation);
        let step = ratio.at_most(T::lit(CUSUM_STEP)) - T::lit(CUSUM_DRIFT);
        self.cusum = (self.cusum + step).at_least(T::zero());
        if by_forecast.is_none() && self.cusum > T::zero() {
            self.forecast = *known;
        }
        self.cusum > T::lit(CUSUM_BOUND)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak_testkit::white_noise;

    /// χ²₁ innovations stay as they are; twice as large ones widen the intervals by what they are more.
    #[test]
    fn intervals_grow_with_what_residuals_are_beyond_chance() {
        for (scale, expected) in [(1.0, 1.0), (2.0, 4.0)] {
            let mut monitor = Innovations::default();
            for unit in white_noise(2).take(20_000) {
                monitor.balance(&Innovation { value: scale * unit, variance: 1.0 });
            }
            assert!((monitor.inflation() / expected - 1.0).abs() < 0.05, "{}", monitor.inflation());
        }
    }

    /// Positions that are farther off than declared widen the intervals as balances do; smaller ones never narrow them.
    #[test]
    fn positions_widen_intervals_too() {
        for (ratio, expected) in [(4.0, 4.0), (0.25, 1.0)] {
            let mut monitor = Innovations::<f64>::default();
            monitor.position(ratio * 20_000.0, 20_000.0);
            assert!((monitor.inflation() / expected - 1.0).abs() < 0.05, "{}", monitor.inflation());
        }
    }

    /// The mean of `count` χ²₁ terms has the variance 2/count: two of its standard deviations beyond 1 are the first that
    /// tell.
    #[test]
    fn chance_is_what_so_few_terms_scatter_by() {
        for count in [8.0_f64, 50.0, 20_000.0] {
            let beyond = 1.0 + 2.0 * (2.0 / count).sqrt();
            assert!((significant_ratio(count * beyond, count) - 1.0).abs() < 1e-12, "{count}");
        }
    }

    const BLOCK_S: f64 = 0.25;

    fn hold(detector: &mut ChangeDetector<f64, 4>, innovation: f64, known: &Solution<f64, 4>) -> bool {
        let balance = Equation { left: innovation, columns: [0.0, 0.0, 1.0, 0.0] };
        detector.update(&balance, BLOCK_S, known, known.predict(&balance), &[0.0; LEAKS], 1.0)
    }

    /// A leak that opens shows within a few blocks; in the eight million that a false change takes at the least
    /// there is one at most.
    #[test]
    fn a_change_is_seen_soon_and_nothing_else_is() {
        let known = Solution::zero();
        let mut detector = ChangeDetector::new(&known);
        let mut false_changes = 0;
        for unit in white_noise(3).take(8_000_000) {
            if hold(&mut detector, unit, &known) {
                false_changes += 1;
                detector = ChangeDetector::new(&known);
            }
        }
        assert!(false_changes <= 1, "{false_changes}");
        let seen = white_noise(4).take(5).any(|unit| hold(&mut detector, unit + 6.0, &known));
        assert!(seen);
    }

    /// Estimates that run after the change at once, and say that they are unsure, do not hide it.
    #[test]
    fn what_adapts_does_not_hide_a_change() {
        let sure = Solution::zero();
        let mut unsure = Solution::zero();
        unsure.covariance[2][2] = 1e4;
        let mut detector = ChangeDetector::new(&sure);
        assert!(!hold(&mut detector, 30.0, &sure));
        assert!(!hold(&mut detector, 30.0, &unsure));
        assert!(hold(&mut detector, 30.0, &unsure));
    }

    /// A single wild reading stands in two blocks, and is no change.
    #[test]
    fn one_wild_reading_is_no_change() {
        let known = Solution::zero();
        let mut detector = ChangeDetector::new(&known);
        assert!(!hold(&mut detector, 1e3, &known));
        assert!(!hold(&mut detector, -1e3, &known));
        assert!(!(0..1000).any(|_| hold(&mut detector, 0.5, &known)));
    }

    /// A leak that goes on growing as the trend says is foretold.
    #[test]
    fn a_trend_is_no_change() {
        let known = Solution::zero();
        let mut detector = ChangeDetector::new(&known);
        let foretold = (0..7).any(|block| {
            // The first one surprises, the rest grow by their slope.
            let value = if block == 0 { 5.0 } else { 2.0 * BLOCK_S * f64::from(block + 1) };
            let balance = Equation { left: value, columns: [0.0, 0.0, 1.0, 0.0] };
            detector.update(&balance, BLOCK_S, &known, known.predict(&balance), &[0.0, 2.0, 0.0], 1.0)
        });
        assert!(!foretold, "what the slope foretells");
    }
}
