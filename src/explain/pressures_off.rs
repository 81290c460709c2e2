//! What leaks are where pressure sensors are off as they usually are.
//!
//! A leak C P behind sensors off by z flows C (P + z): more than its column says by k = G z, as steady as the flow meters'
//! zeros f. With Λ the prior's precision of f, Σ its posterior covariance and c that of the leaks with it, a fit takes the share
//! −c Λ of k for the leaks, and z itself has the posterior
//!
//!   P = σ_z⁻² + G'(Λ − ΛΣΛ)G,   ẑ = P⁻¹G'Λ f̂:
//!
//! what G as columns of their own, with a prior σ_z, would have.

use super::columns::{Column, Course};
use super::equations::NormalEquations;
use super::evidence::Fit;
use super::hypothesis::Hypothesis;
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

/// Zeros of the flow meters as a fit has them, in the unit of its leaks.
pub(super) struct MeterZeros {
    pub means: Vector2<f64>,
    pub covariance: Matrix2<f64>,
    /// Standard deviations of their prior.
    pub prior_stds: Vector2<f64>,
    /// Covariances of each leak at the trace's end with them.
    pub with_leaks: Matrix3x2<f64>,
}

impl MeterZeros {
    /// Of a fit, where `units` are those of the meters' zeros in that of leaks. Of one that is not free nothing is known.
    pub fn of(fit: &Fit, hypothesis: &Hypothesis<'_>, equations: &NormalEquations, units: [f64; 2]) -> Self {
        let place = |zero: Column| hypothesis.place(equations, zero, Course::Constant);
        let places = [Column::ZeroA, Column::ZeroB].map(place);
        let mut zeros = Self {
            means: Vector2::zeros(),
            covariance: Matrix2::identity(),
            prior_stds: Vector2::repeat(1.0),
            with_leaks: Matrix3x2::zeros(),
        };
        for (meter, place) in places.into_iter().enumerate() {
            let Some(at) = place else { continue };
            let covariances = fit.covariances_with(at);
            zeros.means[meter] = units[meter] * fit.means[at];
            zeros.prior_stds[meter] = units[meter] * hypothesis.free[at].std;
            for (other, place) in places.into_iter().enumerate() {
                zeros.covariance[(other, meter)] =
                    place.map_or(0.0, |place| units[meter] * units[other] * covariances[place]);
            }
            for (leak, ends) in hypothesis.ends.iter().enumerate() {
                let with = ends.iter().map(|(end, sign)| sign * covariances[hypothesis.positive[*end]]);
                zeros.with_leaks[(leak, meter)] = units[meter] * with.sum::<f64>();
            }
        }
        zeros
    }
}

/// Zeros of the pressure sensors beside those of the flow meters, Pa.
pub(super) struct PressuresOff {
    mean_pa: Vector2<f64>,
    /// R with RR' = P⁻¹.
    root_pa: Matrix2<f64>,
    /// Shares of a steady flow out of each chamber that a fit takes for each leak.
    taken: Matrix3x2<f64>,
}

/// How much more there is across each leak than is read, of sensors that are so far below their pressures.
pub(super) fn across([a, b]: [f64; 2]) -> Vector3<f64> {
    Vector3::new(a - b, a, b)
}

/// G: flow out of each chamber for what each sensor is below its pressure, with coefficients C of each leak.
fn steady(coefficients: &Vector3<f64>) -> Matrix2<f64> {
    let [internal, a, b] = (*coefficients).into();
    Matrix2::new(internal + a, -internal, -internal, internal + b)
}

impl PressuresOff {
    /// Beside leaks of these coefficients, flow per Pa, of sensors that are off by `usual_pa`.
    pub fn new(zeros: &MeterZeros, coefficients: &Vector3<f64>, usual_pa: Vector2<f64>) -> Self {
        let precision = Matrix2::from_diagonal(&zeros.prior_stds.map(|std| std.powi(-2)));
        let unit = Matrix2::from_diagonal(&usual_pa);
        let flow = steady(coefficients) * unit;
        let told = flow.transpose() * (precision - precision * zeros.covariance * precision) * flow;
        let taken = -zeros.with_leaks * precision;
        let factor = (Matrix2::identity() + told).cholesky();
        let root = factor.and_then(|factor| Some((factor.l().transpose().try_inverse()?, factor)));
        let Some((root, factor)) = root else {
            return Self { mean_pa: Vector2::zeros(), root_pa: unit, taken };
        };
        let mean = factor.solve(&(flow.transpose() * precision * zeros.means));
        Self { mean_pa: unit * mean, root_pa: unit * root, taken }
    }

    /// How much more than as fitted each leak flows, where the mean size of the pressure past the piston follows its mean so far
    /// and the zeros are so many standard deviations off.
    pub fn more(&self, coefficients: &Vector3<f64>, follows: f64, normals: [f64; 2]) -> Vector3<f64> {
        let off_pa = self.mean_pa + self.root_pa * Vector2::from(normals);
        let mut across_pa = across(off_pa.into());
        across_pa[0] *= follows;
        coefficients.component_mul(&across_pa) - self.taken * (steady(coefficients) * off_pa)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    const USUAL_PA: [f64; 2] = [0.5, 0.8];

    /// Mean and covariance of a linear model's parameters, of unit noise and such a prior.
    fn posterior(x: &DMatrix<f64>, y: &DVector<f64>, stds: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let prior =
            DMatrix::from_diagonal(&DVector::from_iterator(stds.len(), stds.iter().map(|s| s.powi(-2))));
        let covariance = (x.transpose() * x + prior).try_inverse().expect("a prior for each");
        (&covariance * x.transpose() * y, covariance)
    }

    /// Three leaks and two zeros, then with what two sensors off add to the zeros' columns.
    #[test]
    fn sensors_are_off_as_columns_of_their_own_would_be() {
        let wave = |i: usize, j: usize| ((1 + 3 * i + 7 * j) as f64).sin();
        let (x, y) = (DMatrix::from_fn(40, 5, wave), DVector::from_fn(40, |i, _| 3.0 * wave(i, 9)));
        let (stds, coefficients) = ([1.0, 1.0, 1.0, 0.3, 0.2], Vector3::new(0.7, 0.2, 0.4));
        let (means, covariance) = posterior(&x, &y, &stds);
        let zeros = MeterZeros {
            means: Vector2::new(means[3], means[4]),
            covariance: covariance.fixed_view::<2, 2>(3, 3).into(),
            prior_stds: Vector2::new(stds[3], stds[4]),
            with_leaks: covariance.fixed_view::<3, 2>(0, 3).into(),
        };
        let found = PressuresOff::new(&zeros, &coefficients, USUAL_PA.into());

        let g = DMatrix::from_row_slice(2, 2, &[0.9, -0.7, -0.7, 1.1]);
        let more = x.columns(3, 2) * &g;
        let wide = DMatrix::from_fn(40, 7, |i, j| if j < 5 { x[(i, j)] } else { more[(i, j - 5)] });
        let (own_means, own) = posterior(&wide, &y, &[&stds[..], &USUAL_PA].concat());
        let is_close =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        let square = found.root_pa * found.root_pa.transpose();
        for i in 0..2 {
            is_close(found.mean_pa[i], own_means[5 + i]);
            (0..2).for_each(|j| is_close(square[(i, j)], own[(5 + i, 5 + j)]));
        }
        let moved = found.more(&coefficients, 0.6, [0.0; 2]);
        let off = found.mean_pa;
        let across = [0.6 * (off[0] - off[1]), off[0], off[1]];
        for i in 0..3 {
            is_close(means[i] + moved[i], own_means[i] + coefficients[i] * across[i]);
        }
    }

    /// Of meters whose zeros are known all that a leak flows is seen, of others only what follows its pressure.
    #[test]
    fn beside_known_zeros_a_leak_is_what_flows() {
        let (mean_pa, flow) = (2.0, 4.0);
        let coefficients = Vector3::new(0.0, flow / mean_pa, 0.0);
        let follows = |i: usize| 1.0 + 0.1 * (i as f64).sin();
        let more = |std: f64| {
            let x = DMatrix::from_fn(400, 2, |i, j| if j == 0 { follows(i) } else { 1.0 });
            let y = DVector::from_fn(400, |i, _| flow * follows(i));
            let (means, covariance) = posterior(&x, &y, &[5.0, std]);
            let mut zeros = MeterZeros {
                means: Vector2::new(means[1], 0.0),
                covariance: Matrix2::new(covariance[(1, 1)], 0.0, 0.0, std.powi(2)),
                prior_stds: Vector2::repeat(std),
                with_leaks: Matrix3x2::zeros(),
            };
            zeros.with_leaks[(1, 0)] = covariance[(0, 1)];
            PressuresOff::new(&zeros, &coefficients, USUAL_PA.into()).more(&coefficients, 1.0, [1.0, 0.0])[1]
        };
        let off = coefficients[1] * USUAL_PA[0];
        assert!((more(1e3) / off - 1.0).abs() < 0.05, "{}", more(1e3));
        assert!(more(1e-3).abs() < 0.05 * off, "{}", more(1e-3));
    }
}
