use super::equation::Equation;
use crate::Real;

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
    use nalgebra::{DMatrix, DVector};

    /// Var d and Var s of each block: they change, and weigh alike.
    const FLOWS: [f64; 6] = [1.0, 0.3, 2.0, 0.7, 1.2, 0.4];
    const STORED: [f64; 6] = [0.5, 1.5, 0.8, 3.0, 0.2, 1.0];

    /// The covariance of six blocks that follow each other: D + S + S' on the diagonal, −S beside it; before the first
    /// block stands a reading as noisy as the one at its end.
    fn covariance() -> DMatrix<f64> {
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
        let lower = covariance().cholesky().unwrap().l();
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
