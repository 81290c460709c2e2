//! How much wider a value's spread is once the constants of its law are unknown, too.

use super::gauss_newton::Fit;
use super::regression::normalised;
use nalgebra::{DMatrix, DVector};
use pitchleak_core::effects::{EffectConstant, EffectConstants};

/// A constant of an effect and what is known of it without these traces.
pub(crate) struct UnknownConstant {
    pub(crate) parameter: EffectConstant,
    /// The least and the largest value that it can have.
    pub(crate) range: (f64, f64),
}

/// Half the step of a derivative as a share of a constant's range.
const STEP_SHARE: f64 = 0.01;

impl Fit<'_> {
    /// Standard deviation that a fitted term's value has because of constants which were fitted, or taken, beside it: to first order, each
    /// is one more column, the derivative of the term, with a range for a prior. Of M⁻¹, the inverse of the normal equations with these
    /// columns, the value's entry grows by eᵀ S⁻¹ e, where e is what the fitted columns explain of them and S what is new in them.
    pub(crate) fn std_of_constants(&self, term: usize, unknown: &[UnknownConstant]) -> f64 {
        let solution = &self.bounded;
        let place = solution.terms.iter().position(|one| *one == term);
        let Some((place, own)) = place.zip(self.estimate(term)) else { return 0.0 };
        let columns: Vec<(Vec<f64>, f64)> = unknown
            .iter()
            .filter_map(|one| {
                let (low, high) = one.range;
                let (unit, scale) = normalised(self.derivative(term, own.value, one));
                // Of a value anywhere within the range.
                let std = (high - low) / 12.0_f64.sqrt();
                (!unit.is_empty()).then_some((unit, (std * scale).powi(-2)))
            })
            .collect();
        if columns.is_empty() {
            return 0.0;
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let cross = DMatrix::from_fn(solution.terms.len(), columns.len(), |i, j| {
            dot(&self.regression.columns[solution.terms[i]], &columns[j].0)
        });
        let explained = &solution.inverse * &cross;
        let own_products = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            dot(&columns[i].0, &columns[j].0) + if i == j { columns[i].1 } else { 0.0 }
        });
        let new = own_products - cross.transpose() * &explained;
        let of_own: DVector<f64> = explained.row(place).transpose();
        let added = new.cholesky().map_or(0.0, |factor| of_own.dot(&factor.solve(&of_own)));
        added.max(0.0).sqrt() / self.regression.scale[term]
    }

    /// What a step of a constant changes in the term's whitened column at its value, per unit of the constant.
    fn derivative(&self, term: usize, value: f64, one: &UnknownConstant) -> Vec<f64> {
        let constants = self.constants(term);
        let (low, high) = one.range;
        let at = constants.get(one.parameter).clamp(low, high);
        let step = STEP_SHARE * (high - low);
        let (below, above) = ((at - step).max(low), (at + step).min(high));
        let column = |at: f64| {
            let constants: EffectConstants<f64> = constants.with(one.parameter, at);
            self.regression.counting(self.white_column(self.problem.terms[term], constants))
        };
        let factor = value / (above - below);
        column(above).into_iter().zip(column(below)).map(|(a, b)| factor * (a - b)).collect()
    }
}
