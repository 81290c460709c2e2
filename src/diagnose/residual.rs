//! What a model leaves over, as numbers that should be white noise: whitened by the sensors' noise, tested,
//! and held against every variable.

use super::fit::Fit;
use super::rows::{Balance, Row};
use super::whiteness;
use serde::Serialize;
use std::collections::BTreeMap;

/// Fewer numbers than this have no distribution.
const FEWEST: usize = 80;

/// What a model leaves over of the samples it was fitted to; none for a balance that the traces lack.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Residuals {
    /// Continuity of chamber A.
    pub chamber_a: Option<BalanceResidual>,
    /// Continuity of chamber B.
    pub chamber_b: Option<BalanceResidual>,
    /// Force balance.
    pub force: Option<BalanceResidual>,
}

/// One balance: a number per hat of 0.2 s, whitened (docs/closing-the-loop.md). With the right model and the
/// declared noise they are independent standard normal numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BalanceResidual {
    /// The whitened numbers, in the order of time. Where more than the sensors' noise is left, they are
    /// whitened by what is left.
    #[serde(skip)]
    pub white: Vec<f64>,
    /// What the machine did then, by variable, SI: read from samples that the number does not contain, not a
    /// number where there are none.
    #[serde(skip)]
    pub variables: BTreeMap<&'static str, Vec<f64>>,
    /// How many numbers.
    pub count: usize,
    /// Size of what is left as a multiple of the sensors' noise.
    pub excess: f64,
    /// Probability of autocorrelations this large in white noise (Box and Pierce 1970).
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

/// How what is left goes with a variable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Correlation {
    /// Pearson's coefficient.
    pub coefficient: f64,
    /// In standard deviations of what white noise would show: white numbers need no allowance for how slowly
    /// the variable moves.
    pub sigma: f64,
}

/// A variable that what is left may go with.
pub(super) struct Variable {
    pub(super) name: &'static str,
    pub(super) of: fn(&Row) -> f64,
}

/// P_L, P_A, P_B, x, ẋ, its sign, flows, force, temperature, time.
pub(super) const VARIABLES: [Variable; 11] = [
    Variable { name: "load_pressure_pa", of: |row| row.mean.pa_pa - row.mean.pb_pa },
    Variable { name: "pa_pa", of: |row| row.mean.pa_pa },
    Variable { name: "pb_pa", of: |row| row.mean.pb_pa },
    Variable { name: "x_m", of: |row| row.mean.x_m },
    Variable { name: "v_mps", of: |row| row.mean.v_mps },
    Variable { name: "direction", of: |row| row.mean.v_mps.signum() },
    Variable { name: "qa_m3s", of: |row| row.mean.qa_m3s },
    Variable { name: "qb_m3s", of: |row| row.mean.qb_m3s },
    Variable { name: "force_n", of: |row| row.mean.force_n },
    Variable { name: "temp_k", of: |row| row.mean.temp_k },
    Variable { name: "t_s", of: |row| row.t_s },
];

impl Residuals {
    pub(super) fn of(fit: &Fit<'_>) -> Self {
        let of = |balance| BalanceResidual::of(fit, balance);
        Self { chamber_a: of(Balance::ChamberA), chamber_b: of(Balance::ChamberB), force: of(Balance::Force) }
    }

    /// Those that there are, by name.
    pub fn balances(&self) -> impl Iterator<Item = (&'static str, &BalanceResidual)> {
        let named = [("chamber_a", &self.chamber_a), ("chamber_b", &self.chamber_b), ("force", &self.force)];
        named.into_iter().filter_map(|(name, balance)| Some((name, balance.as_ref()?)))
    }
}

impl BalanceResidual {
    fn of(fit: &Fit<'_>, balance: Balance) -> Option<Self> {
        let (rows, white): (Vec<Option<&Row>>, Vec<f64>) = fit
            .regression
            .innovations_by_entry(&fit.rows, &fit.solution, balance)
            .map(|(entry, value)| (fit.rows.beside(fit.rows.entries[entry].row), value))
            .unzip();
        if white.is_empty() {
            return None;
        }
        let variables: BTreeMap<_, Vec<f64>> = VARIABLES
            .iter()
            .map(|v| (v.name, rows.iter().map(|row| row.map_or(f64::NAN, v.of)).collect()))
            .collect();
        let correlations = variables
            .iter()
            .filter_map(|(name, values)| Some((*name, Correlation::of(&white, values)?)))
            .collect();
        let [skewness, excess_kurtosis] = shape(&white);
        Some(Self {
            count: white.len(),
            excess: fit.excess(balance),
            whiteness_p: whiteness::portmanteau_p(&white, 1.0),
            normality_p: (white.len() >= FEWEST)
                .then(|| jarque_bera_p(white.len(), skewness, excess_kurtosis)),
            skewness,
            excess_kurtosis,
            correlations,
            variables,
            white,
        })
    }

    /// Autocorrelation at lags of 1 to `lags` hats; white noise stays within ± 1.96/√count.
    pub fn autocorrelation(&self, lags: usize) -> Vec<f64> {
        let power: f64 = self.white.iter().map(|w| w * w).sum();
        let at = |lag: usize| {
            let later = self.white.get(lag..).unwrap_or_default();
            self.white.iter().zip(later).map(|(a, b)| a * b).sum::<f64>() / power.max(f64::MIN_POSITIVE)
        };
        (1..=lags).map(at).collect()
    }

    /// Variables that what is left goes with beyond chance (`sigma` standard deviations), strongest first.
    pub fn goes_with(&self, sigma: f64) -> Vec<(&'static str, Correlation)> {
        let mut found: Vec<_> = self.correlations.iter().map(|(name, c)| (*name, *c)).collect();
        found.retain(|(_, c)| c.sigma.abs() > sigma);
        found.sort_by(|a, b| b.1.sigma.abs().total_cmp(&a.1.sigma.abs()));
        found
    }
}

impl Correlation {
    /// None where the variable does not vary.
    fn of(white: &[f64], values: &[f64]) -> Option<Self> {
        let pairs = || white.iter().zip(values).filter(|(_, v)| v.is_finite());
        let n = pairs().count() as f64;
        let (mw, mv) = pairs().fold((0.0, 0.0), |(w, v), pair| (w + pair.0 / n, v + pair.1 / n));
        let sums = pairs().fold([0.0; 3], |[ww, vv, wv], (w, v)| {
            let (w, v) = (w - mw, v - mv);
            [ww + w * w, vv + v * v, wv + w * v]
        });
        let [ww, vv, wv] = sums;
        let varies = vv > 1e-18 * n * (mv * mv).max(f64::MIN_POSITIVE);
        let coefficient = wv / (ww * vv).sqrt();
        (varies && coefficient.is_finite()).then(|| Self { coefficient, sigma: coefficient * n.sqrt() })
    }
}

/// Skewness and excess kurtosis.
fn shape(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let moment = |p: i32| values.iter().map(|v| (v - mean).powi(p)).sum::<f64>() / n;
    let variance = moment(2).max(f64::MIN_POSITIVE);
    [moment(3) / variance.powf(1.5), moment(4) / (variance * variance) - 3.0]
}

fn jarque_bera_p(count: usize, skewness: f64, excess_kurtosis: f64) -> f64 {
    let statistic = count as f64 / 6.0 * (skewness.powi(2) + excess_kurtosis.powi(2) / 4.0);
    whiteness::chi2_p(statistic, 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::Normal;

    fn normal(count: usize, seed: u64) -> Vec<f64> {
        let mut normal = Normal::stream(seed, 0);
        (0..count).map(|_| normal.draw()).collect()
    }

    #[test]
    fn normal_numbers_pass_and_a_clipped_or_skewed_one_fails() {
        let p = |values: &[f64]| {
            let [skewness, kurtosis] = shape(values);
            jarque_bera_p(values.len(), skewness, kurtosis)
        };
        let failed = (0..400).filter(|seed| p(&normal(400, *seed)) < 0.05).count();
        assert!((4..=32).contains(&failed), "{failed} of 400 at 5 %");
        let clipped: Vec<f64> = normal(400, 1).into_iter().map(|v| v.clamp(-0.8, 0.8)).collect();
        let skewed: Vec<f64> = normal(400, 2).into_iter().map(|v| v.max(0.0)).collect();
        assert!(p(&clipped) < 1e-6 && p(&skewed) < 1e-6);
    }

    #[test]
    fn white_noise_goes_with_no_slow_variable_beyond_chance() {
        let slow: Vec<f64> = (0..500).map(|i| (0.01 * f64::from(i)).sin()).collect();
        let sigmas: Vec<f64> =
            (0..400).filter_map(|seed| Correlation::of(&normal(500, seed), &slow).map(|c| c.sigma)).collect();
        let spread = (sigmas.iter().map(|s| s * s).sum::<f64>() / 400.0).sqrt();
        assert!((spread - 1.0).abs() < 0.1, "{spread}");
        assert_eq!(Correlation::of(&normal(500, 0), &[3.0; 500]), None);
    }
}
