//! The residual of a model: whitened by the sensors' noise it should be white, and is tested and held against every variable; of samples
//! that were not fitted, its size, its course, its shape. Both are reported alike of the declared model and of that with the effects found.

use super::estimates::leaks;
use crate::diagnose::data::Series;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::{BinnedResidual, Correlation, EquationResidual, ModelFit, Quality};
use crate::diagnose::search::Selection;
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{BINS, FEWEST_NUMBERS};
use crate::diagnose::weak_form::{Entry, Row, Rows, VARIABLES};
use std::collections::BTreeMap;

/// The residual of one equation; none where the traces lack it.
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
        normality_p: (white.len() >= FEWEST_NUMBERS)
            .then(|| jarque_bera_p(white.len(), skewness, excess_kurtosis)),
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

/// The residual of each test function, in m³/s or N.
pub(crate) struct HeldOut {
    samples: Vec<ResidualSample>,
}

/// The residual of one test function.
struct ResidualSample {
    equation: Equation,
    t_s: f64,
    /// What the machine did then, from other samples.
    beside: Option<Row>,
    residual: f64,
}

impl HeldOut {
    /// On `test`, or, where that is empty, on blocks that the fit left out.
    pub(crate) fn of(fit: &Fit<'_>, test: &[Series]) -> Self {
        if test.is_empty() {
            return Self::collect(fit.rows(), fit.held_out_residual());
        }
        let (rows, residual) = fit.residual_on(test);
        Self::collect(&rows, residual)
    }

    fn collect(rows: &Rows, residual: Vec<f64>) -> Self {
        let sample = |(entry, residual): (&Entry, f64)| ResidualSample {
            equation: entry.equation,
            t_s: rows.rows[entry.row].t_s,
            beside: rows.beside(entry.row).copied(),
            residual,
        };
        Self { samples: rows.entries.iter().zip(residual).map(sample).collect() }
    }

    fn of_equation(&self, equation: Equation) -> impl Iterator<Item = &ResidualSample> {
        self.samples.iter().filter(move |sample| sample.equation == equation)
    }

    /// Root mean square.
    pub(crate) fn rmse(&self) -> PerEquation<Option<f64>> {
        PerEquation::from_fn(|equation| {
            let squares = self.of_equation(equation).map(|sample| sample.residual * sample.residual);
            let (sum, count) = squares.fold((0.0, 0), |(sum, count), square| (sum + square, count + 1));
            (count > 0).then(|| (sum / f64::from(count)).sqrt())
        })
    }

    /// Time and residual.
    pub(crate) fn over_time(&self) -> PerEquation<Vec<(f64, f64)>> {
        let points =
            |equation| self.of_equation(equation).map(|sample| (sample.t_s, sample.residual)).collect();
        PerEquation::from_fn(points)
    }

    /// The residual against each variable, in bins of equal count.
    pub(crate) fn binned(&self) -> Vec<BinnedResidual> {
        let has_enough = |equation: &Equation| self.of_equation(*equation).count() >= 2 * BINS;
        let pairs = Equation::ALL.into_iter().filter(has_enough);
        let pairs = pairs.flat_map(|equation| VARIABLES.iter().map(move |variable| (equation, variable)));
        pairs
            .map(|(equation, variable)| {
                let pair =
                    |sample: &ResidualSample| Some(((variable.of)(sample.beside.as_ref()?), sample.residual));
                binned(equation, variable.name, self.of_equation(equation).filter_map(pair).collect())
            })
            .collect()
    }
}

fn binned(equation: Equation, against: &'static str, mut pairs: Vec<(f64, f64)>) -> BinnedResidual {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    let (xx, yy) = (mean(&|p| (p.0 - mx).powi(2)), mean(&|p| (p.1 - my).powi(2)));
    let xy = mean(&|p| (p.0 - mx) * (p.1 - my));
    let scale = (xx * yy).sqrt();
    let bins = pairs.chunks(pairs.len().div_ceil(BINS)).map(Bin::of);
    let (mut at, mut mean, mut std_error) = (vec![], vec![], vec![]);
    for bin in bins {
        at.push(bin.at);
        mean.push(bin.mean);
        std_error.push(bin.std_error);
    }
    BinnedResidual {
        equation,
        against,
        at,
        mean,
        std_error,
        correlation: if scale > 0.0 { xy / scale } else { 0.0 },
    }
}

/// Means of one bin.
struct Bin {
    at: f64,
    mean: f64,
    std_error: f64,
}

impl Bin {
    fn of(pairs: &[(f64, f64)]) -> Self {
        let n = pairs.len() as f64;
        let sum = pairs.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
        let (at, mean) = (sum.0 / n, sum.1 / n);
        let variance = pairs.iter().map(|p| (p.1 - mean).powi(2)).sum::<f64>() / n;
        Self { at, mean, std_error: (variance / n).sqrt() }
    }
}

/// How well a model fits: on `test`, or, where that is empty, on blocks that the fit left out.
pub(crate) fn model_fit(selection: &Selection<'_>, test: &[Series]) -> ModelFit {
    let fit = &selection.fit;
    let held_out = HeldOut::of(fit, test);
    ModelFit {
        quality: Quality {
            rmse: held_out.rmse(),
            whiteness_p: PerEquation::from_fn(|equation| fit.whiteness_p(equation)),
        },
        leaks: leaks(selection),
        noise_ratio: fit.noise_ratio(),
        residuals: PerEquation::from_fn(|equation| whitened_residual(fit, equation)),
        binned_residuals: held_out.binned(),
        residual_over_time: held_out.over_time(),
    }
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
