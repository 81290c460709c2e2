//! The best that any estimator can do: an efficient one, its errors drawn from the Cramér–Rao bound.
//!
//! An efficient estimator's error at one time is its error at any later time plus a part that is independent
//! of it (S. Kay 1993, Fundamentals of Statistical Signal Processing, §3.4 and §12.6: the sequential estimator's
//! corrections are white). So its history over a window is drawn backwards: from the bound at the end,
//! each step adds the difference of two bounds. Scored like a real estimator, it tells what the figures of
//! the table can be at best, start and definition of steady state included.

use super::protocol::SAMPLE_RATE_HZ;
use super::trial::EstimateHistory;
use crate::cramer_rao::{CramerRaoModel, PARAMETERS};
use nalgebra::{SMatrix, SVector, SymmetricEigen};
use pitchleak::core::{Estimate, FilterError, PerLeak, Sample};
use pitchleak::simulate::{Normal, Sensing, Truth};

/// Samples between two renewals of the efficient estimator.
const STRIDE: usize = 5;

type Errors = SVector<f64, PARAMETERS>;
type Matrix = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// An efficient estimator of one window.
pub struct Efficient {
    /// Roots of the differences of the bounds, in time; the last is the root of the bound at the end.
    steps: Vec<Matrix>,
    stds: Vec<PerLeak<f64>>,
    units: Errors,
    coefficients: PerLeak<f64>,
}

impl Efficient {
    /// The efficient estimator of the noise-free `samples`; `None` where nothing can be learnt.
    pub fn new(model: &CramerRaoModel<'_>, samples: &[Sample<f64>]) -> Option<Self> {
        let bounds = model.history(1.0 / SAMPLE_RATE_HZ, samples, STRIDE)?;
        let differences = bounds.windows(2).map(|pair| match pair {
            [now, next] => root(now.covariance - next.covariance),
            _ => Matrix::zeros(),
        });
        let steps = differences.chain(bounds.last().map(|last| root(last.covariance))).collect();
        let stds = bounds.iter().map(|bound| bound.leak_std).collect();
        Some(Self { steps, stds, units: model.units(), coefficients: *model.leaks })
    }

    /// Standard deviations of the leak coefficients after `samples` samples, m³/(s·Pa).
    pub fn leak_std(&self, samples: usize) -> PerLeak<f64> {
        let nothing = PerLeak::default().map(|_: f64| f64::INFINITY);
        self.place(samples).and_then(|place| self.stds.get(place)).copied().unwrap_or(nothing)
    }

    /// The renewal that stands after `samples` samples; the first one before it has been made.
    fn place(&self, samples: usize) -> Option<usize> {
        let newest = (samples.saturating_sub(1) / STRIDE).saturating_sub(1);
        self.steps.len().checked_sub(1).map(|last| newest.min(last))
    }

    /// Errors of all parameters at every renewal, one draw.
    fn draw(&self, normal: &mut Normal) -> Vec<Errors> {
        let mut error = Errors::zeros();
        let mut errors: Vec<Errors> = Vec::with_capacity(self.steps.len());
        for step in self.steps.iter().rev() {
            error += step * Errors::from_fn(|_, _| normal.draw());
            errors.push(error.component_mul(&self.units));
        }
        errors.reverse();
        errors
    }

    /// What it would have found in a window that `sensing` reads; `normal` draws its errors.
    ///
    /// # Errors
    /// Where the filter does not exist at the protocol's rate.
    pub fn history(
        &self,
        window: &[Truth],
        sensing: Sensing,
        normal: &mut Normal,
    ) -> Result<EstimateHistory, FilterError> {
        let errors = self.draw(normal);
        EstimateHistory::of(window, sensing, |index, _| {
            let place = self.place(index + 1).unwrap_or(0);
            let error = errors.get(place).copied().unwrap_or_default();
            let [_, internal, external_a, external_b, _, _, bias_a, bias_b, _] = error.into();
            let off = PerLeak { internal, external_a, external_b };
            let coefficients =
                self.coefficients.zip(off).map(|(c, off)| c + off).zip(self.leak_std(index + 1));
            (coefficients.map(|(value, std)| Estimate { value, std }), [bias_a, bias_b])
        })
    }
}

/// A root of a covariance, whose small negative eigenvalues are rounding.
fn root(covariance: Matrix) -> Matrix {
    let eigen = SymmetricEigen::new(0.5 * (covariance + covariance.transpose()));
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * Matrix::from_diagonal(&roots)
}
