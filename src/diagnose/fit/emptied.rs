//! What a fit loses as one term after another is held at zero: each is a step of rank one in the inverse of its normal equations (Lawson &
//! Hanson 1974, "Solving Least Squares Problems", ch. 24), so that hundreds cost what one more solution would.

use super::gauss_newton::Fit;
use nalgebra::{DMatrix, DVector};

pub(crate) struct Emptied {
    terms: Vec<usize>,
    /// How far each term is from zero, beside those that are held there; in units of its column's length.
    away: DVector<f64>,
    inverse: DMatrix<f64>,
}

impl Emptied {
    /// Nothing is held yet. Terms with a prior pay for it wherever they are: only others may be held.
    pub(crate) fn of(fit: &Fit<'_>) -> Self {
        let free = &fit.free;
        let at =
            |term: &usize| fit.weak_form.at.value(fit.problem.terms[*term]) * fit.regression.scale[*term];
        let away = free.terms.iter().zip(free.scaled.iter()).map(|(term, scaled)| scaled + at(term));
        let away = DVector::from_iterator(free.terms.len(), away);
        Self { terms: free.terms.clone(), away, inverse: free.inverse.clone() }
    }

    fn place(&self, term: usize) -> Option<usize> {
        self.terms.iter().position(|one| *one == term)
    }

    /// By how much the sum of squares rises where this one is held too.
    pub(crate) fn loss(&self, term: usize) -> f64 {
        self.place(term).map_or(0.0, |own| self.away[own].powi(2) / self.inverse[(own, own)])
    }

    pub(crate) fn hold(&mut self, term: usize) {
        let Some(own) = self.place(term) else { return };
        let column = self.inverse.column(own).into_owned();
        let variance = column[own];
        self.away.axpy(-self.away[own] / variance, &column, 1.0);
        self.inverse.ger(-1.0 / variance, &column, &column, 1.0);
        self.terms.remove(own);
        self.away = std::mem::take(&mut self.away).remove_row(own);
        self.inverse = std::mem::take(&mut self.inverse).remove_row(own).remove_column(own);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fit::Problem;
    use crate::diagnose::testing::{declared, torn_seal};
    use crate::diagnose::weak_form::{ChangeKind, LeakChange};
    use pitchleak_core::Leak;

    #[test]
    fn terms_held_one_by_one_lose_what_a_solution_without_them_loses() {
        let traces = [torn_seal(60)];
        let plain = Problem::new(&traces, &declared(), &[]);
        let changes = Leak::ALL.map(|leak| [(leak, ChangeKind::Step), (leak, ChangeKind::Growth)]);
        let changes = changes.as_flattened().iter().map(|(leak, kind)| LeakChange {
            leak: *leak,
            kind: *kind,
            row: 10,
            trace: 0,
            from_s: 20.0,
        });
        let problem = plain.with_leak_changes(&changes.collect::<Vec<_>>());
        let fit = Fit::declared(&problem, &|| ());
        let mut emptied = Emptied::of(&fit);
        let mut gone = vec![];
        let mut lost = 0.0;
        for (place, _) in fit.leak_changes() {
            lost += emptied.loss(place);
            emptied.hold(place);
            gone.push(place);
            let whole = fit.solve_without(&gone).chi2 - fit.free.chi2;
            assert!((lost - whole).abs() < 1e-5 * whole.max(1.0), "{gone:?}: {lost} and {whole}");
        }
        assert!(lost > 10.0, "{lost}");
    }
}
