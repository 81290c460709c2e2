//! What a fit says of samples that it was not fitted to, and how white its residual is, whitened at the noise that it shows. What signals
//! do from sample to sample beyond their sensors' declared noise is noise of a worse sensor, or motion of the machine,
//! which leaves no residual once the equations hold. The residual tells: whitened by noise that isn't there, white
//! numbers look coloured, and coloured ones look small.

use super::gauss_newton::Fit;
use super::regression::{self, Solution, residual};
use crate::diagnose::data::Series;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{BLOCK_S, HALVINGS};
use crate::diagnose::weak_form::{NoiseModel, Row, Rows, Term, WeakForm, Whitening, residual_rows};
use pitchleak_core::effects::EffectKind;
use pitchleak_core::{Estimate, Signals};

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

    /// The residual of each entry when its piece is not fitted, in the equation's unit.
    pub(crate) fn held_out_residual(&self) -> Vec<f64> {
        let mut residual = vec![0.0; self.rows().y.len()];
        let fits = self.regression.leave_one_out(self.active(), &self.held_priors());
        for (piece, solution) in self.regression.pieces.iter().zip(&fits) {
            let all = regression::residual(self.rows(), solution);
            residual[piece.clone()].copy_from_slice(&all[piece.clone()]);
        }
        self.in_units(self.rows(), residual)
    }

    /// The residual of traces that were not fitted, in the equations' units.
    pub(crate) fn residual_on(&self, traces: &[Series]) -> (Rows, Vec<f64>) {
        let rows = residual_rows(traces, &self.problem.sensors, &self.solved(), BLOCK_S);
        let residual = self.in_units(&rows, rows.y.clone());
        (rows, residual)
    }

    /// What leaves each chamber along `traces`, in test functions over blocks of `block_s`: the model without its leaks leaves
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

    /// The force with which the dry friction that was named can hold a piston that stands, N.
    fn stiction_n(&self, at: &Signals<f64>) -> f64 {
        let of = |term: &usize| {
            let unit_n = self.problem.terms[*term].effect()?.stiction(at)?;
            Some(self.estimate(*term)?.value.max(0.0) * unit_n)
        };
        self.active().iter().filter_map(of).sum()
    }

    /// From integrals over a test function to averages. While the piston stands, dry friction is whatever
    /// balances the forces up to its own size: only what is beyond counts.
    fn in_units(&self, rows: &Rows, mut residual: Vec<f64>) -> Vec<f64> {
        for (cell, entry) in residual.iter_mut().zip(&rows.entries) {
            let row = &rows.rows[entry.row];
            *cell /= row.block_s;
            if entry.equation == Equation::Force {
                let free = (cell.abs() - self.stiction_n(&row.mean) * row.unsure_share).max(0.0);
                *cell = cell.signum() * free;
            }
        }
        residual
    }
}

impl Fit<'_> {
    /// Probability that white noise shows correlations as large as the residual of an equation, whitened at its own noise, where
    /// the samples are fast enough to see the motion.
    pub(crate) fn whiteness_p(&self, equation: Equation) -> Option<f64> {
        self.colour(equation).map(statistics::colour_p)
    }

    /// The sum of squared correlations that tells so.
    pub(crate) fn colour(&self, equation: Equation) -> Option<f64> {
        let of = |equation| statistics::portmanteau_chi2(&self.whitened_at_own_noise(equation), 1.0);
        *self.colour[equation].get_or_init(|| of(equation))
    }

    /// Where the residual is less than the noise should bring, by the share of it beyond the declared noise that brings
    /// as much (bisection).
    fn whitened_at_own_noise(&self, equation: Equation) -> Vec<f64> {
        let (mut low, mut high) = (0.0, 1.0);
        let mut white = self.whitened_at(high, equation);
        if !is_quieter(&white) {
            return white;
        }
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            let louder = self.whitened_at(middle, equation);
            if level(&louder) > 1.0 {
                low = middle;
            } else {
                (high, white) = (middle, louder);
            }
        }
        white
    }

    /// Whitened by the declared noise and this share of what the signals show beyond it; not a number where samples don't see the motion.
    fn whitened_at(&self, share: f64, equation: Equation) -> Vec<f64> {
        let rows = self.rows();
        let sensitivities = self.weak_form.at_share(&self.problem.declared, share);
        let noise = self.weak_form.noise_with(&sensitivities, self.equation_error);
        let white = Whitening::new(&noise).whiten(&residual(rows, &self.bounded));
        let own = rows.entries.iter().zip(white);
        own.filter(|(entry, _)| entry.equation == equation && rows.counts(entry))
            .map(|(entry, v)| if sensitivities[entry.row][equation].is_unresolved() { f64::NAN } else { v })
            .collect()
    }
}

/// Mean square.
fn level(white: &[f64]) -> f64 {
    let (sum, count) =
        statistics::known(white).fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
    if count > 0.0 { sum / count } else { 1.0 }
}

/// Whether numbers are smaller than chance makes white ones of variance one.
fn is_quieter(white: &[f64]) -> bool {
    let count = statistics::known(white).count().max(1) as f64;
    level(white) < 1.0 - statistics::chance_of_variance(count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::data::check_sensors;
    use crate::diagnose::fit::Problem;
    use crate::diagnose::statistics::LEAST_P;
    use crate::diagnose::testing::{declared, sound, torn_seal};

    /// Of chamber A where both meters seem to have four times their noise: as the fit whitens it, and at its own noise.
    fn p(traces: &[crate::diagnose::Series]) -> [f64; 2] {
        let declared = declared();
        let mut checks = check_sensors(traces, &declared);
        let meters = checks.iter_mut().filter(|check| check.name.starts_with("flow"));
        meters.for_each(|check| check.found.std = 4.0 * check.declared_std);
        let problem = Problem::new(traces, &declared, &checks);
        let fit = Fit::declared(&problem, &|| ());
        let as_fitted =
            statistics::portmanteau_chi2(&fit.innovations(Equation::ChamberA), 1.0).map(statistics::colour_p);
        [as_fitted, fit.whiteness_p(Equation::ChamberA)].map(|p| p.expect("enough rows"))
    }

    #[test]
    fn noise_that_is_not_there_does_not_colour_what_is_left() {
        let [as_fitted, own] = p(&[sound(300)]);
        assert!(as_fitted < LEAST_P && own > 0.01, "{as_fitted} {own}");
        let [_, own] = p(&[torn_seal(300)]);
        assert!(own < LEAST_P, "{own}");
    }
}
