//! The residual of a model, as numbers that should be white noise: whitened by the sensors' noise, tested,
//! and held against every variable.

use crate::diagnose::equation::Equation;
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::{Correlation, EquationResidual};
use crate::diagnose::statistics;
use crate::diagnose::weak_form::Row;
use std::collections::BTreeMap;

/// Fewer numbers than this have no distribution.
const FEWEST: usize = 80;

/// A variable that the residual may go with.
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

/// The residual of a fit in one equation; none where the traces lack it.
pub(super) fn whitened_residual(fit: &Fit<'_>, equation: Equation) -> Option<EquationResidual> {
    let (rows, white): (Vec<Option<&Row>>, Vec<f64>) = fit
        .regression
        .innovations_by_entry(fit.rows(), &fit.bounded, equation)
        .map(|(entry, value)| (fit.rows().beside(fit.rows().entries[entry].row), value))
        .unzip();
    if white.is_empty() {
        return None;
    }
    let variables: BTreeMap<_, Vec<f64>> = VARIABLES
        .iter()
        .map(|v| (v.name, rows.iter().map(|row| row.map_or(f64::NAN, v.of)).collect()))
        .collect();
    let correlations =
        variables.iter().filter_map(|(name, values)| Some((*name, correlation(&white, values)?))).collect();
    let [skewness, excess_kurtosis] = moments(&white);
    Some(EquationResidual {
        count: white.len(),
        noise_ratio: fit.noise_ratio()[equation],
        whiteness_p: fit.whiteness_p(equation),
        normality_p: (white.len() >= FEWEST).then(|| jarque_bera_p(white.len(), skewness, excess_kurtosis)),
        skewness,
        excess_kurtosis,
        correlations,
        variables,
        white,
    })
}

/// None where the variable does not vary.
fn correlation(white: &[f64], values: &[f64]) -> Option<Correlation> {
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
    (varies && coefficient.is_finite()).then(|| Correlation { coefficient, sigma: coefficient * n.sqrt() })
}

/// Skewness and excess kurtosis.
fn moments(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let moment = |p: i32| values.iter().map(|v| (v - mean).powi(p)).sum::<f64>() / n;
    let variance = moment(2).max(f64::MIN_POSITIVE);
    [moment(3) / variance.powf(1.5), moment(4) / (variance * variance) - 3.0]
}

fn jarque_bera_p(count: usize, skewness: f64, excess_kurtosis: f64) -> f64 {
    let statistic = count as f64 / 6.0 * (skewness.powi(2) + excess_kurtosis.powi(2) / 4.0);
    statistics::chi2_p(statistic, 2.0)
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
            let [skewness, kurtosis] = moments(values);
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
            (0..400).filter_map(|seed| correlation(&normal(500, seed), &slow).map(|c| c.sigma)).collect();
        let spread = (sigmas.iter().map(|s| s * s).sum::<f64>() / 400.0).sqrt();
        assert!((spread - 1.0).abs() < 0.1, "{spread}");
        assert_eq!(correlation(&normal(500, 0), &[3.0; 500]), None);
    }
}
