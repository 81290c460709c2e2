//! Leaks cannot be negative: the normal distribution on the positive orthant, its probability and a sample of it.
//!
//! Separation of variables (Genz 1992, "Numerical computation of multivariate normal probabilities", J. Comput. Graph.
//! Stat. 1, 141): with C = L L' each variable in turn is drawn from its normal cut off at zero given those before, which
//! are weighed with the probability of the cut. Points are Richtmyer's: multiples of square roots of primes.

use statrs::function::erf::{erfc, erfc_inv};
use std::f64::consts::{PI, SQRT_2};
use std::sync::LazyLock;

/// Points of a sample: the probability is known to a percent or so.
pub(crate) const POINTS: usize = 512;
/// The same of what weighs little: to ten percent or so.
pub(super) const FEW_POINTS: usize = 64;
/// Variables at the most: three of each leak.
pub(super) const MOST: usize = 9;
const PRIMES: [f64; 12] = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0, 37.0];
/// A sample worth fewer points than this is drawn anew; numerical.
const LEAST_POINTS: f64 = 20.0;
/// Sweeps until a sample has forgotten where it began; numerical.
const GIBBS_BURN_IN: usize = 64;
/// Below such a tail its first asymptotic term serves.
const LEAST_TAIL: f64 = 1e-12;

/// A weighted sample.
pub(crate) struct Orthant {
    /// ln of the probability of the positive orthant.
    pub ln_probability: f64,
    /// Points: their variables, zero behind the last.
    pub points: Vec<[f64; MOST]>,
    /// Their weights, of sum 1.
    pub weights: Vec<f64>,
}

/// Coordinate of a point in the unit cube.
fn uniform(point: usize, dimension: usize) -> f64 {
    let step = PRIMES[dimension % PRIMES.len()].sqrt();
    ((point as f64 + 0.5) * step).fract().clamp(1e-9, 1.0 - 1e-9)
}

/// Quantile of the standard normal.
fn normal_quantile(probability: f64) -> f64 {
    -SQRT_2 * erfc_inv(2.0 * probability)
}

/// Standard normals beside a sample of leaks, independent of its points and of each other.
pub(super) static NORMALS: LazyLock<Vec<[f64; MOST]>> = LazyLock::new(|| {
    let strides = [197, 197, 197, 59, 59, 59, 83, 83, 83];
    let normal = |point: usize, i: usize| normal_quantile(uniform((point * strides[i]) % POINTS, 8 + i));
    (0..POINTS).map(|point| std::array::from_fn(|i| normal(point, i))).collect()
});

/// ln of at the most what N(`means`, `covariance`) has in the positive orthant: −½d², where d is how many standard deviations off it
/// is (Chernoff's bound, for a convex set), as far as one or two variables tell. By the dual problem, max −½λ'Σλ − λ'μ over λ ≥ 0,
/// of which every λ is a bound.
pub(super) fn ln_most(means: &[f64], covariance: &[Vec<f64>]) -> f64 {
    let one = |i: usize| if means[i] < 0.0 { -0.5 * means[i] * means[i] / covariance[i][i] } else { 0.0 };
    let two = |i: usize, j: usize| {
        let (own, other, both) = (covariance[i][i], covariance[j][j], covariance[i][j]);
        let determinant = own * other - both * both;
        let lambda = [both * means[j] - other * means[i], both * means[i] - own * means[j]];
        let is_bound = determinant > 0.0 && lambda.iter().all(|lambda| *lambda > 0.0);
        if is_bound { 0.5 * (lambda[0] * means[i] + lambda[1] * means[j]) / determinant } else { 0.0 }
    };
    let pairs = (0..means.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
    pairs.map(|(i, j)| if i == j { one(i) } else { two(i, j) }).fold(0.0, f64::min)
}

/// N(`means`, `covariance`), of `MOST` variables or fewer, where every one is positive; a sample of `count` points.
pub(crate) fn positive_orthant(means: &[f64], covariance: &[Vec<f64>], count: usize) -> Orthant {
    // What is furthest below zero is drawn first: what follows is drawn given it.
    let mut order: Vec<usize> = (0..means.len()).collect();
    let height = |i: &usize| means[*i] / covariance[*i][*i].sqrt();
    order.sort_by(|i, j| height(i).total_cmp(&height(j)));
    let sorted: Vec<f64> = order.iter().map(|&i| means[i]).collect();
    let turned: Vec<Vec<f64>> =
        order.iter().map(|&i| order.iter().map(|&j| covariance[i][j]).collect()).collect();
    let mut found = sorted_orthant(&sorted, &turned, count);
    if found.independent() < LEAST_POINTS * count as f64 / POINTS as f64 {
        found = Orthant { ln_probability: found.ln_probability, ..gibbs(&sorted, &turned, &found) };
    }
    for point in &mut found.points {
        let sorted = *point;
        order.iter().zip(sorted).for_each(|(&place, value)| point[place] = value);
    }
    found
}

impl Orthant {
    /// How many points of equal weight its sample is worth.
    fn independent(&self) -> f64 {
        1.0 / self.weights.iter().map(|weight| weight * weight).sum::<f64>()
    }
}

/// A sample of equal weights where that of the separation of variables degenerates: each variable in turn given all
/// others (Gibbs; Geweke 1991, "Efficient simulation from the multivariate normal subject to linear constraints").
fn gibbs(means: &[f64], covariance: &[Vec<f64>], from: &Orthant) -> Orthant {
    let k = means.len();
    let heaviest = (0..from.points.len()).max_by(|&i, &j| from.weights[i].total_cmp(&from.weights[j]));
    let mut point = heaviest.map_or([0.0; MOST], |place| from.points[place]);
    let matrix = nalgebra::DMatrix::from_fn(k, k, |i, j| covariance[i][j]);
    let Some(precision) = matrix.cholesky().map(|factor| factor.inverse()) else {
        return Orthant { ln_probability: 0.0, points: from.points.clone(), weights: from.weights.clone() };
    };
    let count = from.points.len();
    let mut points = Vec::with_capacity(count);
    for sweep in 0..GIBBS_BURN_IN + count {
        for i in 0..k {
            let others: f64 =
                (0..k).filter(|&j| j != i).map(|j| precision[(i, j)] * (point[j] - means[j])).sum();
            let given = means[i] - others / precision[(i, i)];
            let own = precision[(i, i)].sqrt().recip();
            let (normal, _) = above(-given / own, 1.0 - uniform(sweep, i));
            point[i] = (given + own * normal).max(0.0);
        }
        if sweep >= GIBBS_BURN_IN {
            points.push(point);
        }
    }
    Orthant { ln_probability: 0.0, points, weights: vec![1.0 / count as f64; count] }
}

/// A standard normal above `least`, of which `share` lies above it, and ln of the probability of being there.
fn above(least: f64, share: f64) -> (f64, f64) {
    let tail = 0.5 * erfc(least / SQRT_2);
    if tail > LEAST_TAIL {
        (-normal_quantile(tail * share), tail.ln())
    } else {
        (least - share.ln() / least, -0.5 * least * least - (least * (2.0 * PI).sqrt()).ln())
    }
}

fn sorted_orthant(means: &[f64], covariance: &[Vec<f64>], count: usize) -> Orthant {
    let factor = cholesky(covariance);
    let mut points = Vec::with_capacity(count);
    let mut ln_weights = Vec::with_capacity(count);
    for point in 0..count {
        let (values, ln_weight) = draw(point, means, &factor);
        points.push(values);
        ln_weights.push(ln_weight);
    }
    let largest = ln_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = ln_weights.iter().map(|ln| (ln - largest).exp()).collect();
    let sum: f64 = weights.iter().sum();
    Orthant {
        ln_probability: largest + (sum / count as f64).ln(),
        points,
        weights: weights.iter().map(|weight| weight / sum).collect(),
    }
}

fn draw(point: usize, means: &[f64], factor: &[Vec<f64>]) -> ([f64; MOST], f64) {
    let mut normals = [0.0; MOST];
    let mut values = [0.0; MOST];
    let mut ln_weight = 0.0;
    for (i, mean) in means.iter().enumerate() {
        let given: f64 = mean + factor[i][..i].iter().zip(&normals).map(|(l, z)| l * z).sum::<f64>();
        let own = factor[i][i];
        let (normal, ln_tail) = above(-given / own, 1.0 - uniform(point, i));
        ln_weight += ln_tail;
        normals[i] = normal;
        values[i] = (given + own * normal).max(0.0);
    }
    (values, ln_weight)
}

fn cholesky(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut factor: Vec<Vec<f64>> = Vec::with_capacity(matrix.len());
    for (i, row) in matrix.iter().enumerate() {
        let mut new = vec![0.0; i + 1];
        for j in 0..=i {
            let other = if j == i { &new } else { &factor[j] };
            let dot: f64 = new[..j].iter().zip(&other[..j]).map(|(a, b)| a * b).sum();
            let value = row[j] - dot;
            new[j] = if i == j { value.max(1e-18).sqrt() } else { value / factor[j][j] };
        }
        factor.push(new);
    }
    factor
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brute force on a grid, in two and three dimensions.
    fn by_quadrature(means: &[f64], covariance: &[Vec<f64>]) -> (f64, f64) {
        let k = means.len();
        let matrix = nalgebra::DMatrix::from_fn(k, k, |i, j| covariance[i][j]);
        let inverse = matrix.clone().try_inverse().unwrap();
        let norm = ((2.0 * PI).powi(k as i32) * matrix.determinant()).sqrt();
        let steps: usize = if k == 2 { 1500 } else { 180 };
        let ranges: Vec<f64> = (0..k).map(|i| means[i].max(0.0) + 7.0 * covariance[i][i].sqrt()).collect();
        let cell: f64 = ranges.iter().map(|range| range / steps as f64).product();
        let (mut sum, mut first) = (0.0, 0.0);
        for index in 0..steps.pow(k as u32) {
            let mut rest = index;
            let x = nalgebra::DVector::from_fn(k, |i, _| {
                let at = rest % steps;
                rest /= steps;
                (at as f64 + 0.5) / steps as f64 * ranges[i]
            });
            let off = nalgebra::DVector::from_fn(k, |i, _| x[i] - means[i]);
            let density = (-0.5 * (off.transpose() * &inverse * &off).x).exp() / norm;
            sum += density * cell;
            first += density * cell * x[0];
        }
        (sum, first / sum)
    }

    #[test]
    fn probability_and_mean_are_those_of_quadrature() {
        let cases = [
            (vec![0.3, -0.2], vec![vec![1.0, 0.6], vec![0.6, 2.0]]),
            (vec![-1.5, 1.0], vec![vec![1.0, -0.8], vec![-0.8, 1.0]]),
            (vec![0.5, -0.4, 0.1], vec![vec![1.0, 0.3, -0.2], vec![0.3, 0.5, 0.1], vec![-0.2, 0.1, 1.5]]),
            (vec![-1.0, 0.2, 2.0], vec![vec![1.0, 0.7, 0.2], vec![0.7, 1.0, 0.5], vec![0.2, 0.5, 2.0]]),
        ];
        for (means, covariance) in cases {
            let found = positive_orthant(&means, &covariance, POINTS);
            let (probability, mean) = by_quadrature(&means, &covariance);
            let first: f64 = found.points.iter().zip(&found.weights).map(|(p, w)| p[0] * w).sum();
            assert!(
                (found.ln_probability - probability.ln()).abs() < 0.02,
                "{} {}",
                found.ln_probability.exp(),
                probability
            );
            assert!((first - mean).abs() < 0.02 * mean.max(0.5), "{first} {mean}");
            assert!(ln_most(&means, &covariance) >= probability.ln());
        }
    }

    /// Two that are each near zero and cannot be positive together: one by one hardly off, together six standard deviations.
    #[test]
    fn the_bound_knows_what_cannot_be_positive_together() {
        let (means, covariance) = (vec![0.1, -0.7], vec![vec![1.0, -0.995], vec![-0.995, 1.0]]);
        let bound = ln_most(&means, &covariance);
        let (probability, _) = by_quadrature(&means, &covariance);
        assert!(bound >= probability.ln() && bound < -15.0, "{bound} {}", probability.ln());
        assert!(ln_most(&[1.0, 0.5], &covariance).abs() < 1e-12);
        assert!((ln_most(&[-3.0], &[vec![4.0]]) + 9.0 / 8.0).abs() < 1e-12);
    }

    /// Far out in the tail the sample stays on the right side, and its probability finite.
    #[test]
    fn far_tails_are_finite() {
        let found = positive_orthant(&[-30.0], &[vec![1.0]], POINTS);
        let expected = -450.0 - (30.0 * (2.0 * PI).sqrt()).ln();
        assert!((found.ln_probability - expected).abs() < 0.01, "{}", found.ln_probability);
        assert!(found.points.iter().all(|point| point[0] >= 0.0 && point[0] < 1.0));
    }

    /// Drawn one by one given the others, the sample has the same mean and as many points.
    #[test]
    fn a_sample_drawn_anew_has_the_mean_of_quadrature() {
        let (means, covariance) = (vec![0.5, -0.4], vec![vec![1.0, 0.6], vec![0.6, 2.0]]);
        let from = positive_orthant(&means, &covariance, POINTS);
        let found = gibbs(&means, &covariance, &from);
        assert_eq!((found.points.len(), found.weights.len()), (POINTS, POINTS));
        assert!((found.independent() / POINTS as f64 - 1.0).abs() < 1e-9);
        let mean = found.points.iter().map(|point| point[0]).sum::<f64>() / POINTS as f64;
        let (_, expected) = by_quadrature(&means, &covariance);
        assert!((mean - expected).abs() < 0.05 * expected, "{mean} {expected}");
    }
}
