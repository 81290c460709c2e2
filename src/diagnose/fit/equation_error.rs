//! The variance component of an incomplete model: how far its equations are wrong.

use super::regression::{Regression, Solution, residual};
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::thresholds::{BISECTIONS, CHANCE_SIGMA};
use crate::diagnose::weak_form::{WeakForm, Whitening};

/// Equation error with which the residual would be as large as the noise says, so that neither priors nor weak effects
/// are overrun by it; zero where the residual can be the sensors' noise. By bisection.
pub(super) fn estimate(
    weak_form: &WeakForm<'_>,
    regression: &Regression,
    solution: &Solution,
) -> PerEquation<f64> {
    let rows = &weak_form.rows;
    let residual = residual(rows, solution);
    let counts =
        PerEquation::from_fn(|equation| regression.innovations(rows, solution, equation).len().max(1) as f64);
    let levels = |equation_error: PerEquation<f64>| {
        let white = Whitening::new(rows, &weak_form.noise(equation_error)).whiten(&residual);
        let mut squares = PerEquation::<f64>::default();
        for (entry, e) in rows.entries.iter().zip(&white).filter(|(entry, _)| rows.counts(entry)) {
            squares[entry.equation] += e * e;
        }
        squares.zip(counts, |sum, count| sum / count)
    };
    let sensors_only = levels(PerEquation::default());
    let mut high = PerEquation::from_fn(|equation| {
        let by_chance = CHANCE_SIGMA * (2.0 / counts[equation]).sqrt();
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
    let mut low = PerEquation::<f64>::default();
    for _ in 0..BISECTIONS {
        let middle = low.zip(high, |low, high| (low + high) / 2.0);
        let level = levels(middle);
        for equation in Equation::ALL {
            let end = if level[equation] > 1.0 { &mut low } else { &mut high };
            end[equation] = middle[equation];
        }
    }
    high
}
