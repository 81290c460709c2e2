//! The unit of readings by their scatter alone, which the equations don't tell at rest.
//!
//! Either a data sheet tells the noise of all sensors exactly, or of none: with r the scatter over the sheet's,
//! p(r) = w Π N(ln r; 0, σ_exact²) + (1 − w) Π N(ln r; 0, σ_wide²) over the channels, σ_wide larger above 1 than below.
//! A mistake by a factor f divides its channels' r by f. So it takes all other sensors to be as their sheets say before one of them is believed to be in another unit.

use super::readings::Mistake;
use crate::rig::Rig;
use pitchleak_core::continuity::CHANNELS;

/// How often a data sheet tells the noise exactly. A guess.
const EXACT_SHARE: f64 = 0.2;
/// Spread of ln r where it does, and where it does not. Guesses.
const EXACT: f64 = 0.06;
const WIDE: f64 = 1.0;
/// The same of readings that scatter more: what is measured is a bound on the noise from above, with hum, drift and the
/// motion between seldom readings in it. A guess.
const WIDER: f64 = 3.0;
/// Readings that scatter less, in that of their sheet, are computed, and their noise tells no unit.
const LEAST_RATIO: f64 = 0.01;

/// ln by which the scatter changes the odds of `mistake`.
pub(crate) fn ln_odds(scatter: &[Option<f64>; CHANNELS], mistake: Mistake, rig: &Rig) -> f64 {
    let (Mistake::Factor(of, factor), Some(mut ln_ratios)) = (mistake, ln_ratios(scatter, rig)) else {
        return 0.0;
    };
    let as_read = ln_density(&ln_ratios);
    of.channels().iter().for_each(|channel| ln_ratios[*channel] -= factor.ln());
    ln_density(&ln_ratios) - as_read
}

/// ln of each channel's scatter over its sheet's; none where one is computed.
pub(super) fn ln_ratios(scatter: &[Option<f64>; CHANNELS], rig: &Rig) -> Option<[f64; CHANNELS]> {
    let sensors = rig.sensors();
    let sheets = [sensors.position, sensors.pressure, sensors.pressure, sensors.flow_a, sensors.flow_b];
    let mut ln_ratios = [0.0; CHANNELS];
    for ((ln_ratio, scatter), sheet) in ln_ratios.iter_mut().zip(scatter).zip(sheets) {
        let ratio = scatter.map_or(0.0, |std| std / sheet.noise_std);
        if !(ratio.is_finite() && ratio > LEAST_RATIO) {
            return None;
        }
        *ln_ratio = ratio.ln();
    }
    Some(ln_ratios)
}

fn ln_density(ln_ratios: &[f64; CHANNELS]) -> f64 {
    let normal = |below: f64, above: f64| -> f64 {
        let norm = (0.5 * (below + above)).ln();
        let std = |ln_ratio: f64| if ln_ratio > 0.0 { above } else { below };
        ln_ratios.iter().map(|ln_ratio| -0.5 * (ln_ratio / std(*ln_ratio)).powi(2) - norm).sum()
    };
    let exact = EXACT_SHARE.ln() + normal(EXACT, EXACT);
    let wide = (1.0 - EXACT_SHARE).ln() + normal(WIDE, WIDER);
    let most = exact.max(wide);
    most + ((exact - most).exp() + (wide - most).exp()).ln()
}
