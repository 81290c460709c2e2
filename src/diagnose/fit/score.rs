//! What one more term would bring, without a fit: the score test.

use super::regression::{Regression, Solution, normalised};
use crate::diagnose::thresholds::{MOST_OF, ROUNDING};
use nalgebra::{DMatrix, DVector};

/// What a further term would bring.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Score {
    pub(crate) term: usize,
    /// By how much the sum of squares falls.
    pub(crate) chi2_drop: f64,
    /// Its increment and standard deviation.
    pub(crate) value: f64,
    pub(crate) std: f64,
}

/// A column outside the regression, and what a solution's terms explain of it.
pub(crate) struct PartialColumn {
    unit: Vec<f64>,
    scale: f64,
    cross: DVector<f64>,
    explained: DVector<f64>,
    partial_variance: f64,
}

impl PartialColumn {
    /// Standard deviation of its size beside the solution's terms.
    pub(crate) fn std(&self) -> f64 {
        1.0 / self.partial_variance.sqrt() / self.scale
    }

    /// Correlation of what is new in two columns.
    pub(crate) fn correlation(&self, other: &Self) -> f64 {
        let product = self.unit.iter().zip(&other.unit).map(|(a, b)| a * b).sum::<f64>();
        (product - self.cross.dot(&other.explained)) / (self.partial_variance * other.partial_variance).sqrt()
    }
}

/// What is new in some columns beside a solution: their products, and those with what it leaves.
pub(crate) struct Beside<'r> {
    regression: &'r Regression,
    terms: Vec<usize>,
    products: DMatrix<f64>,
    /// Of that, what was taken off for noise.
    noise: DMatrix<f64>,
    pulls: DVector<f64>,
}

/// What two further terms would bring together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairScore {
    /// By how much the sum of squares falls.
    pub(crate) chi2_drop: f64,
    /// Their increments.
    pub(crate) values: [f64; 2],
}

impl Beside<'_> {
    /// By how much the sum of squares falls with one of them.
    pub(crate) fn alone(&self, at: usize) -> f64 {
        if self.is_new(at) { self.pulls[at].powi(2) / self.products[(at, at)] } else { 0.0 }
    }

    fn is_new(&self, at: usize) -> bool {
        self.products[(at, at)] >= ROUNDING
    }

    /// What two of them bring; none where they are one column, or what is new in them is mostly noise.
    pub(crate) fn pair(&self, a: usize, b: usize) -> Option<PairScore> {
        let (own, other, cross) = (self.products[(a, a)], self.products[(b, b)], self.products[(a, b)]);
        let determinant = own * other - cross * cross;
        if !(self.is_new(a) && self.is_new(b) && determinant >= ROUNDING * own * other) {
            return None;
        }
        let (pull, pull_other) = (self.pulls[a], self.pulls[b]);
        let sizes = [
            (pull * other - pull_other * cross) / determinant,
            (pull_other * own - pull * cross) / determinant,
        ];
        let chi2_drop = sizes[0] * pull + sizes[1] * pull_other;
        let noise = &self.noise;
        let noise = sizes[0] * (sizes[0] * noise[(a, a)] + 2.0 * sizes[1] * noise[(a, b)])
            + sizes[1] * sizes[1] * noise[(b, b)];
        if noise > MOST_OF * (chi2_drop + noise) {
            return None;
        }
        let scales = [a, b].map(|at| self.regression.scale[self.terms[at]]);
        Some(PairScore { chi2_drop, values: [sizes[0] / scales[0], sizes[1] / scales[1]] })
    }
}

impl Regression {
    /// What is new in the columns of some terms, none of them a solution's own.
    pub(crate) fn beside(&self, solution: &Solution, terms: &[usize]) -> Beside<'_> {
        let y = self.columns.len();
        let of = |matrix: &DMatrix<f64>, left: &[usize], right: &[usize]| {
            DMatrix::from_fn(left.len(), right.len(), |i, j| matrix[(left[i], right[j])])
        };
        let cross = of(&self.total, &solution.terms, terms);
        let explained = &solution.inverse * &cross;
        let shared = of(&self.taken, &solution.terms, terms);
        let noise = of(&self.taken, terms, terms) - shared.tr_mul(&explained) - explained.tr_mul(&shared)
            + explained.tr_mul(&(of(&self.taken, &solution.terms, &solution.terms) * &explained));
        let with_y = DVector::from_fn(terms.len(), |i, _| self.total[(terms[i], y)]);
        Beside {
            regression: self,
            terms: terms.to_vec(),
            products: of(&self.total, terms, terms) - cross.tr_mul(&explained),
            noise,
            pulls: with_y - cross.tr_mul(&solution.scaled),
        }
    }

    /// Score (Lagrange multiplier) test of one more term: Rao (1948).
    pub(crate) fn score(&self, solution: &Solution, term: usize) -> Option<Score> {
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

    /// Score of a column that is not part of the regression.
    pub(crate) fn score_column(
        &self,
        solution: &Solution,
        term: usize,
        column: &PartialColumn,
    ) -> Option<Score> {
        self.score_of(solution, term, &column.cross, (1.0, self.with_y(column)), column.scale)
    }

    /// By how much the sum of squares falls with such a column.
    pub(crate) fn chi2_drop(&self, solution: &Solution, column: &PartialColumn) -> f64 {
        let pull = self.with_y(column) - column.cross.dot(&solution.scaled);
        pull * pull / column.partial_variance
    }

    fn with_y(&self, column: &PartialColumn) -> f64 {
        column.unit.iter().zip(&self.y).map(|(a, b)| a * b).sum()
    }

    /// A whitened column and its products with a solution's terms; none where it does not show.
    pub(crate) fn partial(&self, solution: &Solution, white: &[f64]) -> Option<PartialColumn> {
        let (unit, scale) = normalised(self.counting(white.to_vec()));
        if unit.is_empty() {
            return None;
        }
        let dot = |other: &[f64]| unit.iter().zip(other).map(|(a, b)| a * b).sum::<f64>();
        let cross = DVector::from_iterator(
            solution.terms.len(),
            solution.terms.iter().map(|other| dot(&self.columns[*other])),
        );
        let explained = &solution.inverse * &cross;
        let partial_variance = 1.0 - cross.dot(&explained);
        (partial_variance >= ROUNDING).then_some(PartialColumn {
            unit,
            scale,
            cross,
            explained,
            partial_variance,
        })
    }

    fn score_of(
        &self,
        solution: &Solution,
        term: usize,
        cross: &DVector<f64>,
        (own, with_y): (f64, f64),
        scale: f64,
    ) -> Option<Score> {
        let partial_variance = own - cross.dot(&(&solution.inverse * cross));
        if partial_variance < ROUNDING {
            return None;
        }
        let pull = with_y - cross.dot(&solution.scaled);
        Some(Score {
            term,
            chi2_drop: pull * pull / partial_variance,
            value: pull / partial_variance / scale,
            std: 1.0 / partial_variance.sqrt() / scale,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::equation::PerEquation;
    use crate::diagnose::fit::{Problem, regression};
    use crate::diagnose::testing::{declared, torn_seal};
    use crate::diagnose::thresholds::PIECES;
    use crate::diagnose::weak_form::{Columns, DECLARED, NoisyColumn, SharedNoise, Term, WeakForm};
    use pitchleak_core::Effect;
    use std::cell::RefCell;

    /// A regression of the declared model's constants and some effects, none of which share the residual's noise.
    fn with_regression(test: impl Fn(&Problem<'_>, &WeakForm<'_>, &Regression)) {
        with_noise(&SharedNoise::default(), test);
    }

    fn with_noise(shared: &SharedNoise, test: impl Fn(&Problem<'_>, &WeakForm<'_>, &Regression)) {
        let (traces, declared) = ([torn_seal(20)], declared());
        let problem = Problem::new(&traces, &declared, &[]);
        let constants = vec![problem.usual_constants; problem.terms.len()];
        let places: Vec<usize> = (0..problem.terms.len()).collect();
        let columns = Columns { terms: &problem.terms, constants: &constants, places: &places };
        let start = problem.start.clone();
        let (of, at) = ((&traces[..], &problem.unresolved[..]), (start.clone(), start));
        let form = WeakForm::new(of, &problem.sensors, at, columns, PerEquation::default());
        let pieces = regression::pieces(&form.rows);
        test(&problem, &form, &Regression::new((&form.rows, pieces), &form.whitening, shared));
    }

    /// Values of the declared model's constants and χ², all in all and without one piece each.
    fn solutions(problem: &Problem<'_>, form: &WeakForm<'_>, regression: &Regression) -> Vec<f64> {
        let priors = problem.increments(&form.at);
        let terms: Vec<usize> = DECLARED.iter().filter_map(|term| problem.place(*term)).collect();
        let all = std::iter::once(regression.solve(&terms, &priors));
        let all = all.chain(regression.leave_one_out(&terms, &priors));
        all.flat_map(|solution| [solution.value, vec![solution.chi2]].concat()).collect()
    }

    #[test]
    fn where_noise_would_be_more_than_was_measured_none_is_taken_off() {
        let measured = RefCell::new(vec![]);
        with_regression(|problem, form, regression| {
            measured.replace(solutions(problem, form, regression));
        });
        let column = |with_residual| NoisyColumn { term: 1, with_residual, with_itself: 0.0 };
        let more_than_its_square =
            SharedNoise { columns: vec![column([1e10; PIECES])], products: vec![(1, 1, [1e27; PIECES])] };
        let more_than_the_residual = SharedNoise { columns: vec![column([1e18; PIECES])], products: vec![] };
        for shared in [more_than_its_square, more_than_the_residual] {
            with_noise(&shared, |problem, form, regression| {
                let (own, measured) = (solutions(problem, form, regression), measured.borrow());
                for (own, measured) in own.iter().zip(measured.iter()) {
                    assert!(is_near(*own, *measured), "{own} {measured}");
                }
            });
        }
    }

    fn is_near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-6 * a.abs().max(b.abs())
    }

    #[test]
    fn a_solution_is_that_of_dense_least_squares() {
        with_regression(|problem, form, regression| {
            let terms: Vec<usize> = DECLARED.iter().filter_map(|term| problem.place(*term)).collect();
            let priors = problem.increments(&form.at);
            let white = |column: &[f64]| regression.counting(form.whitening.whiten(column));
            let columns: Vec<Vec<f64>> = terms.iter().map(|term| white(&form.rows.columns[*term])).collect();
            let n = form.rows.y.len();
            // One more row for the prior of 1/β.
            let prior = priors[terms[0]].expect("oil has a prior");
            let scale = [1e-9, 1e-11, 1e-11, 1e-11];
            let x = DMatrix::from_fn(n + 1, 4, |i, j| match (i == n, j) {
                (false, _) => columns[j][i] * scale[j],
                (true, 0) => scale[0] / prior.std,
                (true, _) => 0.0,
            });
            let mut y = white(&form.rows.y);
            y.push(prior.mean / prior.std);
            let y = DVector::from_vec(y);
            let svd = x.clone().svd(true, true);
            let dense = svd.solve(&y, 0.0).expect("both factors");
            let covariance = (x.transpose() * &x).try_inverse().expect("regular");
            let solution = regression.solve(&terms, &priors);
            for j in 0..4 {
                assert!(is_near(solution.value[j], dense[j] * scale[j]), "{j}");
                assert!(is_near(solution.std[j], covariance[(j, j)].sqrt() * scale[j]), "{j}");
            }
            assert!(is_near(solution.chi2, (&y - &x * &dense).norm_squared()));
        });
    }

    #[test]
    fn a_score_says_what_a_refit_brings() {
        with_regression(|problem, form, regression| {
            let priors = problem.increments(&form.at);
            let terms: Vec<usize> = DECLARED.iter().filter_map(|term| problem.place(*term)).collect();
            let without = regression.solve(&terms, &priors);
            let effects = [Effect::InternalLeakTurbulent, Effect::FlowMeterOffsetA, Effect::EntrainedAir];
            for effect in effects {
                let term = problem.place(Term::Effect(effect)).expect("is a term");
                let with = regression.solve(&[&terms[..], &[term]].concat(), &priors);
                let white = form.white_column(Term::Effect(effect), problem.usual_constants);
                let partial = regression.partial(&without, &white).expect("shows");
                let scores =
                    [regression.score(&without, term), regression.score_column(&without, term, &partial)];
                for score in scores {
                    let score = score.expect("is new");
                    assert!(is_near(score.chi2_drop, without.chi2 - with.chi2), "{effect}: {score:?}");
                    assert!(
                        is_near(score.value, with.value[4]) && is_near(score.std, with.std[4]),
                        "{effect}"
                    );
                }
            }
        });
    }

    #[test]
    fn a_column_put_in_is_as_if_it_had_been_there() {
        with_regression(compare_with_a_column_put_in);
    }

    #[test]
    fn a_column_put_in_brings_nothing_of_the_noise_of_the_one_before() {
        let offset = RefCell::new(0);
        with_regression(|problem, _, _| {
            offset.replace(problem.place(Term::Effect(Effect::FlowMeterOffsetA)).expect("is a term"));
        });
        // So much that it is put back.
        let products = [1, offset.take()].map(|term| (term, term, [1e30; PIECES])).to_vec();
        with_noise(&SharedNoise { columns: vec![], products }, compare_with_a_column_put_in);
    }

    fn compare_with_a_column_put_in(problem: &Problem<'_>, form: &WeakForm<'_>, regression: &Regression) {
        let place = |effect| problem.place(Term::Effect(effect)).expect("is a term");
        let (air, offset) = (place(Effect::EntrainedAir), place(Effect::FlowMeterOffsetA));
        let white = form.white_column(Term::Effect(Effect::EntrainedAir), problem.usual_constants);
        let replaced = regression.with_column(offset, white);
        let priors = vec![None; problem.terms.len()];
        let (own, there) =
            (regression.solve(&[0, 1, air], &priors), replaced.solve(&[0, 1, offset], &priors));
        assert!(own.value.iter().zip(&there.value).all(|(a, b)| is_near(*a, *b)));
        assert!(is_near(own.chi2, there.chi2));
        let errors = regression.held_out(&[0, 1, air], &priors);
        let replaced = replaced.held_out(&[0, 1, offset], &priors);
        assert!(errors.iter().zip(&replaced).all(|(a, b)| is_near(*a, *b)));
    }
}
