use super::update::Innovation;
use crate::Real;

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
}
