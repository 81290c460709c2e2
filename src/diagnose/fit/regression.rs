//! Generalised least squares on the whitened rows. All fits, tests and held-out errors come from one
//! Gram matrix per piece, so that trying a candidate costs a small solve, not a pass over the data. With it the variance component of an
//! incomplete model: how far its equations are wrong.

use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{COLLINEAR_RIDGE, HALVINGS, MOST_OF, PIECES};
use crate::diagnose::weak_form::{Covariances, Rows, SharedNoise, WeakForm, Whitening};
use nalgebra::{Cholesky, DMatrix, DVector, DVectorView, Dyn};
use rayon::prelude::*;
use std::ops::Range;

/// What is known of a term beside the data, as an increment from the linearisation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prior {
    pub(crate) mean: f64,
    pub(crate) std: f64,
}

/// Whitened columns and their products.
#[derive(Clone)]
pub(crate) struct Regression {
    /// The entries of each piece.
    pub(super) pieces: [Range<usize>; PIECES],
    /// Whitened y.
    pub(crate) y: Vec<f64>,
    /// Whitened columns of length one; empty where a term does not show.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Unit column times this is the whitened column of one unit.
    pub(crate) scale: Vec<f64>,
    /// Entries that count.
    pub(crate) counted: Vec<bool>,
    /// Share of each unit column's square that is noise and stays in its Gram entry.
    pub(super) noise_share: Vec<f64>,
    grams: Vec<DMatrix<f64>>,
    pub(super) total: DMatrix<f64>,
    /// What was taken off `total` for the noise that columns share.
    pub(super) taken: DMatrix<f64>,
    /// Of each piece.
    taken_of: Vec<DMatrix<f64>>,
}

/// The entries of each piece.
pub(super) fn pieces(rows: &Rows) -> [Range<usize>; PIECES] {
    let total = rows.rows.len().max(1);
    let begin = |piece: usize| rows.entries.partition_point(|entry| entry.row * PIECES / total < piece);
    std::array::from_fn(|piece| begin(piece)..begin(piece + 1))
}

/// A fit of some terms.
pub(crate) struct Solution {
    pub(crate) terms: Vec<usize>,
    /// Increments from the linearisation, in the terms' units.
    pub(crate) value: Vec<f64>,
    pub(crate) std: Vec<f64>,
    /// Sum of squares with the priors' part.
    pub(crate) chi2: f64,
    pub(super) scaled: DVector<f64>,
    pub(super) inverse: DMatrix<f64>,
}

impl Regression {
    /// Of the rows with their pieces. The products of noise that columns share are taken off the Gram matrices, so that on average only the
    /// signals are left in them (corrected score, bias-compensated least squares: Söderström 2018, ch. 6; Stefanski 1985).
    pub(crate) fn new(
        (rows, pieces): (&Rows, [Range<usize>; PIECES]),
        whitening: &Whitening,
        shared: &SharedNoise,
    ) -> Self {
        let counted: Vec<bool> = rows.entries.iter().map(|entry| rows.counts(entry)).collect();
        let (y, columns, scale, noise_share) = (vec![], vec![], vec![], vec![]);
        let (grams, taken_of) = (vec![], vec![]);
        let (total, taken) = (DMatrix::zeros(0, 0), DMatrix::zeros(0, 0));
        let mut new = Self { pieces, y, columns, scale, counted, noise_share, grams, total, taken_of, taken };
        new.y = new.counting(whitening.whiten(&rows.y));
        let white = |column: &Vec<f64>| normalised(new.counting(whitening.whiten(column)));
        (new.columns, new.scale) = rows.columns.par_iter().map(white).unzip();
        new.grams = new.products();
        let measured = new.grams.clone();
        new.take_off(shared);
        new.total = sum_of(&new.grams);
        new.taken_of = measured.into_iter().zip(&new.grams).map(|(measured, left)| measured - left).collect();
        new.taken = sum_of(&new.taken_of);
        new
    }

    /// Columns and y.
    fn width(&self) -> usize {
        self.columns.len() + 1
    }

    /// The columns and y, in the order of the Gram matrices.
    fn all(&self) -> Vec<&[f64]> {
        self.columns.iter().chain(std::iter::once(&self.y)).map(Vec::as_slice).collect()
    }

    /// The sum over each piece.
    fn by_piece(&self, left: &[f64], right: &[f64]) -> [f64; PIECES] {
        self.pieces.clone().map(|piece| {
            let parts = left.get(piece.clone()).zip(right.get(piece));
            parts.map_or(0.0, |(u, v)| {
                DVectorView::from_slice(u, u.len()).dot(&DVectorView::from_slice(v, v.len()))
            })
        })
    }

    fn products(&self) -> Vec<DMatrix<f64>> {
        let mut grams = vec![DMatrix::zeros(self.width(), self.width()); PIECES];
        let all = self.all();
        let line = |a: usize| all[..=a].iter().map(|right| self.by_piece(all[a], right)).collect();
        let lines: Vec<Vec<[f64; PIECES]>> = (0..all.len()).into_par_iter().map(line).collect();
        for (a, line) in lines.into_iter().enumerate() {
            for (b, sums) in line.into_iter().enumerate() {
                for (gram, sum) in grams.iter_mut().zip(sums) {
                    gram[(a, b)] = sum;
                    gram[(b, a)] = sum;
                }
            }
        }
        grams
    }

    /// The same regression with another column for a term that carries none of the residual's noise.
    pub(crate) fn with_column(&self, term: usize, white: Vec<f64>) -> Self {
        let mut new = self.clone();
        (new.columns[term], new.scale[term]) = normalised(self.counting(white));
        new.noise_share[term] = 0.0;
        let products: Vec<_> =
            new.all().into_iter().map(|other| new.by_piece(&new.columns[term], other)).collect();
        for (other, sums) in products.into_iter().enumerate() {
            for (gram, sum) in new.grams.iter_mut().zip(sums) {
                gram[(term, other)] = sum;
                gram[(other, term)] = sum;
            }
        }
        for taken in new.taken_of.iter_mut().chain([&mut new.taken]) {
            taken.row_mut(term).fill(0.0);
            taken.column_mut(term).fill(0.0);
        }
        new.total = sum_of(&new.grams);
        new
    }

    /// A column with zeros where an entry does not count.
    pub(crate) fn counting(&self, white: Vec<f64>) -> Vec<f64> {
        white.into_iter().zip(&self.counted).map(|(v, counts)| if *counts { v } else { 0.0 }).collect()
    }

    /// Of columns that are the left side itself all products. Of the others that with the residual, which holds at the solution and
    /// lets the linearisations find it; their own squares stay, so that no column is left with less than nothing.
    fn take_off(&mut self, shared: &SharedNoise) {
        self.noise_share = vec![0.0; self.columns.len()];
        let y = self.columns.len();
        for column in shared.columns.iter().filter(|column| !self.columns[column.term].is_empty()) {
            let scale = self.scale[column.term];
            self.noise_share[column.term] = column.with_itself / scale.powi(2);
            for (gram, sum) in self.grams.iter_mut().zip(column.with_residual) {
                gram[(column.term, y)] -= sum / scale;
                gram[(y, column.term)] -= sum / scale;
            }
        }
        for (a, b, sums) in &shared.products {
            if self.columns[*a].is_empty() || self.columns[*b].is_empty() {
                continue;
            }
            for (gram, sum) in self.grams.iter_mut().zip(sums) {
                let taken = sum / (self.scale[*a] * self.scale[*b]);
                gram[(*a, *b)] -= taken;
                if a != b {
                    gram[(*b, *a)] -= taken;
                }
            }
        }
    }

    /// Number of entries that count.
    pub(crate) fn count(&self) -> usize {
        self.counted.iter().filter(|counts| **counts).count()
    }

    /// Whether a term shows in the data at all.
    pub(crate) fn shows(&self, term: usize) -> bool {
        !self.columns[term].is_empty()
    }

    /// Fits `terms` to all the data.
    pub(crate) fn solve(&self, terms: &[usize], priors: &[Option<Prior>]) -> Solution {
        self.solve_gram((&self.total, &self.taken), terms, priors)
    }

    /// Standard deviations by leaving out one piece at a time (Quenouille 1956, Tukey 1958): honest also
    /// where the residual is neither white nor of known size.
    pub(crate) fn jackknife(&self, terms: &[usize], priors: &[Option<Prior>]) -> Vec<f64> {
        let fits = self.leave_one_out(terms, priors);
        let of = |i: usize| jackknife_std(fits.iter().map(|fit| fit.value[i]));
        (0..fits.first().map_or(0, |fit| fit.value.len())).map(of).collect()
    }

    /// Fits without one piece each.
    pub(crate) fn leave_one_out(&self, terms: &[usize], priors: &[Option<Prior>]) -> Vec<Solution> {
        let without =
            |(gram, taken)| self.solve_gram((&(&self.total - gram), &(&self.taken - taken)), terms, priors);
        self.grams.iter().zip(&self.taken_of).map(without).collect()
    }

    /// Of a Gram matrix off which noise is taken; where less than nothing would be left of something, of what was measured.
    fn solve_gram(
        &self,
        (gram, taken): (&DMatrix<f64>, &DMatrix<f64>),
        terms: &[usize],
        priors: &[Option<Prior>],
    ) -> Solution {
        let terms: Vec<usize> = terms.iter().copied().filter(|t| self.shows(*t)).collect();
        let y = self.columns.len();
        let of =
            |all: &DMatrix<f64>| DMatrix::from_fn(terms.len(), terms.len(), |i, j| all[(terms[i], terms[j])]);
        let pull = |all: &DMatrix<f64>| DVector::from_fn(terms.len(), |i, _| all[(terms[i], y)]);
        let (mut matrix, mut right, mut chi2) = (of(gram), pull(gram), gram[(y, y)]);
        for (i, term) in terms.iter().enumerate() {
            matrix[(i, i)] += COLLINEAR_RIDGE;
            if let Some(prior) = priors[*term] {
                let weight = (self.scale[*term] * prior.std).powi(-2);
                let mean = prior.mean * self.scale[*term];
                matrix[(i, i)] += weight;
                right[i] += weight * mean;
                chi2 += weight * mean * mean;
            }
        }
        let solved = |inverse: DMatrix<f64>, right: &DVector<f64>| {
            let scaled = &inverse * right;
            (chi2 - right.dot(&scaled), scaled, inverse)
        };
        let quiet = regular_inverse(&matrix).map(|inverse| solved(inverse, &right));
        let (chi2, scaled, inverse) = quiet.filter(|(chi2, ..)| *chi2 >= 0.0).unwrap_or_else(|| {
            matrix += of(taken);
            right += pull(taken);
            solved(regular_inverse(&matrix).unwrap_or_else(|| pseudo_inverse(matrix)), &right)
        });
        let value = terms.iter().zip(scaled.iter()).map(|(t, v)| v / self.scale[*t]).collect();
        let std = terms
            .iter()
            .enumerate()
            .map(|(i, t)| self.scatter(inverse[(i, i)], *t).sqrt() / self.scale[*t])
            .collect();
        Solution { terms, value, std, chi2, scaled, inverse }
    }

    /// Variance of a unit column's size, which the Gram matrix alone gives as `quiet`: of what is new in the column only the
    /// part that is no noise tells its size.
    fn scatter(&self, quiet: f64, term: usize) -> f64 {
        let noise = (self.noise_share[term] * quiet.max(0.0)).min(MOST_OF);
        quiet.max(0.0) / (1.0 - noise).powi(2)
    }

    /// Variance of a sum of terms, each times a factor.
    pub(crate) fn variance_of(&self, solution: &Solution, parts: &[(usize, f64)]) -> f64 {
        let placed = |(term, factor): &(usize, f64)| {
            let place = solution.terms.iter().position(|one| one == term)?;
            Some((place, factor / self.scale[*term]))
        };
        let parts: Vec<(usize, f64)> = parts.iter().filter_map(placed).collect();
        let pairs = parts.iter().flat_map(|one| parts.iter().map(move |other| (one, other)));
        pairs.map(|((i, a), (j, b))| a * b * solution.inverse[(*i, *j)]).sum()
    }

    /// Whitened sum of squares of each piece under the fit to the other pieces.
    pub(crate) fn held_out(&self, terms: &[usize], priors: &[Option<Prior>]) -> Vec<f64> {
        let fits = self.leave_one_out(terms, priors);
        let of_piece = |(solution, gram): (&Solution, &DMatrix<f64>)| {
            let y = self.columns.len();
            let mut sum = gram[(y, y)];
            for (a, va) in solution.terms.iter().zip(solution.scaled.iter()) {
                sum -= 2.0 * va * gram[(*a, y)];
                for (b, vb) in solution.terms.iter().zip(solution.scaled.iter()) {
                    sum += va * vb * gram[(*a, *b)];
                }
            }
            sum
        };
        fits.iter().zip(&self.grams).map(of_piece).collect()
    }

    /// Whitened residuals of one equation, in order of time.
    pub(crate) fn innovations(&self, rows: &Rows, solution: &Solution, equation: Equation) -> Vec<f64> {
        self.innovations_by_entry(rows, solution, equation).map(|(_, value)| value).collect()
    }

    /// Innovations with the entry that each belongs to.
    pub(crate) fn innovations_by_entry<'a>(
        &'a self,
        rows: &'a Rows,
        solution: &'a Solution,
        equation: Equation,
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        let counted = move |i: &usize| rows.entries[*i].equation == equation && self.counted[*i];
        (0..self.y.len()).filter(counted).map(|i| {
            let fit = solution.terms.iter().zip(solution.scaled.iter());
            (i, self.y[i] - fit.map(|(term, v)| v * self.columns[*term][i]).sum::<f64>())
        })
    }
}

fn sum_of(grams: &[DMatrix<f64>]) -> DMatrix<f64> {
    let width = grams.first().map_or(0, DMatrix::nrows);
    grams.iter().fold(DMatrix::zeros(width, width), |sum, gram| sum + gram)
}

/// A column of length one, empty where it does not show, and its length.
pub(crate) fn normalised(mut column: Vec<f64>) -> (Vec<f64>, f64) {
    let length = column.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !(length.is_finite() && length > 0.0) {
        return (vec![], 1.0);
    }
    column.iter_mut().for_each(|v| *v /= length);
    (column, length)
}

/// Standard deviation of an estimate from its values without one piece each.
pub(crate) fn jackknife_std(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = PIECES as f64;
    let mean = values.clone().sum::<f64>() / n;
    ((n - 1.0) / n * values.map(|value| (value - mean).powi(2)).sum::<f64>()).sqrt()
}

fn regular_inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    Cholesky::new(matrix.clone()).map(|factor: Cholesky<f64, Dyn>| factor.inverse())
}

fn pseudo_inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    matrix.pseudo_inverse(1e-12).unwrap_or_else(|_| DMatrix::zeros(n, n))
}

/// The residual of each entry, in the equation's own unit times seconds.
pub(crate) fn residual(rows: &Rows, solution: &Solution) -> Vec<f64> {
    let mut residual = rows.y.clone();
    for (term, value) in solution.terms.iter().zip(&solution.value) {
        for (cell, column) in residual.iter_mut().zip(&rows.columns[*term]) {
            *cell -= value * column;
        }
    }
    residual
}

/// Equation error with which the residual would be as large as the noise says, so that neither priors nor weak effects
/// are overrun by it; zero where the residual can be the sensors' noise: no absurd leak may bring what excuses it. By bisection.
pub(super) fn equation_error(
    weak_form: &WeakForm<'_>,
    regression: &Regression,
    solution: &Solution,
) -> PerEquation<f64> {
    let rows = &weak_form.rows;
    let residual = residual(rows, solution);
    let counts =
        PerEquation::from_fn(|equation| regression.innovations(rows, solution, equation).len().max(1) as f64);
    let levels = |covariances: &Covariances, equation_error: PerEquation<f64>| {
        let white = Whitening::of(covariances, &equation_error).whiten(&residual);
        let mut squares = PerEquation::<f64>::default();
        for (entry, e) in rows.entries.iter().zip(&white).filter(|(entry, _)| rows.counts(entry)) {
            squares[entry.equation] += e * e;
        }
        squares.zip(counts, |sum, count| sum / count)
    };
    let sensors_only = levels(&weak_form.credible_covariances(), PerEquation::default());
    let mut high = PerEquation::from_fn(|equation| {
        let by_chance = statistics::chance_of_variance(counts[equation]);
        if sensors_only[equation] <= 1.0 + by_chance {
            return 0.0;
        }
        let own = rows.entries.iter().zip(&residual);
        let own = own.filter(|(entry, _)| entry.equation == equation && rows.counts(entry));
        let noise = weak_form.noise(PerEquation::default());
        4.0 * own.map(|(entry, v)| noise.as_white(&rows.rows[entry.row], v * v)).sum::<f64>()
            / counts[equation]
    });
    if high.iter().all(|(_, error)| *error <= 0.0) {
        return high;
    }
    let covariances = weak_form.covariances(high);
    let mut low = PerEquation::<f64>::default();
    for _ in 0..HALVINGS {
        let middle = low.zip(high, |low, high| (low + high) / 2.0);
        let level = levels(&covariances, middle);
        for equation in Equation::ALL {
            let end = if level[equation] > 1.0 { &mut low } else { &mut high };
            end[equation] = middle[equation];
        }
    }
    high
}
