//! The residual of samples that were not fitted: its size, its course, its shape.

use super::residual::VARIABLES;
use crate::diagnose::data::Series;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::BinnedResidual;
use crate::diagnose::weak_form::{Entry, Row, Rows};

/// Bins of equal count against each variable.
const BINS: usize = 12;

/// The residual of each row, in m³/s or N.
pub(crate) struct HeldOut {
    samples: Vec<ResidualSample>,
}

/// The residual of one row.
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
