//! The likelihood of the leaks where all else is settled: normal.

use nalgebra::{Matrix3, Vector3};
/// Unit of the leak coefficients.
pub(crate) use pitchleak_core::valve_unknowns::LEAK_UNIT_M3SPA;

/// Of a coefficient of 1 L/min at 50 bar: a thousand of them, 1 σ.
pub(crate) const LEAST_INFORMATION: f64 = 1e-6;
/// … and a share of the best known, below which differences are rounding: constant pressures give two rates for three leaks.
pub(crate) const RESOLUTION: f64 = 1e-13;

/// At one κ: squares of the residuals are `squares` + (C − `leaks`)ᵀ `information` (C − `leaks`), with the coefficients C in
/// [`LEAK_UNIT_M3SPA`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LeakLikelihood {
    pub information: Matrix3<f64>,
    /// Likeliest coefficients, whatever their sign.
    pub leaks: Vector3<f64>,
    pub squares: f64,
}

impl LeakLikelihood {
    /// From `squares` − 2 `right`ᵀ C + Cᵀ `information` C. A leak that nothing tells of, as the internal one at equal pressures, gets
    /// next to no information.
    pub fn new(information: Matrix3<f64>, right: &Vector3<f64>, squares: f64) -> Option<Self> {
        let least = LEAST_INFORMATION + RESOLUTION * information.trace();
        let information = information + Matrix3::identity() * least;
        let leaks = information.cholesky()?.solve(right);
        Some(Self { information, leaks, squares: squares - right.dot(&leaks) })
    }

    /// Where residuals are so many times as large as noise: what isn't explained makes everything less sure.
    pub fn widened(self, worse: f64) -> Self {
        Self { information: self.information / worse, squares: self.squares / worse, ..self }
    }

    /// A sum of nodes, each by its weight.
    pub fn plus(self, other: &Self, weight: f64) -> Self {
        Self {
            information: self.information + other.information * weight,
            leaks: self.leaks + other.leaks * weight,
            squares: self.squares + other.squares * weight,
        }
    }
}
