//! The unit of readings by their scatter alone, which the equations don't tell at rest.
//!
//! Either a data sheet tells the noise of all sensors exactly, or of none: with r the scatter over the sheet's,
//! p(r) = w Π N(ln r; 0, σ_exact²) + (1 − w) Π N(ln r; 0, σ_wide²) over the channels, σ_wide larger above 1 than below.
//! A mistake by a factor f divides its channels' r by f. So it takes all other sensors to be as their sheets say before one
//! of them is believed to be in another unit.

use super::raw_products::LEAST_SCATTER;
use super::readings::Mistake;
use crate::rig::Rig;
use pitchleak_core::continuity::{CHANNELS, EQUATIONS};

/// How often a data sheet tells the noise exactly. A guess.
const EXACT_SHARE: f64 = 0.2;
/// Spread of ln r where it does, and where it does not. Guesses.
const EXACT: f64 = 0.06;
const WIDE: f64 = 1.0;
/// The same of readings that scatter more: what is measured is a bound on the noise from above, with hum, drift and the
/// motion between seldom readings in it. A guess.
const WIDER: f64 = 3.0;

/// Scatter of each channel's readings over its sheet's noise; none where either is not known.
#[derive(Clone, Copy)]
pub(crate) struct OverSheet([Option<f64>; CHANNELS]);

impl OverSheet {
    /// Of this scatter, SI, in the order of the sensors' [noise](pitchleak_core::Sensors::noise_stds).
    pub fn of(scatter: [Option<f64>; CHANNELS], rig: &Rig) -> Self {
        let sheets = rig.sensors().noise_stds();
        Self(std::array::from_fn(|channel| {
            let sheet = Some(sheets[channel]).filter(|sheet| *sheet > 0.0);
            scatter[channel].zip(sheet).map(|(scatter, sheet)| scatter / sheet)
        }))
    }

    /// How many times louder than their sheets the louder flow and the position are, at least 1: what the equations have on
    /// their left sides.
    pub(super) fn louder(&self) -> [f64; EQUATIONS] {
        let [x, _, _, qa, qb] = self.0.map(|ratio| ratio.map_or(1.0, |ratio| ratio.max(1.0)));
        [qa.max(qb), x]
    }

    /// How many times louder than its sheet the loudest of position and pressures is.
    pub(super) fn of_columns(&self) -> f64 {
        let [x, pa, pb, _, _] = self.0.map(|ratio| ratio.unwrap_or(1.0));
        x.max(pa).max(pb)
    }

    /// Whether all channels scatter: none is computed.
    pub fn all_scatter(&self) -> bool {
        self.ln_ratios().is_some()
    }

    /// ln by which the odds of `mistake` change.
    pub fn ln_odds(&self, mistake: Mistake) -> f64 {
        let (Mistake::Factor(of, factor), Some(mut ln_ratios)) = (mistake, self.ln_ratios()) else {
            return 0.0;
        };
        let as_read = ln_density(&ln_ratios);
        of.channels().for_each(|channel| ln_ratios[channel] -= factor.ln());
        ln_density(&ln_ratios) - as_read
    }

    /// None where a channel is computed.
    fn ln_ratios(&self) -> Option<[f64; CHANNELS]> {
        let scatters =
            |ratio: &Option<f64>| ratio.is_some_and(|ratio| ratio.is_finite() && ratio > LEAST_SCATTER);
        self.0.iter().all(scatters).then(|| self.0.map(|ratio| ratio.unwrap_or(1.0).ln()))
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    use super::super::readings::Of;

    /// Readings a hundred times as loud as their sheet are in another unit, where all others are as their
    /// sheets say; not so where those know nothing of it either, or where one is computed.
    #[test]
    fn a_unit_shows_in_the_scatter_beside_sheets_that_are_right() {
        let flow_a = |ratio: f64, others: f64| OverSheet([others, others, others, ratio, others].map(Some));
        let ln_odds = |sheet: OverSheet| sheet.ln_odds(Mistake::Factor(Of::FlowA, 100.0));
        assert!(ln_odds(flow_a(100.0, 1.0)) > 3.0);
        assert!(ln_odds(flow_a(1.0, 1.0)) < -10.0);
        assert!(ln_odds(flow_a(100.0, 1.0)) > ln_odds(flow_a(100.0, 2.0)) + 3.0);
        let mut computed = flow_a(100.0, 1.0);
        computed.0[1] = Some(0.0);
        assert!(ln_odds(computed) == 0.0 && !computed.all_scatter());
        assert!(flow_a(100.0, 1.0).ln_odds(Mistake::Sign(Of::FlowA)) == 0.0);
    }

    /// Along the line of one channel, at the mean of all others, the density has the area that theirs leaves:
    /// of two normals joined at zero.
    #[test]
    fn the_density_is_that_of_both_kinds_of_sheets() {
        let steps = 400_000;
        let at = |k: i32| 40.0 * (f64::from(k) / f64::from(steps) - 0.5);
        let sum: f64 = (0..steps).map(|k| ln_density(&[at(k), 0.0, 0.0, 0.0, 0.0]).exp()).sum();
        let norm = |below: f64, above: f64| (0.5 * (below + above)).powi(-4) * std::f64::consts::TAU.sqrt();
        let expected = EXACT_SHARE * norm(EXACT, EXACT) + (1.0 - EXACT_SHARE) * norm(WIDE, WIDER);
        assert!((sum * 40.0 / f64::from(steps) / expected - 1.0).abs() < 1e-3);
    }
}
