//! What a fit says of samples that it was not fitted to.

use super::gauss_newton::Fit;
use super::regression::{self, Solution};
use crate::diagnose::data::Series;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::thresholds::{BLOCK_S, FOLDS};
use crate::diagnose::weak_form::{NoiseModel, Row, Rows, Term, WeakForm, residual_rows};
use pitchleak_core::effects::EffectKind;
use pitchleak_core::{Effect, Estimate, Signals};

/// Flow that leaves a chamber, averaged over a test function.
pub(crate) struct MeanFlow {
    pub(crate) chamber: Equation,
    pub(crate) row: Row,
    /// m³/s; the standard deviation is that of the sensors' noise.
    pub(crate) flow: Estimate<f64>,
}

impl Fit<'_> {
    /// The rows of the fitted traces at the linearisation.
    pub(crate) fn rows(&self) -> &Rows {
        &self.weak_form.rows
    }

    /// Whitened residuals of one equation, in order of time.
    pub(crate) fn innovations(&self, equation: Equation) -> Vec<f64> {
        self.regression.innovations(self.rows(), &self.bounded, equation)
    }

    /// The residual of each entry when its fold is not fitted, in the equation's unit.
    pub(crate) fn held_out_residual(&self) -> Vec<f64> {
        let priors = self.held_priors();
        let mut residual = vec![0.0; self.rows().y.len()];
        for fold in 0..FOLDS {
            let solution = self.regression.solve_without(fold, self.active(), &priors);
            for (i, value) in regression::residual(self.rows(), &solution).into_iter().enumerate() {
                if self.regression.fold_of(i) == fold {
                    residual[i] = value;
                }
            }
        }
        self.in_units(self.rows(), residual)
    }

    /// The residual of traces that were not fitted, in the equations' units.
    pub(crate) fn residual_on(&self, traces: &[Series]) -> (Rows, Vec<f64>) {
        let rows = residual_rows(traces, &self.problem.sensors, &self.solved(), BLOCK_S);
        let residual = self.in_units(&rows, rows.y.clone());
        (rows, residual)
    }

    /// What leaves each chamber along `traces`, in hats over blocks of `block_s`: the model without its leaks leaves
    /// that over.
    pub(crate) fn leak_flows(&self, traces: &[Series], block_s: f64) -> Vec<MeanFlow> {
        let solved = self.solved();
        let tight = self.problem.terms.iter().enumerate().fold(solved.clone(), |at, (place, term)| {
            let leaks = term.is_leak() && at.value(*term).abs() > 0.0;
            if leaks { at.with(*term, 0.0, &self.constants(place)) } else { at }
        });
        let sensors = &self.problem.sensors;
        let rows = residual_rows(traces, sensors, &tight, block_s);
        let sensitivities = WeakForm::sensitivities(&rows, sensors, &solved);
        let (at, equation_error) = (&solved, PerEquation::default());
        let noise = NoiseModel { at, sensors, equation_error, rows: &rows, sensitivities: &sensitivities };
        let entries = rows.entries.iter().zip(&rows.y).filter(|(entry, _)| entry.equation != Equation::Force);
        entries
            .map(|(entry, residual)| {
                let (chamber, row) = (entry.equation, rows.rows[entry.row]);
                let flow =
                    Estimate { value: residual / row.block_s, std: noise.mean_flow_std(entry.row, chamber) };
                MeanFlow { chamber, row, flow }
            })
            .collect()
    }

    /// Σ factor × value over `terms`, and its standard deviation by the jackknife, which holds their correlation.
    pub(crate) fn sum(&self, terms: &[(Term, f64)]) -> Estimate<f64> {
        let of = |solution: &Solution| {
            let one = |(term, factor): &(Term, f64)| {
                let own = |place: &usize| self.problem.terms[*place] == *term;
                let place = solution.terms.iter().position(own);
                factor * (self.weak_form.at.value(*term) + place.map_or(0.0, |place| solution.value[place]))
            };
            terms.iter().map(one).sum::<f64>()
        };
        let pieces = self.regression.leave_one_out(self.active(), &self.held_priors());
        Estimate { value: of(&self.bounded), std: regression::jackknife_std(pieces.iter().map(of)) }
    }

    /// Flow out of a chamber by the leak effects that are fitted, m³/s.
    pub(crate) fn effect_leak(&self, at: &Signals<f64>, chamber: Equation) -> f64 {
        let solved = self.solved();
        PerEquation::from(solved.effects.terms(at, &solved.model, EffectKind::is_leak))[chamber]
    }

    /// From integrals over a hat to averages. While the piston stands, dry friction is whatever
    /// balances the forces up to its own size: only what is beyond counts.
    fn in_units(&self, rows: &Rows, mut residual: Vec<f64>) -> Vec<f64> {
        let coulomb = self.problem.place(Term::Effect(Effect::CoulombFriction));
        let friction = coulomb.and_then(|term| self.estimate(term)).map_or(0.0, |own| own.value.max(0.0));
        for (cell, entry) in residual.iter_mut().zip(&rows.entries) {
            let row = &rows.rows[entry.row];
            *cell /= row.block_s;
            if entry.equation == Equation::Force {
                let free = (cell.abs() - friction * row.stuck).max(0.0);
                *cell = cell.signum() * free;
            }
        }
        residual
    }
}
