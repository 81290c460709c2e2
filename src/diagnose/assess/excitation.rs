//! What these traces can tell at all.

use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::Size;
use crate::diagnose::search;
use crate::diagnose::thresholds::{DETECTABLE_SIGMA, FEWEST_ROWS};
use crate::diagnose::weak_form::Row;
use std::collections::BTreeMap;

/// Whether position or pressure do more than their noise.
pub(crate) fn is_excited(fit: &Fit<'_>) -> bool {
    let rows = &fit.rows().rows;
    if rows.len() < FEWEST_ROWS || fit.regression.count() < FEWEST_ROWS {
        return false;
    }
    let spread = |value: &dyn Fn(&Row) -> f64| {
        let mean = rows.iter().map(value).sum::<f64>() / rows.len() as f64;
        (rows.iter().map(|row| (value(row) - mean).powi(2)).sum::<f64>() / rows.len() as f64).sqrt()
    };
    let samples = rows.iter().map(|row| row.samples).min().unwrap_or(1) as f64;
    let noise = |std: f64| DETECTABLE_SIGMA * std / samples.sqrt();
    spread(&|row| row.mean.x_m) > noise(fit.problem.sensors.position.noise_std)
        || spread(&|row| row.mean.pa_pa) > noise(fit.problem.sensors.pressure.noise_std)
        || spread(&|row| row.mean.pb_pa) > noise(fit.problem.sensors.pressure.noise_std)
}

/// Smallest size of each further effect that these traces would have shown.
pub(crate) fn detection_limits(fit: &Fit<'_>) -> BTreeMap<&'static str, Size> {
    let widening = fit.dispersion(fit.bounded.chi2).sqrt();
    let mut sizes = BTreeMap::new();
    for term in search::open(fit) {
        let (Some(effect), Some(score)) =
            (fit.problem.terms[term].effect(), fit.regression.score(&fit.free, term))
        else {
            continue;
        };
        let value = DETECTABLE_SIGMA * score.std * widening;
        sizes.insert(effect.spec().id, Size { value, unit: effect.spec().unit });
    }
    sizes
}
