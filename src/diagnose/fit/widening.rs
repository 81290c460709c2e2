//! How much wider a value's spread is once the constants of its law are unknown, too.

use super::gauss_newton::Fit;
use super::regression::normalised;
use crate::diagnose::thresholds::NEGLIGIBLE_SHARE;
use nalgebra::{DMatrix, DVector};
use pitchleak_core::effects::{EffectConstant, EffectConstants};

/// A constant of an effect and what is known of it without these traces.
pub(crate) struct UnknownConstant {
    pub(crate) parameter: EffectConstant,
    /// The least and the largest value that it can have.
    pub(crate) range: (f64, f64),
}

impl Fit<'_> {
    /// Standard deviation that a fitted term's value has because of constants which were taken beside it: to first order, each
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
        let step = NEGLIGIBLE_SHARE * (high - low);
        let (below, above) = ((at - step).max(low), (at + step).min(high));
        let column = |at: f64| {
            let constants: EffectConstants<f64> = constants.with(one.parameter, at);
            self.regression.counting(self.white_column(self.problem.terms[term], constants))
        };
        let factor = value / (above - below);
        column(above).into_iter().zip(column(below)).map(|(a, b)| factor * (a - b)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::data::Series;
    use crate::diagnose::fit::Problem;
    use crate::diagnose::testing::{declared, seen};
    use crate::diagnose::weak_form::Term;
    use pitchleak_core::Effect;

    const CRACKING_PA: f64 = 1e6;

    /// Half a minute of a cylinder with a valve across the piston that opens at [`CRACKING_PA`].
    fn opening() -> Series {
        seen(30, |sample| {
            let load = sample.load_pressure_pa();
            let past = 2e-11 * (load - load.clamp(-CRACKING_PA, CRACKING_PA));
            sample.qa_m3s = sample.qa_m3s.map(|q| q + past);
            sample.qb_m3s = sample.qb_m3s.map(|q| q - past);
        })
    }

    fn cracking(low: f64, high: f64) -> UnknownConstant {
        UnknownConstant { parameter: EffectConstant::CrackingPressure, range: (low, high) }
    }

    /// The fit with the valve beside the leaks, and its place.
    fn with_fit(of: impl Fn(&Fit<'_>, usize)) {
        let traces = [opening()];
        let mut problem = Problem::new(&traces, &declared(), &[]);
        // Taken, not fitted: the fit has no column of its own for it.
        problem.usual_constants.cracking_pa = CRACKING_PA;
        let term = problem.place(Term::Effect(Effect::InternalLeakCracking)).expect("is a term");
        of(&Fit::declared(&problem, &|| ()).with(term, problem.usual(term), &|| ()), term);
    }

    /// The spread is that of a fit with the law's derivative as one more column, known beforehand to lie in the constant's range.
    #[test]
    fn an_unknown_constant_widens_as_one_more_column_would() {
        with_fit(|fit, term| {
            let (low, high): (f64, f64) = (0.5e6, 1.5e6);
            let own = fit.estimate(term).expect("is fitted");
            let name = fit.problem.terms[term];
            let at = |pa: f64| {
                let constants = fit.constants(term).with(EffectConstant::CrackingPressure, pa);
                fit.regression.counting(fit.white_column(name, constants))
            };
            let step = 1e4;
            let slope = |(above, below): (f64, f64)| own.value * (above - below) / (2.0 * step);
            let above = at(CRACKING_PA + step);
            let more: Vec<f64> = above.into_iter().zip(at(CRACKING_PA - step)).map(slope).collect();
            let solution = &fit.bounded;
            let count = solution.terms.len();
            let normal = solution.inverse.clone().try_inverse().expect("is regular");
            let dot = |a: &[f64]| a.iter().zip(&more).map(|(a, b)| a * b).sum::<f64>();
            let all = DMatrix::from_fn(count + 1, count + 1, |i, j| match (i < count, j < count) {
                (true, true) => normal[(i, j)],
                (false, false) => dot(&more) + 12.0 / (high - low).powi(2),
                _ => dot(&fit.regression.columns[solution.terms[i.min(j)]]),
            });
            let place = solution.terms.iter().position(|one| *one == term).expect("is fitted");
            let wide = all.try_inverse().expect("is regular")[(place, place)];
            let by_hand = (wide - solution.inverse[(place, place)]).sqrt() / fit.regression.scale[term];
            let told = fit.std_of_constants(term, &[cracking(low, high)]);
            assert!((told / by_hand - 1.0).abs() < 0.02, "{told} {by_hand}");
            assert!(told > 0.1 * own.std, "{told} beside {}", own.std);
        });
    }

    #[test]
    fn a_constant_that_is_known_widens_nothing_and_none_does_neither() {
        with_fit(|fit, term| {
            let spread = |half_pa: f64| {
                fit.std_of_constants(term, &[cracking(CRACKING_PA - half_pa, CRACKING_PA + half_pa)])
            };
            let (narrow, wide) = (spread(1.0), spread(5e5));
            assert!(wide > 0.0 && narrow < 0.01 * wide, "{narrow} {wide}");
            let leak = fit.problem.place(Term::Internal).expect("is a term");
            let unnamed = fit.problem.place(Term::Effect(Effect::AccumulatorA)).expect("is a term");
            // No constant, a constant in which the term is linear, a term that is not fitted.
            let all =
                [(term, vec![]), (leak, vec![cracking(5e5, 1.5e6)]), (unnamed, vec![cracking(5e5, 1.5e6)])];
            for (term, unknown) in all {
                assert!(fit.std_of_constants(term, &unknown) <= 0.0);
            }
        });
    }
}
