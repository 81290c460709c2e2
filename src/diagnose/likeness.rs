//! How alike the candidates look in given traces: what no method could tell apart.

use super::regression::Prepared;
use super::{Declared, Series, adequacy, declared_fit, select, shape, thinned};
use pitchleak_core::Effect;
use pitchleak_core::effects::EffectConstants;

/// A candidate with the constants in which it is not linear.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// The effect.
    pub effect: Effect,
    /// Its constants.
    pub shape: EffectConstants<f64>,
    /// Standard deviation of its size with the declared model's constants free, in the effect's unit.
    pub std: f64,
    /// The size in standard deviations at which the diagnosis would name it.
    pub critical_sigma: f64,
}

/// What each candidate leaves in traces of a sound rig once the declared model is fitted, compared.
///
/// A candidate's score (Rao 1948) is normal with variance one. An effect of m standard deviations moves its own
/// score by m and that of a rival by ρ m, where ρ is the correlation of the two columns under
/// the noise: with ρ near one the exact likelihood itself tosses a coin between them.
#[derive(Clone, Debug)]
pub struct Likeness {
    /// The candidates; one of several constants stands here several times.
    pub looks: Vec<Look>,
    /// Correlation of each pair of them, in the same order.
    pub correlation: Vec<Vec<f64>>,
}

impl Likeness {
    /// Compares all candidates on `traces` of a sound rig. Constants that are fitted are taken from a few places of
    /// their range, and from `also`.
    pub fn of(traces: &[Series], declared: &Declared, also: &[EffectConstants<f64>]) -> Self {
        let (traces, declared) = thinned(traces, declared);
        let checks = adequacy::check_sensors(&traces, &declared.sensors);
        let fit = declared_fit(&traces, &declared, &checks, &|| ());
        let (looks, columns): (Vec<_>, Vec<_>) = select::candidates(&fit)
            .into_iter()
            .flat_map(|term| shape::places(&fit, term, also).into_iter().map(move |shape| (term, shape)))
            .filter_map(|(term, shape)| {
                let prepared = fit.prepare(&fit.scoring, term, shape)?;
                let effect = fit.terms[term].effect()?;
                let critical_sigma = select::critical_sigma(&fit, shape);
                Some((Look { effect, shape, std: prepared.std(), critical_sigma }, prepared))
            })
            .unzip();
        let row = |a: &Prepared| columns.iter().map(|b| a.correlation(b)).collect();
        let correlation = columns.iter().map(row).collect();
        Self { looks, correlation }
    }
}
