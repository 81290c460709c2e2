//! The inverse square root of the rows' covariance: a narrow band, so that whitening by its Cholesky factor takes
//! linear time; it is the Kalman filter's innovation form of the same regression.

use super::noise_model::{HatWeights, NoiseModel, hat_weights};
use super::rows::Rows;
use crate::diagnose::thresholds::LEAST_PIVOT;

/// Entries to the left of the diagonal that can be correlated: three of the row before, two of the own.
const BAND: usize = 5;

/// Σ = L Lᵀ, banded; `factor[i][d]` is L_{i,i−d}.
pub(crate) struct Whitening {
    factor: Vec<[f64; BAND + 1]>,
}

impl Whitening {
    pub(crate) fn new(rows: &Rows, noise: &NoiseModel<'_>) -> Self {
        let mut factor: Vec<[f64; BAND + 1]> = Vec::with_capacity(rows.entries.len());
        let mut known = (0, HatWeights::default());
        for (i, entry) in rows.entries.iter().enumerate() {
            let samples = rows.rows[entry.row].samples;
            if known.0 != samples {
                known = (samples, hat_weights(samples));
            }
            let mut line = [0.0; BAND + 1];
            for d in (0..=BAND.min(i)).rev() {
                let covariance = noise.between(i, i - d, known.1);
                // L_{i,j} = (Σ_{i,j} − Σ_{l<j} L_{i,l} L_{j,l}) / L_{j,j}
                let done: f64 = (1..=BAND - d)
                    .filter(|e| i >= d + e)
                    .map(|e| line[d + e] * if d == 0 { line[e] } else { factor[i - d][e] })
                    .sum();
                let rest = covariance - done;
                line[d] = match d {
                    0 => rest.max(LEAST_PIVOT * covariance).sqrt(),
                    _ => rest / factor[i - d][0],
                };
            }
            factor.push(line);
        }
        Self { factor }
    }

    /// L⁻¹ v.
    pub(crate) fn whiten(&self, v: &[f64]) -> Vec<f64> {
        let mut out: Vec<f64> = Vec::with_capacity(v.len());
        for (i, (line, value)) in self.factor.iter().zip(v).enumerate() {
            let before: f64 = (1..=BAND.min(i)).map(|d| line[d] * out[i - d]).sum();
            out.push((value - before) / line[0]);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::equation::PerEquation;
    use crate::diagnose::testing::{declared, sound};
    use crate::diagnose::weak_form::{Linearisation, WeakForm, residual_rows};
    use nalgebra::{DMatrix, DVector};
    use pitchleak_testkit::white_noise;

    #[test]
    fn whitening_is_that_of_a_dense_cholesky_factor() {
        let declared = declared();
        let at = Linearisation::declared(&declared);
        let rows = residual_rows(&[sound(5), sound(3)], &declared.sensors, &at, 0.1);
        let equation_error = PerEquation { chamber_a: 1e-14, chamber_b: 0.0, force: 0.0 };
        let sensitivities = WeakForm::sensitivities(&rows, &declared.sensors, &at);
        let (sensors, sensitivities) = (&declared.sensors, sensitivities.as_slice());
        let noise = NoiseModel { at: &at, sensors, equation_error, rows: &rows, sensitivities };
        let n = rows.entries.len();
        let hats = hat_weights(rows.rows[0].samples);
        let dense = DMatrix::from_fn(n, n, |i, j| noise.between(i.max(j), i.min(j), hats));
        let factor = dense.cholesky().expect("a covariance");
        let v: Vec<f64> = white_noise(1).take(n).collect();
        let expected = factor.l().solve_lower_triangular(&DVector::from_vec(v.clone())).expect("regular");
        let white = Whitening::new(&rows, &noise).whiten(&v);
        let worst = white.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(n > 100 && worst < 1e-9 * expected.amax(), "{worst} of {}", expected.amax());
    }
}
