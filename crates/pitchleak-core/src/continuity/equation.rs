//! The rows: how the continuity equations of both chambers combine to a balance and a position, and how the balances of
//! blocks that follow each other become independent.

// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::integrals::Integrals;
use super::noise::NoiseStd;
use crate::{Cylinder, PerLeak, Real};

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

/// How the two continuity equations of one instant are combined.
///
/// Chamber A reads A_A ẋ = Q_A − …, chamber B −A_B ẋ = Q_B − …. Generalised least squares splits the pair
/// into two equations whose errors are independent:
/// - the *balance* A_B·(A) + A_A·(B), in which the piston speed cancels;
/// - the *position* equation ẋ = w_A·(A) + w_B·(B), the best speed that the flows can tell.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Weights<T> {
    /// w_A, 1/m².
    pub position_a: T,
    /// w_B, 1/m².
    pub position_b: T,
    /// Variance of the position equation's error, (m/s)² per sample.
    pub position_variance: T,
    /// Variance of the balance's error, (m²·m³/s)² per sample; infinite where a chamber rests.
    pub balance_variance: T,
}

impl<T: Real> Weights<T> {
    /// Weights where both flows are measured. The error of chamber A is n_QA − (C_ip + C_epA) n_PA
    /// + C_ip n_PB, that of B likewise, so the leaks themselves decide how much pressure noise counts.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn both(cylinder: &Cylinder<T>, noise: &NoiseStd<T>, leaks: &PerLeak<T>) -> Self {
        let pressure = noise.pressure_pa * noise.pressure_pa;
        let (c, a, b) = (leaks.internal, leaks.external_a, leaks.external_b);
        let own_a = c + a;
        let own_b = c + b;
        let var_a = noise.flow_a_m3s * noise.flow_a_m3s + pressure * (own_a * own_a + c * c);
        let var_b = noise.flow_b_m3s * noise.flow_b_m3s + pressure * (own_b * own_b + c * c);
        let cov = -pressure * c * (own_a + own_b);
        let (aa, ab) = (cylinder.area_a_m2, cylinder.area_b_m2);
        // Balance variance gᵀΣg with g = (A_B, A_A); that of the position follows from det Σ.
        let two = T::lit(2.0);
        let balance = ab * ab * var_a + two * aa * ab * cov + aa * aa * var_b;
        let pull_a = aa * var_b + ab * cov;
        let pull_b = -(ab * var_a + aa * cov);
        Self {
            position_a: pull_a / balance,
            position_b: pull_b / balance,
            position_variance: (var_a * var_b - cov * cov) / balance,
            balance_variance: balance,
        }
    }

    /// Weights where only chamber A's flow is measured.
    pub fn only_a(cylinder: &Cylinder<T>, noise: &NoiseStd<T>, leaks: &PerLeak<T>) -> Self {
        let own = leaks.internal + leaks.external_a;
        let area = cylinder.area_a_m2;
        let variance = noise.chamber_variance(noise.flow_a_m3s, own, leaks.internal);
        Self {
            position_a: T::one() / area,
            position_b: T::zero(),
            position_variance: variance / (area * area),
            balance_variance: T::infinity(),
        }
    }

    /// Weights where only chamber B's flow is measured.
    pub fn only_b(cylinder: &Cylinder<T>, noise: &NoiseStd<T>, leaks: &PerLeak<T>) -> Self {
        let own = leaks.internal + leaks.external_b;
        let area = cylinder.area_b_m2;
        let variance = noise.chamber_variance(noise.flow_b_m3s, own, leaks.internal);
        Self {
            position_a: T::zero(),
            position_b: -T::one() / area,
            position_variance: variance / (area * area),
            balance_variance: T::infinity(),
        }
    }
}

/// Whitens the balances of blocks that follow each other: the pressure noise at a block's end stands in two blocks with
/// opposite sign.
///
/// That is a moving average of order 1, e_k = d_k + s_k − s_{k−1} with Var d = D and Var s = S. Its innovations
/// w_k = e_k + (S_{k−1}/V_{k−1}) w_{k−1} have the variance V_k = D + S_k + S_{k−1} (1 − S_{k−1}/V_{k−1}) and are independent
/// (Brockwell, Davis 1991, Time Series: Theory and Methods, §5.2, the innovations algorithm; a first block has V = D + 2 S).
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub struct MovingAverage<T, const N: usize> {
    /// w, not divided by its standard deviation.
    innovation: Equation<T, N>,
    /// S: variance of the stored oil's pressure noise at the block's end.
    stored: T,
    /// V.
    variance: T,
}

impl<T: Real, const N: usize> MovingAverage<T, N> {
    /// The innovation of a block's balance `equation` after the block `before`, none where it follows no block. `flows` is the
    /// variance D of the block's own noise, `stored` S that of the oil stored at its end.
    pub fn after(before: Option<&Self>, mut equation: Equation<T, N>, flows: T, stored: T) -> Self {
        let mut variance = flows + stored;
        if let Some(before) = before {
            let share = before.stored / before.variance;
            equation.add_scaled(share, &before.innovation);
            variance += before.stored * (T::one() - share);
        } else {
            variance += stored;
        }
        Self { innovation: equation, stored, variance }
    }

    /// The row of unit variance.
    pub fn whitened(&self) -> Equation<T, N> {
        self.innovation.scaled(T::one() / self.variance.sqrt())
    }

    /// V: variance of the innovation.
    pub fn variance(&self) -> T {
        self.variance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
    use proptest::prelude::*;

    const AREAS: Vector2<f64> = Vector2::new(1.3e-3, 0.9e-3);

    fn cylinder() -> Cylinder<f64> {
        Cylinder { area_a_m2: AREAS.x, area_b_m2: AREAS.y, ..Cylinder::paper() }
    }

    prop_compose! {
        /// Noise and leaks that weigh alike in the equations' errors.
        fn errors()(
            flow_a_m3s in 1e-7..1e-6, flow_b_m3s in 1e-7..1e-6, pressure_pa in 1e4..1e5_f64,
            (internal, external_a, external_b) in (0.0..1e-11, 0.0..1e-11, 0.0..1e-11),
        ) -> (NoiseStd<f64>, PerLeak<f64>) {
            (NoiseStd { flow_a_m3s, flow_b_m3s, pressure_pa, position_m: 0.0 }, PerLeak { internal, external_a, external_b })
        }
    }

    /// Covariance of both chambers' errors: flow noise, and pressure noise through the leaks.
    fn covariance(noise: &NoiseStd<f64>, leaks: &PerLeak<f64>) -> Matrix2<f64> {
        let c = leaks.internal;
        let through =
            Matrix2::new(-(c + leaks.external_a), c, c, -(c + leaks.external_b)) * noise.pressure_pa;
        let flows = Vector2::new(noise.flow_a_m3s.powi(2), noise.flow_b_m3s.powi(2));
        Matrix2::from_diagonal(&flows) + through * through.transpose()
    }

    fn near(found: f64, expected: f64) -> bool {
        (found / expected - 1.0).abs() < 1e-9
    }

    /// Chamber A reads A_A ẋ, chamber B −A_B ẋ: whichever meters there are, the position equation counts ẋ once.
    #[test]
    fn the_position_equation_counts_the_speed_once() {
        let cylinder = Cylinder::<f64>::paper();
        let noise = NoiseStd { flow_a_m3s: 1e-6, flow_b_m3s: 2e-6, pressure_pa: 5e4, position_m: 1e-3 };
        let leaks = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 2e-12 };
        for weights in [Weights::both, Weights::only_a, Weights::only_b] {
            let Weights { position_a, position_b, .. } = weights(&cylinder, &noise, &leaks);
            let counted = position_a * cylinder.area_a_m2 - position_b * cylinder.area_b_m2;
            assert!((counted - 1.0).abs() < 1e-12, "{counted}");
        }
    }

    proptest! {
        /// The position equation is the generalised least-squares estimate of ẋ from Q_A = A_A ẋ, Q_B = −A_B ẋ; the balance,
        /// in which ẋ cancels, keeps what is left of the covariance.
        #[test]
        fn both_are_generalised_least_squares((noise, leaks) in errors()) {
            let weights = Weights::both(&cylinder(), &noise, &leaks);
            let covariance = covariance(&noise, &leaks);
            let speed = Vector2::new(AREAS.x, -AREAS.y);
            let inverse = covariance.try_inverse().unwrap();
            let variance = 1.0 / (speed.transpose() * inverse * speed).x;
            let best = inverse * speed * variance;
            prop_assert!(near(weights.position_a, best.x) && near(weights.position_b, best.y), "{weights:?} {best}");
            prop_assert!(near(weights.position_variance, variance));
            let cancelling = Vector2::new(AREAS.y, AREAS.x);
            prop_assert!(near(weights.balance_variance, (cancelling.transpose() * covariance * cancelling).x));
        }

        /// One chamber alone: its speed is its flow over its area, as uncertain as its own error; nothing balances.
        #[test]
        fn one_chamber_counts_alone((noise, leaks) in errors()) {
            let covariance = covariance(&noise, &leaks);
            let a = Weights::only_a(&cylinder(), &noise, &leaks);
            prop_assert!(near(a.position_a, 1.0 / AREAS.x) && a.position_b == 0.0);
            prop_assert!(near(a.position_variance, covariance.m11 / AREAS.x.powi(2)));
            let b = Weights::only_b(&cylinder(), &noise, &leaks);
            prop_assert!(near(b.position_b, -1.0 / AREAS.y) && b.position_a == 0.0);
            prop_assert!(near(b.position_variance, covariance.m22 / AREAS.y.powi(2)));
            prop_assert!(a.balance_variance.is_infinite() && b.balance_variance.is_infinite());
        }
    }

    /// Var d and Var s of each block: they change, and weigh alike.
    const FLOWS: [f64; 6] = [1.0, 0.3, 2.0, 0.7, 1.2, 0.4];
    const STORED: [f64; 6] = [0.5, 1.5, 0.8, 3.0, 0.2, 1.0];

    /// The covariance of six blocks that follow each other: D + S + S' on the diagonal, −S beside it; before the first
    /// block stands a reading as noisy as the one at its end.
    fn covariance_of_blocks() -> DMatrix<f64> {
        DMatrix::from_fn(6, 6, |i, j| match i.abs_diff(j) {
            0 => FLOWS[i] + STORED[i] + STORED[i.saturating_sub(1)],
            1 => -STORED[i.min(j)],
            _ => 0.0,
        })
    }

    /// Whitening by hand is whitening by the covariance's Cholesky factor: L⁻¹ e, row by row.
    #[test]
    fn rows_are_whitened_as_by_the_covariance_of_all_blocks() {
        let left = [1.4, -0.3, 2.2, 0.6, -1.7, 0.9];
        let column = [0.2, 1.1, -0.4, 0.8, 2.0, -1.3];
        let lower = covariance_of_blocks().cholesky().unwrap().l();
        let white =
            |values: [f64; 6]| lower.solve_lower_triangular(&DVector::from_row_slice(&values)).unwrap();
        let (white_left, white_column) = (white(left), white(column));
        let mut last: Option<MovingAverage<f64, 1>> = None;
        for k in 0..6 {
            let equation = Equation { left: left[k], columns: [column[k]] };
            let now = MovingAverage::after(last.as_ref(), equation, FLOWS[k], STORED[k]);
            let row = now.whitened();
            assert!((row.left - white_left[k]).abs() < 1e-12, "block {k}: {} {}", row.left, white_left[k]);
            assert!((row.columns[0] - white_column[k]).abs() < 1e-12, "block {k}");
            assert!((now.variance().sqrt() - lower[(k, k)]).abs() < 1e-12, "block {k}");
            last = Some(now);
        }
    }
}
