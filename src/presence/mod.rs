//! Which leaks there are, where no flow meter tells: by the likelihood of their coefficients, of a hold or of a valve's flows.

mod belief;
mod found;

pub(crate) use belief::{Place, ln_tail, size};
pub use found::FoundLeak;
pub(crate) use found::{Found, Wording, report, told};
/// Unit of the leak coefficients.
pub(crate) use pitchleak_core::valve_unknowns::LEAK_UNIT_M3SPA;

use nalgebra::{Matrix3, Vector3};
use pitchleak_core::PerLeak;
use serde::{Deserialize, Serialize};

/// Below this gauge pressure air comes out of the oil, and a chamber is soon empty, Pa.
pub(crate) const EMPTY_PA: f64 = 5e5;

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

/// Sums over time of |P_L|, P_A, P_B and of P_L, Pa s.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Pressures {
    sizes_pas: PerLeak<f64>,
    load_pas: f64,
    pub time_s: f64,
}

impl Pressures {
    /// A step in which P_A and P_B went from the first to the second.
    pub fn add(&mut self, step_s: f64, a_pa: [f64; 2], b_pa: [f64; 2]) {
        let [a_pa, b_pa] = [a_pa, b_pa].map(|[from, to]| 0.5 * (from + to));
        let sizes = PerLeak { internal: (a_pa - b_pa).abs(), external_a: a_pa, external_b: b_pa };
        self.sizes_pas = self.sizes_pas.zip(sizes).map(|(sum, size)| sum + step_s * size);
        self.load_pas += step_s * (a_pa - b_pa);
        self.time_s += step_s;
    }

    /// Both together.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            sizes_pas: self.sizes_pas.zip(other.sizes_pas).map(|(a, b)| a + b),
            load_pas: self.load_pas + other.load_pas,
            time_s: self.time_s + other.time_s,
        }
    }

    /// Means of |P_L|, P_A, P_B, Pa.
    pub fn sizes_pa(&self) -> PerLeak<f64> {
        self.sizes_pas.map(|sum| sum / self.time_s.max(f64::MIN_POSITIVE))
    }

    /// Mean of P_L, Pa.
    pub fn load_pa(&self) -> f64 {
        self.load_pas / self.time_s.max(f64::MIN_POSITIVE)
    }
}
