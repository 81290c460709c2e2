//! The measurement that would settle most.

use crate::diagnose::outcome::NextMeasurement;
use crate::diagnose::search::{Selected, Selection};
use pitchleak_core::Effect;

/// Of all measurements that show a named effect or its strongest rival alone, the one whose answer is the least certain: it tells most,
/// since a question of yes or no tells the entropy of its answer (Lindley 1956, "On a measure of the information provided by an experiment").
pub(crate) fn next_measurement(selection: &Selection<'_>) -> Option<NextMeasurement> {
    let terms = &selection.fit.problem.terms;
    let of_one = |one: &Selected| {
        let named = (terms[one.term].effect()?, one.probability);
        let rival = one.rivals.iter().max_by(|a, b| a.probability.total_cmp(&b.probability))?;
        let rival = (*rival.effects.first()?, rival.probability);
        Some([parting(named, rival), parting(rival, named)])
    };
    let all = selection.effects.iter().filter_map(of_one).flatten();
    all.max_by(|a, b| entropy(a.probability).total_cmp(&entropy(b.probability)))
}

fn parting((one, probability): (Effect, f64), (other, _): (Effect, f64)) -> NextMeasurement {
    NextMeasurement {
        measurement: one.spec().measurement,
        between: [one.spec().id, other.spec().id],
        probability,
    }
}

/// Of the answer to a question that is yes with this probability, nat.
fn entropy(yes: f64) -> f64 {
    let part = |p: f64| if p > 0.0 { -p * p.ln() } else { 0.0 };
    part(yes) + part(1.0 - yes)
}
