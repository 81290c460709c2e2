//! The laws by which numbers are judged: whether they are white noise, and how large chance makes them.

use super::equation::Equation;
use super::thresholds::{FALSE_RATE, FEWEST_NUMBERS, PORTMANTEAU_LAGS};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// Tests that the residual of a sound rig passes: of the size and the whiteness of each equation, and of products that no effect makes.
const TESTS: usize = 2 * Equation::ALL.len() + 1;

/// A sound rig fails any one of them this rarely.
pub(crate) const LEAST_P: f64 = FALSE_RATE / TESTS as f64;

/// The mean square of so many numbers of a sound rig, one without chance, is off by no more than that.
pub(crate) fn chance_of_variance(count: f64) -> f64 {
    bonferroni_sigma(FALSE_RATE, TESTS) * (2.0 / count).sqrt()
}

/// The chance of a [`portmanteau_chi2`] as large as this among white numbers.
pub(crate) fn colour_p(chi2: f64) -> f64 {
    chi2_p(chi2, PORTMANTEAU_LAGS as f64)
}

/// Sum of squared correlations at so many lags, in their variance among white numbers of variance one: Box and Pierce (1970),
/// but with the known variance in the denominator, so that a remainder far below the noise passes. Where the
/// numbers happen to be larger than that, their own: products of 300 numbers that are by chance 10 % too large
/// would pass for colour ten times as often as the law says. What is not a number is left out.
pub(crate) fn portmanteau_chi2(innovations: &[f64], dispersion: f64) -> Option<f64> {
    let n = known(innovations).count();
    if n < FEWEST_NUMBERS + PORTMANTEAU_LAGS {
        return None;
    }
    let power = known(innovations).map(|v| v * v).sum::<f64>() / n as f64;
    let variance = power.max(dispersion);
    let add = |(sum, count): (f64, f64), more: f64| (sum + more, count + 1.0);
    let sum: f64 = (1..=PORTMANTEAU_LAGS)
        .map(|lag| {
            let pairs = innovations.iter().zip(&innovations[lag..]).map(|(a, b)| a * b);
            let (product, count) = pairs.filter(|product| product.is_finite()).fold((0.0, 0.0), add);
            if count > 0.0 { product * product / count / (variance * variance) } else { 0.0 }
        })
        .sum();
    Some(sum)
}

/// The numbers that are known.
pub(crate) fn known(values: &[f64]) -> impl Iterator<Item = f64> + '_ {
    values.iter().copied().filter(|value| value.is_finite())
}

/// Upper tail of the chi-squared distribution.
pub(crate) fn chi2_p(value: f64, freedom: f64) -> f64 {
    ChiSquared::new(freedom).map_or(f64::NAN, |law| law.sf(value.max(0.0)))
}

/// The size in standard deviations that one of `count` tests passes by chance with probability `rate`.
pub(crate) fn bonferroni_sigma(rate: f64, count: usize) -> f64 {
    let share = rate / count.max(1) as f64 / 2.0;
    Normal::standard().inverse_cdf(1.0 - share)
}

/// Half the width of the interval that holds the truth with 95 % probability, in standard deviations.
pub(crate) fn ci95_sigma() -> f64 {
    bonferroni_sigma(1.0 - 0.95, 1)
}

/// The sum of squares of `freedom` numbers that one of `count` tests passes by chance with probability `rate`.
pub(crate) fn bonferroni_chi2(rate: f64, count: usize, freedom: f64) -> f64 {
    let share = rate / count.max(1) as f64;
    ChiSquared::new(freedom).map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - share))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn portmanteau_p(innovations: &[f64], dispersion: f64) -> Option<f64> {
        portmanteau_chi2(innovations, dispersion).map(colour_p)
    }

    #[test]
    fn a_slow_wave_is_not_white_and_a_tiny_one_is_below_the_noise() {
        let wave: Vec<f64> = (0..500).map(|i| (0.05 * f64::from(i)).sin()).collect();
        assert!(portmanteau_p(&wave, 1.0).is_some_and(|p| p < 1e-9));
        let tiny: Vec<f64> = wave.iter().map(|v| 1e-3 * v).collect();
        assert!(portmanteau_p(&tiny, 1.0).is_some_and(|p| p > 0.99));
    }

    #[test]
    fn what_is_not_a_number_is_left_out() {
        let mut normal = crate::simulate::Normal::stream(4, 0);
        let mut numbers: Vec<f64> = (0..2000).map(|_| normal.draw()).collect();
        let full = portmanteau_p(&numbers, 1.0).expect("enough");
        numbers.iter_mut().step_by(50).for_each(|number| *number = f64::NAN);
        assert!(full > 0.01 && portmanteau_p(&numbers, 1.0).is_some_and(|p| p > 0.01));
        let wave: Vec<f64> =
            numbers.iter().zip(0_i32..).map(|(v, i)| v + 0.5 * (0.05 * f64::from(i)).sin()).collect();
        assert!(portmanteau_p(&wave, 1.0).is_some_and(|p| p < 1e-6));
        assert_eq!(portmanteau_p(&[f64::NAN; 500], 1.0), None);
    }

    #[test]
    fn white_numbers_fail_about_as_rarely_as_the_law_says() {
        let mut normal = crate::simulate::Normal::stream(3, 0);
        let mut failed = 0;
        for _ in 0..20_000 {
            let white: Vec<f64> = (0..300).map(|_| normal.draw()).collect();
            failed += usize::from(portmanteau_p(&white, 1.0).is_some_and(|p| p < 2e-4));
        }
        assert!((1..=30).contains(&failed), "{failed} of 20000, four by the law");
    }

    #[test]
    fn thirty_tests_at_one_in_a_thousand_need_four_sigma() {
        assert!((bonferroni_sigma(1e-3, 30) - 4.15).abs() < 0.05);
    }

    #[test]
    fn six_squares_of_two_million_parts_stay_below_fifty_five_but_once_in_a_thousand() {
        assert!((bonferroni_chi2(1e-3, 2_000_000, 6.0) - 55.0).abs() < 0.5);
        assert!((chi2_p(bonferroni_chi2(1e-3, 30, 6.0), 6.0) / (1e-3 / 30.0) - 1.0).abs() < 1e-3);
    }
}
