//! Marginal likelihood of a linear model in closed form, its noise scale inferred.
//!
//! For columns X with prior standard deviations τ, T = diag τ, and one noise scale s_c² for each of two equations:
//!
//!   M = I + T Σ_c (X'X_c / s_c² − N_c) T,   b = T Σ_c (X'y_c / s_c² − N_yc),   χ² = Σ_c y'y_c / s_c² − b'M⁻¹b,
//!   ln p(y) = −½χ² − ½ ln|M| − ½ Σ_c n_c ln s_c² − ½ν Σ_c (ln s_c² + 1/s_c² − 1)
//!
//! (Bishop 2006, Pattern Recognition and Machine Learning, §3.5; −½ ln|M| is Occam's factor). N is what the columns' own
//! noise adds to the products, in units of the noise: without it a column of noise explains noise (errors in variables;
//! Fuller 1987, Measurement Error Models, §2.2). The scales are those of largest posterior density; an inverse-gamma
//! prior of ν degrees of freedom makes the likelihood Student's.

use super::equations::{LEAST_POWER, NormalEquations};

/// Degrees of freedom of the noise scales' prior: the declared noise is worth so many blocks. A guess.
const NU: f64 = 4.0;
/// Steps towards the scales' best values: each only changes the noise by what the fit before left over.
const STEPS: usize = 2;
/// Least variance, in the declared noise's: sensors without noise are quantised all the same.
pub(super) const LEAST_SCALE: f64 = 0.02;
/// Least square of a pivot. A column from which more noise is taken off than this leaves, beside the columns before it, is but noise.
const LEAST_PIVOT: f64 = 0.2;
/// A mean square so many standard deviations from what it should be is so by chance. Chosen: the usual three.
const CHANCE_SIGMAS: f64 = 3.0;

/// A column set free, and the standard deviation of its prior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Free {
    pub column: usize,
    pub std: f64,
}

/// What the data say of one linear model.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// ln p(y | model), up to what all models share.
    pub ln_evidence: f64,
    /// The same without Occam's factor: what more freedom can raise.
    pub ln_likelihood: f64,
    /// Noise scales s² of the balance and of the position's equation.
    pub scales: [f64; 2],
    /// Posterior means, in the columns' units.
    pub means: Vec<f64>,
    stds: Vec<f64>,
    /// Cholesky factor U of M = U'U, row by row, before a row and a column of the left side.
    factor: Vec<f64>,
}

impl Fit {
    /// Posterior covariance of some of the parameters: rows of T M⁻¹ T.
    pub fn covariance(&self, of: &[usize]) -> Vec<Vec<f64>> {
        let columns: Vec<Vec<f64>> = of.iter().map(|&i| self.half_solved(i)).collect();
        let entry = |i: usize, j: usize| {
            let dot: f64 = columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum();
            dot * self.stds[of[i]] * self.stds[of[j]]
        };
        (0..of.len()).map(|i| (0..of.len()).map(|j| entry(i, j)).collect()).collect()
    }

    /// Posterior covariances of all parameters with one.
    pub fn covariances_with(&self, i: usize) -> Vec<f64> {
        let column = self.inverse_column(i);
        column.iter().zip(&self.stds).map(|(entry, std)| entry * std * self.stds[i]).collect()
    }

    /// Whether a parameter's column, given all others, is mostly noise: then it tells nothing, and what it seems to is theirs. What is
    /// left of it is M⁻¹'s column over its diagonal, and has the power 1 / (M⁻¹)ᵢᵢ − 1, less its noise.
    pub fn is_noise(&self, equations: &NormalEquations, free: &[Free], at: usize) -> bool {
        let column = self.inverse_column(at);
        let left: Vec<(usize, f64)> = column
            .iter()
            .zip(free)
            .map(|(entry, free)| (free.column, entry / column[at] * free.std))
            .collect();
        let noise = |c: usize| -> f64 {
            let products = equations.noise(c);
            let of = |(i, by): &(usize, f64)| {
                let row = products.row(*i);
                by * left.iter().map(|(j, by)| by * row[*j]).sum::<f64>()
            };
            left.iter().map(of).sum()
        };
        1.0 / column[at] - 1.0 < (LEAST_POWER - 1.0) * (noise(0) + noise(1))
    }

    /// M⁻¹ e_i.
    fn inverse_column(&self, i: usize) -> Vec<f64> {
        let p = self.stds.len();
        let mut out = self.half_solved(i);
        for row in (0..p).rev() {
            let factor = &self.factor[row * (p + 1)..(row + 1) * (p + 1)];
            let known: f64 = factor[row + 1..p].iter().zip(&out[row + 1..]).map(|(u, entry)| u * entry).sum();
            out[row] = (out[row] - known) / factor[row];
        }
        out
    }

    /// U⁻ᵀ e_i.
    fn half_solved(&self, i: usize) -> Vec<f64> {
        let p = self.stds.len();
        let factor = |row: usize, column: usize| self.factor[row * (p + 1) + column];
        let mut out = vec![0.0; p];
        for row in i..p {
            let target = if row == i { 1.0 } else { 0.0 };
            let known: f64 = (i..row).map(|k| factor(k, row) * out[k]).sum();
            out[row] = (target - known) / factor(row, row);
        }
        out
    }
}

/// Products of the columns set free, scaled by their priors, the left side last: upper triangles.
struct Products {
    size: usize,
    gram: [Vec<f64>; 2],
    noise: [Vec<f64>; 2],
}

impl Products {
    fn of(equations: &NormalEquations, free: &[Free]) -> Self {
        let size = free.len() + 1;
        let mut out =
            Self { size, gram: [vec![0.0; size * size], vec![0.0; size * size]], noise: Default::default() };
        out.noise = out.gram.clone();
        let key = |i: usize| free.get(i).map_or((0, 1.0), |free| (free.column, free.std));
        for c in 0..2 {
            let (gram, noise) = (equations.gram(c), equations.noise(c));
            for i in 0..size {
                let (row, of_row) = key(i);
                let (gram, noise) = (gram.row(row), noise.row(row));
                for j in i..size {
                    let (column, of_column) = key(j);
                    out.gram[c][i * size + j] = of_row * of_column * gram[column];
                    out.noise[c][i * size + j] = of_row * of_column * noise[column];
                }
            }
        }
        out
    }

    /// How much of each column's noise is taken off: all, or so much that three standard deviations of the noise's own
    /// power are left of the column's.
    /// `scale` is that of the columns' noise.
    fn kept(&self, c: usize, rows: f64, scale: f64) -> Vec<f64> {
        let most = (1.0 - chance_of_mean_square(rows)).max(0.1);
        let share = |i: usize| {
            let place = i * self.size + i;
            let (noise, power) = (scale * self.noise[c][place], self.gram[c][place].max(0.0));
            if noise > most * power { (most * power / noise).sqrt() } else { 1.0 }
        };
        (0..self.size).map(share).collect()
    }

    /// Products less those of the noise, over the scale; the columns are no louder than `loudest`.
    fn clean(&self, c: usize, rows: f64, scale: f64, loudest: f64, clean: &mut [f64]) {
        let of_columns = scale.min(loudest);
        let kept = self.kept(c, rows, of_columns);
        let (over, share) = (1.0 / scale, of_columns / scale);
        for i in 0..self.size {
            let span = i * self.size + i..(i + 1) * self.size;
            let products = self.gram[c][span.clone()].iter().zip(&self.noise[c][span.clone()]);
            for ((out, (gram, noise)), kept_j) in clean[span].iter_mut().zip(products).zip(&kept[i..]) {
                *out = over * gram - share * kept[i] * kept_j * noise;
            }
        }
    }
}

/// Fits `free` to the equations' left side, which is their column 0.
///
/// The scales are sought from the readings' own scatter down: from a noise that is too quiet on, a gain that makes the rows as
/// quiet would be found as well. Scatter that would take off more than there is has more in it than noise.
pub(super) fn fit(equations: &NormalEquations, free: &[Free]) -> Fit {
    let n = equations.rows;
    let products = Products::of(equations, free);
    let size = products.size;
    let mut scales = equations.sought_from;
    let mut loudest = [f64::INFINITY; 2];
    let mut each = [vec![0.0; size * size], vec![0.0; size * size]];
    let mut factor = vec![0.0; size * size];
    let mut means = vec![0.0; free.len()];
    let mut chi_square = 0.0;
    let mut step = 0;
    while step <= STEPS {
        for c in 0..2 {
            products.clean(c, n[c], scales[c], loudest[c], &mut each[c]);
        }
        for (out, (one, other)) in factor.iter_mut().zip(each[0].iter().zip(&each[1])) {
            *out = one + other;
        }
        chi_square = solve(&mut factor, size, &mut means);
        let is_louder = scales.iter().any(|scale| *scale > 1.0);
        if step == 0 && is_louder && each.iter().any(|own| !is_sum_of_squares(own, size, &means)) {
            scales = [1.0; 2];
            continue;
        }
        if step < STEPS {
            for c in 0..2 {
                let mut left = residual(&each[c], size, &means);
                // More than there is was taken off: the misfit is no noise of the columns.
                if left < 0.0 {
                    loudest[c] = equations.loudest[c];
                    products.clean(c, n[c], scales[c], loudest[c], &mut each[c]);
                    left = residual(&each[c], size, &means);
                }
                let residual = scales[c] * left.max(0.0);
                scales[c] = ((NU + residual) / (NU + n[c])).max(LEAST_SCALE);
            }
        }
        step += 1;
    }
    let ln_scales: f64 = (0..2).map(|c| ln_scale(n[c], scales[c])).sum();
    let ln_determinant = ln_determinant(&factor, size);
    let ln_evidence = ln_scales - 0.5 * (chi_square + ln_determinant);
    Fit {
        ln_evidence: if ln_evidence.is_finite() { ln_evidence } else { f64::NEG_INFINITY },
        ln_likelihood: ln_evidence + 0.5 * ln_determinant,
        scales,
        means: means.iter().zip(free).map(|(mean, free)| mean * free.std).collect(),
        stds: free.iter().map(|free| free.std).collect(),
        factor,
    }
}

/// χ² and ln |M| where the noise has these scales, and the columns that of the readings' scatter.
pub(super) fn at_scales(equations: &NormalEquations, free: &[Free], scales: [f64; 2]) -> (f64, f64) {
    let products = Products::of(equations, free);
    let size = products.size;
    let (mut sum, mut one) = (vec![0.0; size * size], vec![0.0; size * size]);
    for (c, scale) in scales.into_iter().enumerate() {
        products.clean(c, equations.rows[c], scale, equations.loudest[c], &mut one);
        sum.iter_mut().zip(&one).for_each(|(sum, one)| *sum += one);
    }
    let chi_square = solve(&mut sum, size, &mut vec![0.0; free.len()]);
    (chi_square, ln_determinant(&sum, size))
}

/// By how much the mean of squares of so many unit normals may be off by chance: a mean square's standard deviation is √(2/n).
pub(super) fn chance_of_mean_square(rows: f64) -> f64 {
    CHANCE_SIGMAS * (2.0 / rows.max(1.0)).sqrt()
}

/// ln of what a noise scale s² of so many rows is worth, before what they leave: ln p(s²) − ½ n ln s².
pub(super) fn ln_scale(rows: f64, scale: f64) -> f64 {
    ln_scale_prior(scale) - 0.5 * rows * scale.ln()
}

/// ln of the prior density of a noise scale s², up to a constant: −½ν (ln s² + 1/s² − 1).
pub(super) fn ln_scale_prior(scale: f64) -> f64 {
    -0.5 * NU * (scale.ln() + 1.0 / scale - 1.0)
}

/// Solves (1 + X'X) θ = X'y for the scaled products, of which the last row and column are y's, and leaves Cholesky's factor
/// in their place: y'y less what the fit explains.
fn solve(products: &mut [f64], size: usize, means: &mut [f64]) -> f64 {
    let last = size - 1;
    for k in 0..last {
        let (above, below) = products.split_at_mut((k + 1) * size);
        let row = &mut above[k * size..];
        if 1.0 + row[k] < LEAST_PIVOT {
            row[k] = 1.0;
            row[k + 1..].fill(0.0);
            continue;
        }
        let pivot = (1.0 + row[k]).sqrt();
        row[k] = pivot;
        let over_pivot = 1.0 / pivot;
        row[k + 1..].iter_mut().for_each(|entry| *entry *= over_pivot);
        for (i, other) in (k + 1..size).zip(below.chunks_exact_mut(size)) {
            let by = row[i];
            for (out, entry) in other[i..].iter_mut().zip(&row[i..]) {
                *out -= by * entry;
            }
        }
    }
    for i in (0..last).rev() {
        let row = &products[i * size..(i + 1) * size];
        let known: f64 = row[i + 1..last].iter().zip(&means[i + 1..]).map(|(u, mean)| u * mean).sum();
        means[i] = (row[last] - known) / row[i];
    }
    products[last * size + last]
}

/// ln |M| by its factor.
fn ln_determinant(factor: &[f64], size: usize) -> f64 {
    (0..size - 1).map(|k| 2.0 * factor[k * size + k].ln()).sum()
}

/// Whether a fit leaves no less than nothing, and no more than there was.
fn is_sum_of_squares(products: &[f64], size: usize, means: &[f64]) -> bool {
    (0.0..=products[size * size - 1]).contains(&residual(products, size, means))
}

/// Sum of squared residuals, from products.
fn residual(products: &[f64], size: usize, means: &[f64]) -> f64 {
    let last = size - 1;
    let mut sum = products[last * size + last];
    for (i, mean) in means.iter().enumerate() {
        let row = &products[i * size..(i + 1) * size];
        let others: f64 =
            row[i + 1..last].iter().zip(&means[i + 1..]).map(|(product, other)| product * other).sum();
        sum += mean * (2.0 * (others - row[last]) + mean * row[i]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    use nalgebra::{DMatrix, DVector};

    const STDS: [f64; 3] = [0.5, 2.0, 1.5];

    /// Six rows of three columns and the left side, in units of the priors.
    fn rows() -> (DMatrix<f64>, DVector<f64>) {
        let wave = |i: usize, j: usize| ((1 + 3 * i + 7 * j) as f64).sin();
        (DMatrix::from_fn(6, 3, wave), DVector::from_fn(6, |i, _| 2.0 * wave(i, 5)))
    }

    fn solved() -> (Fit, f64, f64, Vec<f64>) {
        let (x, y) = rows();
        let all = DMatrix::from_fn(6, 4, |i, j| if j < 3 { x[(i, j)] } else { y[i] });
        let mut products: Vec<f64> = (all.transpose() * &all).iter().copied().collect();
        let (gram, mut means) = (products.clone(), [0.0; 3]);
        let chi_square = solve(&mut products, 4, &mut means);
        let ln_determinant = ln_determinant(&products, 4);
        let fit = Fit {
            ln_evidence: 0.0,
            ln_likelihood: 0.0,
            scales: [1.0; 2],
            means: means.to_vec(),
            stds: STDS.to_vec(),
            factor: products,
        };
        (fit, ln_determinant, chi_square, gram)
    }

    /// The mean and covariance of a linear model with unit priors, what it leaves, and its determinant.
    #[test]
    fn solves_as_dense_algebra() {
        let (fit, ln_determinant, chi_square, gram) = solved();
        let (x, y) = rows();
        let information = DMatrix::identity(3, 3) + x.transpose() * &x;
        let inverse = information.clone().try_inverse().expect("of full rank");
        let means = &inverse * x.transpose() * &y;
        let is_close =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        (0..3).for_each(|i| is_close(fit.means[i], means[i]));
        is_close(ln_determinant, information.determinant().ln());
        is_close(chi_square, y.dot(&y) - means.dot(&(x.transpose() * &y)));
        is_close(residual(&gram, 4, &fit.means), (&y - &x * &means).norm_squared());
        assert!(is_sum_of_squares(&gram, 4, &fit.means) && !is_sum_of_squares(&gram, 4, &[9.0; 3]));
        let covariance = fit.covariance(&[2, 0]);
        for (row, i) in [2, 0].into_iter().enumerate() {
            let column = fit.inverse_column(i);
            (0..3).for_each(|j| is_close(column[j], inverse[(i, j)]));
            for (place, j) in [2, 0].into_iter().enumerate() {
                is_close(covariance[row][place], STDS[i] * STDS[j] * inverse[(i, j)]);
            }
        }
    }

    /// A unit is likeliest; at any scale the density of n rows falls as their noise's volume grows.
    #[test]
    fn a_noise_scale_is_worth_its_prior_and_its_volume() {
        assert!(ln_scale_prior(1.0).abs() < 1e-12);
        assert!([0.1, 0.9, 1.1, 10.0].iter().all(|scale| ln_scale_prior(*scale) < 0.0));
        let each = |rows: f64| ln_scale(rows, 4.0) - ln_scale(rows, 1.0);
        assert!((each(10.0) - each(0.0) + 5.0 * 4.0_f64.ln()).abs() < 1e-12);
        assert!((chance_of_mean_square(200.0) - 0.3).abs() < 1e-12);
        assert!((chance_of_mean_square(0.0) - chance_of_mean_square(1.0)).abs() < 1e-12);
    }

    /// All of a column's noise is taken off, but where that leaves less than its chance; and no more than the
    /// loudest there is.
    #[test]
    fn noise_is_taken_off_as_far_as_there_is_power() {
        let (gram, noise) = (vec![10.0, 3.0, 0.0, 5.0], vec![1.0, 0.5, 0.0, 20.0]);
        let products = Products { size: 2, gram: [gram.clone(), gram], noise: [noise.clone(), noise] };
        // Of 200 rows a mean square is off by 0.3 by chance, of a few by 0.9 at the most.
        let kept = |rows: f64| products.kept(0, rows, 1.0);
        let share = 3.5_f64.sqrt() / 20.0_f64.sqrt();
        assert!((kept(200.0)[0] - 1.0).abs() < 1e-12 && (kept(200.0)[1] - share).abs() < 1e-12);
        assert!((kept(2.0)[1] - (0.5_f64 / 20.0).sqrt()).abs() < 1e-12);
        let mut clean = vec![0.0; 4];
        products.clean(0, 200.0, 2.0, 1.0, &mut clean);
        let expected = [4.5, 1.5 - 0.25 * share, 0.0, 0.75];
        assert!(
            clean.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12),
            "{clean:?}"
        );
    }
}
