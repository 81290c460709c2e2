//! How alike the candidates look in given traces: what no method could tell apart.

use super::candidates::{self, Candidates};
use super::constants;
use crate::diagnose::data::{Declared, Series, check_sensors, thinned};
use crate::diagnose::fit::{Fit, PartialColumn, Problem};
use pitchleak_core::Effect;
use pitchleak_core::effects::EffectConstants;

/// An effect with the constants in which it is not linear.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// The effect.
    pub effect: Effect,
    /// Its constants.
    pub constants: EffectConstants<f64>,
    /// Standard deviation of its size with the declared model's constants free, in the effect's unit.
    pub std: f64,
    /// The size in standard deviations at which the diagnosis would name it.
    pub critical_sigma: f64,
}

/// The columns of all candidates in traces of a sound rig, with the declared model fitted, compared.
///
/// A candidate's score (Rao 1948) is normal with variance one. An effect of m standard deviations moves its own
/// score by m and that of a rival by ρ m, where ρ is the correlation of the two columns under
/// the noise: with ρ near one the exact likelihood itself tosses a coin between them.
#[derive(Clone, Debug)]
pub struct Collinearity {
    /// The candidates; one of several constants stands here several times.
    pub candidates: Vec<Candidate>,
    /// Correlation of each pair of them, in the same order.
    pub correlation: Vec<Vec<f64>>,
}

impl Collinearity {
    /// Compares all candidates on `traces` of a sound rig. Constants that are fitted are taken from a few places of
    /// their range, and from `also`.
    pub fn of(traces: &[Series], declared: &Declared, also: &[EffectConstants<f64>]) -> Self {
        let (traces, declared) = thinned(traces, declared);
        let problem = Problem::new(&traces, &declared, &check_sensors(&traces, &declared));
        let fit = Fit::declared(&problem, &|| ());
        let mut search = Candidates::of(&fit);
        let (candidates, columns): (Vec<_>, Vec<_>) = candidates::open(&fit)
            .into_iter()
            .flat_map(|term| constants::places(&fit, term, also).into_iter().map(move |one| (term, one)))
            .filter_map(|(term, constants)| {
                let column = search.partial(&fit.free, term, constants)?;
                let effect = problem.terms[term].effect()?;
                let critical_sigma = candidates::critical_sigma(&fit, constants);
                Some((Candidate { effect, constants, std: column.std(), critical_sigma }, column))
            })
            .unzip();
        let row = |a: &PartialColumn| columns.iter().map(|b| a.correlation(b)).collect();
        let correlation = columns.iter().map(row).collect();
        Self { candidates, correlation }
    }
}
