//! What is left, in a few lines for people.

use super::labels::{name, people, people_unit, symbol};
use crate::diagnose::equation::Equation;
use crate::diagnose::outcome::{BinnedResidual, Correlation, Diagnosis, EquationResidual};
use crate::diagnose::statistics;
use crate::diagnose::thresholds::{CHANCE_RATE, RESIDUAL_TESTS};
use crate::spark::level;
use std::fmt::Write;

/// Variables named per equation.
const MOST_NAMED: usize = 3;

impl Diagnosis {
    /// Size against the sensors' noise, whiteness, normality, and what the residual goes with.
    pub(super) fn write_residuals(&self, out: &mut String) {
        out.push_str("\nwhat is left                 of noise    white p   normal p   goes with\n");
        let sides = [("before", &self.before.residuals), ("after", &self.after.residuals)];
        let shown = if self.effects.is_empty() { &sides[..1] } else { &sides[..] };
        for equation in Equation::ALL {
            for (side, residuals) in shown {
                let Some(residual) = &residuals[equation] else { continue };
                let p = |p: Option<f64>| p.map_or_else(|| "-".into(), probability);
                let _ = writeln!(
                    out,
                    "  {:<12} {side:<10} {:>10.2} {:>10} {:>10}   {}",
                    name(equation),
                    residual.noise_ratio,
                    p(residual.whiteness_p),
                    p(residual.normality_p),
                    residual.companions()
                );
            }
        }
    }

    /// The residual against the variables that it follows most, for each equation that is not explained.
    pub(super) fn write_bins(&self, out: &mut String) {
        for (equation, residual) in self.after.residuals.iter() {
            let Some(residual) = residual else { continue };
            if residual.noise_ratio <= 1.0 && beyond_chance(residual).is_empty() {
                continue;
            }
            let bins = self.after.binned_residuals.iter();
            let mut bins: Vec<&BinnedResidual> =
                bins.filter(|one| one.equation == equation && one.varies()).collect();
            bins.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
            for one in bins.into_iter().take(MOST_NAMED) {
                let _ = writeln!(out, "{}", one.line());
            }
        }
    }
}

/// Variables that a residual goes with beyond chance.
fn beyond_chance(residual: &EquationResidual) -> Vec<(&'static str, Correlation)> {
    residual.goes_with(statistics::bonferroni_sigma(CHANCE_RATE, RESIDUAL_TESTS))
}

impl EquationResidual {
    /// The variables that it goes with, in words.
    pub(crate) fn companions(&self) -> String {
        let found = beyond_chance(self).into_iter().take(MOST_NAMED);
        let words: Vec<String> =
            found.map(|(variable, c)| format!("{} ({:+.0} sigma)", symbol(variable), c.sigma)).collect();
        if words.is_empty() { "nothing".into() } else { words.join(", ") }
    }
}

impl BinnedResidual {
    /// Whether the traces have the variable, and it moves.
    pub(crate) fn varies(&self) -> bool {
        let ends = self.at.first().zip(self.at.last());
        ends.is_some_and(|(first, last)| last - first > 1e-9 * last.abs().max(first.abs()))
    }

    /// How far the bins' means are from one another, in their standard errors: what a correlation cannot see
    /// of a hump.
    pub(crate) fn strength(&self) -> f64 {
        let pairs = self.mean.iter().zip(&self.std_error).filter(|(_, error)| **error > 0.0);
        pairs.map(|(mean, error)| (mean / error).powi(2)).sum()
    }

    fn line(&self) -> String {
        let (factor, unit) = people_unit(self.equation);
        let [low, high] = extremes(&self.mean);
        let bars: String = self.mean.iter().map(|mean| level((mean - low) / (high - low))).collect();
        let [from, to] = extremes(&self.at);
        let (scale, scale_unit) = people(self.against);
        let space = if scale_unit.is_empty() { "" } else { " " };
        format!(
            "  {:<10} left over {} to {} {unit} against {} from {} to {}{space}{scale_unit}: {bars}",
            name(self.equation),
            short(low * factor),
            short(high * factor),
            symbol(self.against),
            short(from * scale),
            short(to * scale)
        )
    }
}

fn extremes(values: &[f64]) -> [f64; 2] {
    let fold = |f: fn(f64, f64) -> f64, start| values.iter().copied().fold(start, f);
    [fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY)]
}

fn probability(p: f64) -> String {
    if p < 1e-3 { "<0.001".into() } else { format!("{p:.3}") }
}

/// Three significant digits.
fn short(value: f64) -> String {
    let decimals = (2.0 - value.abs().max(1e-3).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{value:.decimals$}")
}
