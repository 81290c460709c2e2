//! How well the plain model explains a piece of a trace: generalised least squares on both continuity equations over
//! the whole piece, with the declared noise. Nothing restarts, so nothing is forgiven.

use super::equations::{BothSums, Sums};
use super::priors::{LEAKS, PARAMETERS, Priors, Vector};
use crate::rig::Rig;
use nalgebra::{Cholesky, Const, SMatrix};
use pitchleak_core::PerLeak;

/// A fit: its residuals and parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    /// Mean square of the normalised residual of the flow balance, and of position against flows; none without rows.
    pub ratios: [Option<f64>; 2],
    /// Rows of each.
    pub rows: [usize; 2],
    /// χ² of the parameters against their priors.
    penalty: f64,
    /// In prior standard deviations, and the inverse of their covariance: most fits are asked for few spreads or none.
    parameters: Vector,
    information: Cholesky<f64, Const<PARAMETERS>>,
    /// Units of the parameters, SI.
    units: Vector,
    compressibility_per_pa: f64,
}

/// Parameters further from their prior mean than this are none that the rig can have.
const PRIOR_SIGMAS: f64 = 4.0;
/// A leak this many standard deviations below zero is negative.
const NEGATIVE_SIGMAS: f64 = 6.0;

impl Fit {
    /// By these sums; without rows the priors.
    pub(super) fn of(sums: &BothSums, rig: &Rig, Priors(priors): &Priors) -> Option<Self> {
        let [balance, travel] = &sums.scaled(priors);
        let information = (SMatrix::identity() + balance.matrix + travel.matrix).cholesky()?;
        let parameters = information.solve(&(balance.vector + travel.vector));
        let ratio = |sums: &Sums| (sums.rows > 0).then(|| sums.left(&parameters) / sums.rows as f64);
        Some(Self {
            ratios: [ratio(balance), ratio(travel)],
            rows: [balance.rows, travel.rows],
            penalty: parameters.norm_squared(),
            units: *priors,
            compressibility_per_pa: 1.0 / rig.fluid.bulk_modulus_pa + parameters[0] * priors[0],
            parameters,
            information,
        })
    }

    /// Leak coefficients above zero, m³/(s·Pa): pressure noise reaches the equations through them.
    pub fn leaks(&self) -> PerLeak<f64> {
        PerLeak::from_fn(|leak| {
            (self.parameters[LEAKS + leak as usize] * self.units[LEAKS + leak as usize]).max(0.0)
        })
    }

    fn std(&self, at: usize) -> f64 {
        let mut covariances = Vector::zeros();
        covariances[at] = 1.0;
        self.information.solve_mut(&mut covariances);
        covariances[at].sqrt()
    }

    /// The larger of the two ratios.
    pub fn worst(&self) -> f64 {
        self.ratios.iter().flatten().copied().fold(0.0, f64::max)
    }

    /// Mean of χ² over both equations' rows, where what is smaller than the noise counts as noise: sensors may be
    /// better than declared, and a mistake that makes readings small must not win by it.
    pub fn mean_chi_square(&self) -> f64 {
        let sums = self
            .ratios
            .iter()
            .zip(self.rows)
            .map(|(ratio, rows)| ratio.unwrap_or(1.0).max(1.0) * rows as f64);
        (sums.sum::<f64>() + self.penalty) / self.row_count() as f64
    }

    pub fn row_count(&self) -> usize {
        self.rows.iter().sum()
    }

    /// How far the most negative leak lies below zero, in standard deviations that grow with the misfit.
    pub fn negative_leak_sigmas(&self) -> f64 {
        let inflation = self.worst().max(1.0).sqrt();
        let below = [1, 2, 3].map(|at: usize| -self.parameters[at] / (self.std(at) * inflation));
        below.into_iter().fold(0.0, f64::max)
    }

    /// Whether the rig can be so: bulk modulus and sensor errors within their priors, no leak negative.
    pub fn is_possible(&self) -> bool {
        let inside = [0, 4, 5, 6, 7, 8].iter().all(|at| self.parameters[*at].abs() <= PRIOR_SIGMAS);
        inside && self.compressibility_per_pa > 0.0 && self.negative_leak_sigmas() < NEGATIVE_SIGMAS
    }
}
