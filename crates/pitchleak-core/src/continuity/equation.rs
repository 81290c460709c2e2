// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::integrals::Integrals;
use crate::Real;

/// One scalar equation y = fᵀθ + error.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub struct Equation<T, const N: usize> {
    /// y.
    pub left: T,
    /// The regressor f.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub columns: [T; N],
}

impl<T: Real, const N: usize> Equation<T, N> {
    /// The residual y − fᵀθ.
    #[inline]
    pub fn residual(&self, theta: &[T; N]) -> T {
        let mut residual = self.left;
        for i in 0..N {
            residual -= self.columns[i] * theta[i];
        }
        residual
    }

    /// Both sides times `factor`.
    #[inline]
    pub fn scaled(mut self, factor: T) -> Self {
        self.left *= factor;
        for column in &mut self.columns {
            *column *= factor;
        }
        self
    }

    /// Adds `factor` times another equation.
    #[inline]
    pub fn add_scaled(&mut self, factor: T, other: &Self) {
        self.left += factor * other.left;
        for (column, other) in self.columns.iter_mut().zip(&other.columns) {
            *column += factor * *other;
        }
    }
}

/// w_a·(chamber A) + w_b·(chamber B), in prior units: `scale` holds each parameter's prior standard
/// deviation, `compressibility` its prior mean 1/β (the other means are zero). Columns in the order of
/// [`Parameter`](crate::Parameter). The piston's travel is on the left side of neither: it cancels in the balance, and is what
/// the position equation tells.
#[inline]
pub fn combine<T: Real, const N: usize>(
    integrals: &Integrals<T>,
    weight_a: T,
    weight_b: T,
    compressibility: T,
    scale: &[T; N],
) -> Equation<T, N> {
    let (a, b) = (&integrals.a, &integrals.b);
    let compression = weight_a * a.compression + weight_b * b.compression;
    let flow_a = weight_a * a.flow;
    let flow_b = weight_b * b.flow;
    let left = flow_a + flow_b - compressibility * compression;
    let all = [
        compression,
        (weight_a - weight_b) * (a.pressure - b.pressure),
        weight_a * a.pressure,
        weight_b * b.pressure,
        weight_a * integrals.time,
        weight_b * integrals.time,
        flow_a,
        flow_b,
        // A position that reads (1 + γ) x travels (1 + γ) times as far: only the position equation sees it.
        T::zero(),
    ];
    let mut columns = [T::zero(); N];
    for ((column, value), scale) in columns.iter_mut().zip(all).zip(scale) {
        *column = value * *scale;
    }
    Equation { left, columns }
}
