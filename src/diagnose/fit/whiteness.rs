//! The residual, whitened at the noise that it shows. What signals do from sample to sample beyond their sensors'
//! declared noise is noise of a worse sensor, or motion of the machine, which leaves no residual once the equations
//! hold. What they leave over tells: whitened by noise that isn't there, white numbers look coloured, and coloured ones
//! look small.

use super::gauss_newton::Fit;
use super::regression::residual;
use crate::diagnose::equation::Equation;
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{CHANCE_SIGMA, SHARE_BISECTIONS};
use crate::diagnose::weak_form::Whitening;

impl Fit<'_> {
    /// Probability that white noise shows correlations as large as an equation's residual, whitened at its own noise,
    /// where the samples are fast enough to see the motion.
    pub(crate) fn whiteness_p(&self, equation: Equation) -> Option<f64> {
        self.colour(equation).map(statistics::colour_p)
    }

    /// The sum of squared correlations that tells so.
    pub(crate) fn colour(&self, equation: Equation) -> Option<f64> {
        let of = |equation| statistics::portmanteau_chi2(&self.whitened_at_shown_noise(equation), 1.0);
        *self.colour[equation].get_or_init(|| of(equation))
    }

    /// Where the residual is less than the noise should bring, by the share of it beyond the declared noise that brings
    /// as much (bisection).
    fn whitened_at_shown_noise(&self, equation: Equation) -> Vec<f64> {
        let (mut low, mut high) = (0.0, 1.0);
        let mut white = self.whitened_at(high, equation);
        if !is_quieter(&white) {
            return white;
        }
        for _ in 0..SHARE_BISECTIONS {
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
        let white = Whitening::new(rows, &noise).whiten(&residual(rows, &self.bounded));
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
    level(white) < 1.0 - CHANCE_SIGMA * (2.0 / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::data::check_sensors;
    use crate::diagnose::fit::Problem;
    use crate::diagnose::testing::{declared, sound, torn_seal};
    use crate::diagnose::thresholds::LEAST_P;

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
