//! The residual of a model.

use crate::diagnose::equation::Equation;
use crate::diagnose::statistics::bonferroni_sigma;
use crate::diagnose::thresholds::FALSE_RATE;
use crate::diagnose::weak_form::RESIDUAL_TESTS;
use serde::Serialize;
use std::collections::BTreeMap;

/// The residual of a model of one equation: a number per test function of 0.2 s, whitened (docs/diagnosis.md). With the right model and the
/// declared noise they are independent standard normal numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct EquationResidual {
    /// The whitened numbers, in the order of time. Where more than the sensors' noise is left, they are
    /// whitened by the residual.
    #[serde(skip)]
    pub white: Vec<f64>,
    /// What the machine did then, by variable, SI: read from samples that the number does not contain, not a
    /// number where there are none.
    #[serde(skip)]
    pub variables: BTreeMap<&'static str, Vec<f64>>,
    /// How many numbers.
    pub count: usize,
    /// Size of the residual as a multiple of the sensors' noise.
    #[serde(rename = "excess")]
    pub noise_ratio: f64,
    /// Probability of autocorrelations this large in white noise (Box and Pierce 1970), whitened at the residual's own
    /// noise and where samples are fast enough to see the motion.
    pub whiteness_p: Option<f64>,
    /// Probability of skewness and kurtosis this far off in normal numbers (Jarque and Bera 1980, "Efficient tests
    /// for normality, homoscedasticity and serial independence of regression residuals", Econ. Lett. 6).
    pub normality_p: Option<f64>,
    /// Third standardised moment; 0 if normal.
    pub skewness: f64,
    /// Fourth standardised moment less 3; 0 if normal.
    pub excess_kurtosis: f64,
    /// With each variable that varies.
    pub correlations: BTreeMap<&'static str, Correlation>,
}

/// How the residual goes with a variable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Correlation {
    /// Pearson's coefficient.
    pub coefficient: f64,
    /// In standard deviations of what white noise would show: white numbers need no allowance for how slowly
    /// the variable moves.
    pub sigma: f64,
}

impl EquationResidual {
    /// Autocorrelation at lags of 1 to `lags` test functions; white noise stays within ± 1.96/√count.
    pub fn autocorrelation(&self, lags: usize) -> Vec<f64> {
        let power: f64 = self.white.iter().map(|w| w * w).sum();
        let at = |lag: usize| {
            let later = self.white.get(lag..).unwrap_or_default();
            self.white.iter().zip(later).map(|(a, b)| a * b).sum::<f64>() / power.max(f64::MIN_POSITIVE)
        };
        (1..=lags).map(at).collect()
    }

    /// Variables that the residual goes with beyond chance (`sigma` standard deviations), strongest first.
    pub fn goes_with(&self, sigma: f64) -> Vec<(&'static str, Correlation)> {
        let mut found: Vec<_> = self.correlations.iter().map(|(name, c)| (*name, *c)).collect();
        found.retain(|(_, c)| c.sigma.abs() > sigma);
        found.sort_by(|a, b| b.1.sigma.abs().total_cmp(&a.1.sigma.abs()));
        found
    }

    /// Those that chance would hardly bring among all tests of this kind.
    pub fn beyond_chance(&self) -> Vec<(&'static str, Correlation)> {
        self.goes_with(bonferroni_sigma(FALSE_RATE, RESIDUAL_TESTS))
    }
}

/// The residual against one variable: means in bins of equal count.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BinnedResidual {
    /// Of which equation.
    #[serde(rename = "balance")]
    pub equation: Equation,
    /// The variable.
    pub against: &'static str,
    /// Middle of each bin, SI.
    pub at: Vec<f64>,
    /// Mean of the residual there, SI.
    pub mean: Vec<f64>,
    /// Standard error of each mean, as if the test functions were independent, SI.
    pub std_error: Vec<f64>,
    /// Correlation of the two.
    pub correlation: f64,
}

impl BinnedResidual {
    /// Whether the traces have the variable, and it moves.
    pub fn varies(&self) -> bool {
        let ends = self.at.first().zip(self.at.last());
        ends.is_some_and(|(first, last)| last - first > 1e-9 * last.abs().max(first.abs()))
    }

    /// How far the bins' means are from one another, in their standard errors, squared and summed: what a correlation cannot see
    /// of a hump.
    pub fn strength(&self) -> f64 {
        let pairs = self.mean.iter().zip(&self.std_error).filter(|(_, error)| **error > 0.0);
        pairs.map(|(mean, error)| (mean / error).powi(2)).sum()
    }
}
