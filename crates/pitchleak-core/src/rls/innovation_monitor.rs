use super::update::Innovation;
use crate::Real;

/// Watches the innovations: are they as large as the declared noise says?
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct InnovationMonitor<T> {
    balance_sum: T,
    balance_count: T,
    odometer_sum: T,
    odometer_count: T,
}

impl<T: Real> InnovationMonitor<T> {
    /// Takes one innovation of the balance.
    pub fn balance(&mut self, innovation: &Innovation<T>) {
        let ratio = innovation.value * innovation.value / innovation.variance;
        self.balance_sum += ratio;
        self.balance_count += T::one();
    }

    /// Takes the χ² of `count` odometer innovations.
    pub fn odometer(&mut self, chi_square: T, count: T) {
        self.odometer_sum += chi_square;
        self.odometer_count += count;
    }

    pub fn forget(&mut self, keep: T) {
        self.balance_sum *= keep;
        self.balance_count *= keep;
        self.odometer_sum *= keep;
        self.odometer_count *= keep;
    }

    /// Mean ν²/S of balance and odometer.
    pub fn ratios(&self) -> [T; 2] {
        let ratio = |sum: T, count: T| if count > T::zero() { sum / count } else { T::zero() };
        [ratio(self.balance_sum, self.balance_count), ratio(self.odometer_sum, self.odometer_count)]
    }

    /// Factor on the variances: where the residuals are larger than declared by more than two standard
    /// deviations of their own scatter, the intervals grow with them; they never shrink (Birge 1932, "The
    /// calculation of errors by the method of least squares").
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn inflation(&self) -> T {
        let balance = significant_ratio(self.balance_sum, self.balance_count);
        balance.at_least(significant_ratio(self.odometer_sum, self.odometer_count)).at_least(T::one())
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

/// Variance of both pressure sensors' white noise from second differences of the signal, which cancel its slope:
/// E (p₂ − 2 p₁ + p₀)² = 6 σ² (von Neumann et al. 1941 use first differences).
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct NoiseMeter<T> {
    last_rise: Option<[T; 2]>,
    sum: [T; 2],
    count: T,
}

impl<T: Real> NoiseMeter<T> {
    #[inline]
    pub fn add(&mut self, before: [T; 2], now: [T; 2]) {
        let rise = [now[0] - before[0], now[1] - before[1]];
        let Some(last) = &mut self.last_rise else {
            self.last_rise = Some(rise);
            return;
        };
        let keep = T::lit(0.999);
        for i in 0..2 {
            let second = rise[i] - last[i];
            self.sum[i] = keep * self.sum[i] + second * second;
        }
        self.count = keep * self.count + T::one();
        *last = rise;
    }

    /// A gap: the next difference starts anew.
    pub fn interrupt(&mut self) {
        self.last_rise = None;
    }

    /// Variances, Pa².
    pub fn variance_pa2(&self) -> [T; 2] {
        let variance = |sum: T| sum / (T::lit(6.0) * self.count);
        if self.count > T::zero() { self.sum.map(variance) } else { [T::zero(); 2] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak_testkit::white_noise;

    /// White noise on a slope: the slope cancels, the noise is read as large as it is.
    #[test]
    fn the_meter_reads_the_noise_and_not_the_slope() {
        let (std_pa, slope_pa) = (5e4, 1e3);
        let mut meter = NoiseMeter::default();
        let mut before = 0.0;
        let mut readings = [0.0; 40];
        let mut noise = white_noise(1).enumerate();
        for reading in &mut readings {
            // A few times the meter's memory of a thousand samples.
            for (k, unit) in noise.by_ref().take(3000) {
                let now = slope_pa * k as f64 + std_pa * unit;
                meter.add([before, 0.0], [now, 0.0]);
                before = now;
            }
            *reading = meter.variance_pa2()[0].sqrt() / std_pa;
        }
        let mean = readings.iter().sum::<f64>() / readings.len() as f64;
        assert!((mean - 1.0).abs() < 0.02, "{mean} of the noise");
    }

    /// χ²₁ innovations stay as they are; twice as large ones widen the intervals by what they are more.
    #[test]
    fn intervals_grow_with_what_residuals_are_beyond_chance() {
        for (scale, expected) in [(1.0, 1.0), (2.0, 4.0)] {
            let mut monitor = InnovationMonitor::default();
            for unit in white_noise(2).take(20_000) {
                monitor.balance(&Innovation { value: scale * unit, variance: 1.0 });
            }
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
