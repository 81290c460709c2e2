//! Generalised least squares on the whitened rows. All fits, tests and held-out errors come from one
//! Gram matrix per fold, so that trying a candidate costs a small solve, not a pass over the data.

use super::noise::{SharedNoise, Whitening};
use super::rows::{Balance, Rows};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Held-out parts of the data.
pub(super) const FOLDS: usize = 5;
/// The traces are cut into so many pieces; fold f is every fifth piece from f.
pub(super) const PIECES: usize = 4 * FOLDS;
/// What is left of a column after the others explain it, below which it tells nothing new.
const LEAST_NEW_SHARE: f64 = 1e-8;

/// What is known of a term beside the data, as an increment from the point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    pub(super) mean: f64,
    pub(super) std: f64,
}

/// Whitened columns and their products.
pub(super) struct Regression {
    piece_of: Vec<usize>,
    /// Whitened y.
    pub(super) y: Vec<f64>,
    /// Whitened columns of length one; empty where a term does not show.
    pub(super) columns: Vec<Vec<f64>>,
    /// Unit column times this is the whitened column of one unit.
    pub(super) scale: Vec<f64>,
    /// Entries that count.
    pub(super) counted: Vec<bool>,
    grams: Vec<DMatrix<f64>>,
    total: DMatrix<f64>,
}

/// A fit of some terms.
pub(super) struct Solution {
    pub(super) terms: Vec<usize>,
    /// Increments from the point, in the terms' units.
    pub(super) value: Vec<f64>,
    pub(super) std: Vec<f64>,
    /// Sum of squares with the priors' part.
    pub(super) chi2: f64,
    scaled: DVector<f64>,
    inverse: DMatrix<f64>,
}

/// What a further term would bring.
#[derive(Clone, Copy, Debug)]
pub(super) struct Score {
    pub(super) term: usize,
    /// By how much the sum of squares falls.
    pub(super) gain: f64,
    /// Its increment and standard deviation.
    pub(super) value: f64,
    pub(super) std: f64,
}

/// A column outside the regression, and what a solution's terms explain of it.
pub(super) struct Prepared {
    unit: Vec<f64>,
    scale: f64,
    cross: DVector<f64>,
    explained: DVector<f64>,
    fresh: f64,
}

impl Prepared {
    /// Standard deviation of its size beside the solution's terms.
    pub(super) fn std(&self) -> f64 {
        1.0 / self.fresh.sqrt() / self.scale
    }

    /// Correlation of what is new in two columns.
    pub(super) fn correlation(&self, other: &Self) -> f64 {
        let product = self.unit.iter().zip(&other.unit).map(|(a, b)| a * b).sum::<f64>();
        (product - self.cross.dot(&other.explained)) / (self.fresh * other.fresh).sqrt()
    }
}

impl Regression {
    /// `shared` are realisations of the noise that columns share with the residual. Their mean products
    /// are taken off the Gram matrices, so that on average only the signals are left in them (corrected
    /// score, bias-compensated least squares: Söderström 2018, ch. 6; Stefanski 1985).
    pub(super) fn new(rows: &Rows, whitening: &Whitening, shared: &[SharedNoise]) -> Self {
        let counted: Vec<bool> = rows.entries.iter().map(|entry| rows.counts(entry)).collect();
        let keep = |mut white: Vec<f64>| {
            white.iter_mut().zip(&counted).filter(|(_, counts)| !**counts).for_each(|(v, _)| *v = 0.0);
            white
        };
        let y = keep(whitening.whiten(&rows.y));
        let (mut columns, mut scale) = (Vec::new(), Vec::new());
        for column in &rows.columns {
            let (unit, length) = normalised(keep(whitening.whiten(column)));
            columns.push(unit);
            scale.push(length);
        }
        let total_rows = rows.rows.len().max(1);
        let piece_of: Vec<usize> = rows.entries.iter().map(|e| e.row * PIECES / total_rows).collect();
        let mut new =
            Self { piece_of, y, columns, scale, counted, grams: vec![], total: DMatrix::zeros(0, 0) };
        new.grams = new.products();
        for noise in shared {
            new.take_off(noise, whitening, 1.0 / shared.len() as f64);
        }
        new.total = new.grams.iter().fold(DMatrix::zeros(new.width(), new.width()), |sum, gram| sum + gram);
        new
    }

    /// Columns and y.
    fn width(&self) -> usize {
        self.columns.len() + 1
    }

    fn products(&self) -> Vec<DMatrix<f64>> {
        let mut grams = vec![DMatrix::zeros(self.width(), self.width()); PIECES];
        let all: Vec<&[f64]> =
            self.columns.iter().chain(std::iter::once(&self.y)).map(Vec::as_slice).collect();
        for (a, left) in all.iter().enumerate() {
            for (b, right) in all.iter().enumerate().take(a + 1) {
                for ((u, v), piece) in left.iter().zip(*right).zip(&self.piece_of) {
                    grams[*piece][(a, b)] += u * v;
                }
                for gram in &mut grams {
                    gram[(b, a)] = gram[(a, b)];
                }
            }
        }
        grams
    }

    fn take_off(&mut self, noise: &SharedNoise, whitening: &Whitening, weight: f64) {
        let rows = whitening.whiten(&noise.rows);
        let columns: Vec<(usize, Vec<f64>)> = noise
            .columns
            .iter()
            .filter(|(term, _)| self.shows(*term))
            .map(|(term, column)| {
                let white = whitening.whiten(column);
                (*term, white.into_iter().map(|v| v / self.scale[*term]).collect())
            })
            .collect();
        let y = self.columns.len();
        for (i, piece) in self.piece_of.iter().enumerate().filter(|(i, _)| self.counted[*i]) {
            let gram = &mut self.grams[*piece];
            for (a, left) in &columns {
                let with_rows = weight * left[i] * rows[i];
                gram[(*a, y)] -= with_rows;
                gram[(y, *a)] -= with_rows;
                for (b, right) in &columns {
                    gram[(*a, *b)] -= weight * left[i] * right[i];
                }
            }
        }
    }

    /// Number of entries that count.
    pub(super) fn count(&self) -> usize {
        self.counted.iter().filter(|counts| **counts).count()
    }

    /// Whether a term shows in the data at all.
    pub(super) fn shows(&self, term: usize) -> bool {
        !self.columns[term].is_empty()
    }

    /// Which fold an entry belongs to.
    pub(super) fn fold_of(&self, entry: usize) -> usize {
        self.piece_of[entry] % FOLDS
    }

    fn fold(&self, fold: usize) -> DMatrix<f64> {
        let zero = DMatrix::zeros(self.width(), self.width());
        self.grams.iter().skip(fold).step_by(FOLDS).fold(zero, |sum, gram| sum + gram)
    }

    /// Fits `terms` to all the data.
    pub(super) fn solve(&self, terms: &[usize], priors: &[Option<Prior>]) -> Solution {
        self.solve_gram(&self.total, terms, priors)
    }

    /// Fits `terms` to all but one fold.
    pub(super) fn solve_without(&self, fold: usize, terms: &[usize], priors: &[Option<Prior>]) -> Solution {
        self.solve_gram(&(&self.total - self.fold(fold)), terms, priors)
    }

    /// Standard deviations by leaving out one piece at a time (Quenouille 1956, Tukey 1958): honest also
    /// where what is left is neither white nor of known size.
    pub(super) fn jackknife(&self, terms: &[usize], priors: &[Option<Prior>]) -> Vec<f64> {
        let fits = self.leave_one_out(terms, priors);
        let of = |i: usize| jackknife_std(fits.iter().map(|fit| fit.value[i]));
        (0..fits.first().map_or(0, |fit| fit.value.len())).map(of).collect()
    }

    /// Fits without one piece each.
    pub(super) fn leave_one_out(&self, terms: &[usize], priors: &[Option<Prior>]) -> Vec<Solution> {
        self.grams.iter().map(|gram| self.solve_gram(&(&self.total - gram), terms, priors)).collect()
    }

    fn solve_gram(&self, gram: &DMatrix<f64>, terms: &[usize], priors: &[Option<Prior>]) -> Solution {
        let terms: Vec<usize> = terms.iter().copied().filter(|t| self.shows(*t)).collect();
        let y = self.columns.len();
        let mut matrix = DMatrix::from_fn(terms.len(), terms.len(), |i, j| gram[(terms[i], terms[j])]);
        let mut right = DVector::from_fn(terms.len(), |i, _| gram[(terms[i], y)]);
        let mut chi2 = gram[(y, y)];
        for (i, term) in terms.iter().enumerate() {
            // A whiff of a prior keeps collinear columns solvable; it is a billion times too wide to matter.
            matrix[(i, i)] += 1e-11;
            if let Some(prior) = priors[*term] {
                let weight = (self.scale[*term] * prior.std).powi(-2);
                let mean = prior.mean * self.scale[*term];
                matrix[(i, i)] += weight;
                right[i] += weight * mean;
                chi2 += weight * mean * mean;
            }
        }
        let inverse = inverse(matrix);
        let scaled = &inverse * &right;
        let chi2 = chi2 - right.dot(&scaled);
        let value = terms.iter().zip(scaled.iter()).map(|(t, v)| v / self.scale[*t]).collect();
        let std =
            terms.iter().enumerate().map(|(i, t)| inverse[(i, i)].max(0.0).sqrt() / self.scale[*t]).collect();
        Solution { terms, value, std, chi2, scaled, inverse }
    }

    /// Score (Lagrange multiplier) test of one more term: Rao (1948).
    pub(super) fn score(&self, solution: &Solution, term: usize) -> Option<Score> {
        if !self.shows(term) || solution.terms.contains(&term) {
            return None;
        }
        let y = self.columns.len();
        let cross = DVector::from_iterator(
            solution.terms.len(),
            solution.terms.iter().map(|other| self.total[(term, *other)]),
        );
        let products = (self.total[(term, term)], self.total[(term, y)]);
        self.score_of(solution, term, &cross, products, self.scale[term])
    }

    /// The same for a column that is not part of the regression.
    pub(super) fn score_column(&self, solution: &Solution, term: usize, column: &Prepared) -> Option<Score> {
        self.score_of(solution, term, &column.cross, (1.0, self.with_y(column)), column.scale)
    }

    /// By how much the sum of squares falls with such a column.
    pub(super) fn gain(&self, solution: &Solution, column: &Prepared) -> f64 {
        let pull = self.with_y(column) - column.cross.dot(&solution.scaled);
        pull * pull / column.fresh
    }

    fn with_y(&self, column: &Prepared) -> f64 {
        column.unit.iter().zip(&self.y).map(|(a, b)| a * b).sum()
    }

    /// A whitened column and its products with a solution's terms; none where it does not show.
    pub(super) fn prepare(&self, solution: &Solution, white: &[f64]) -> Option<Prepared> {
        let white =
            white.iter().zip(&self.counted).map(|(v, counts)| if *counts { *v } else { 0.0 }).collect();
        let (unit, scale) = normalised(white);
        if unit.is_empty() {
            return None;
        }
        let dot = |other: &[f64]| unit.iter().zip(other).map(|(a, b)| a * b).sum::<f64>();
        let cross = DVector::from_iterator(
            solution.terms.len(),
            solution.terms.iter().map(|other| dot(&self.columns[*other])),
        );
        let explained = &solution.inverse * &cross;
        let fresh = 1.0 - cross.dot(&explained);
        (fresh >= LEAST_NEW_SHARE).then_some(Prepared { unit, scale, cross, explained, fresh })
    }

    fn score_of(
        &self,
        solution: &Solution,
        term: usize,
        cross: &DVector<f64>,
        (own, with_y): (f64, f64),
        scale: f64,
    ) -> Option<Score> {
        let fresh = own - cross.dot(&(&solution.inverse * cross));
        if fresh < LEAST_NEW_SHARE {
            return None;
        }
        let pull = with_y - cross.dot(&solution.scaled);
        Some(Score {
            term,
            gain: pull * pull / fresh,
            value: pull / fresh / scale,
            std: 1.0 / fresh.sqrt() / scale,
        })
    }

    /// Whitened sum of squares of each fold under the fit to the other folds.
    pub(super) fn held_out(&self, terms: &[usize], priors: &[Option<Prior>]) -> [f64; FOLDS] {
        std::array::from_fn(|fold| {
            let solution = self.solve_without(fold, terms, priors);
            let gram = self.fold(fold);
            let y = self.columns.len();
            let mut sum = gram[(y, y)];
            for (a, va) in solution.terms.iter().zip(solution.scaled.iter()) {
                sum -= 2.0 * va * gram[(*a, y)];
                for (b, vb) in solution.terms.iter().zip(solution.scaled.iter()) {
                    sum += va * vb * gram[(*a, *b)];
                }
            }
            sum
        })
    }

    /// Whitened residuals of one balance, in order of time.
    pub(super) fn innovations(&self, rows: &Rows, solution: &Solution, balance: Balance) -> Vec<f64> {
        self.innovations_by_entry(rows, solution, balance).map(|(_, value)| value).collect()
    }

    /// The same with the entry that each belongs to.
    pub(super) fn innovations_by_entry<'a>(
        &'a self,
        rows: &'a Rows,
        solution: &'a Solution,
        balance: Balance,
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        let counted = move |i: &usize| rows.entries[*i].balance == balance && self.counted[*i];
        (0..self.y.len()).filter(counted).map(|i| {
            let fit = solution.terms.iter().zip(solution.scaled.iter());
            (i, self.y[i] - fit.map(|(term, v)| v * self.columns[*term][i]).sum::<f64>())
        })
    }
}

fn normalised(mut column: Vec<f64>) -> (Vec<f64>, f64) {
    let length = column.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !(length.is_finite() && length > 0.0) {
        return (vec![], 1.0);
    }
    column.iter_mut().for_each(|v| *v /= length);
    (column, length)
}

/// Standard deviation of an estimate from its values without one piece each.
pub(super) fn jackknife_std(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = PIECES as f64;
    let mean = values.clone().sum::<f64>() / n;
    ((n - 1.0) / n * values.map(|value| (value - mean).powi(2)).sum::<f64>()).sqrt()
}

fn inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    let factor: Option<Cholesky<f64, Dyn>> = Cholesky::new(matrix.clone());
    factor.map_or_else(
        || matrix.pseudo_inverse(1e-12).unwrap_or_else(|_| DMatrix::zeros(n, n)),
        |f| f.inverse(),
    )
}

/// What the fit leaves over of each entry, in the balance's own unit times seconds.
pub(super) fn leftover(rows: &Rows, solution: &Solution) -> Vec<f64> {
    let mut left = rows.y.clone();
    for (term, value) in solution.terms.iter().zip(&solution.value) {
        for (cell, column) in left.iter_mut().zip(&rows.columns[*term]) {
            *cell -= value * column;
        }
    }
    left
}
