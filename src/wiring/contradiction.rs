//! Where the declared wiring does not explain a stretch, and whether a mistake of it does.

use super::continuity::Recorded;
use super::fit::Fit;
use super::mistake::Mistake;
use super::priors::Priors;
use super::readings::Readings;
use super::{CONTRAST, LEAST_DROP};
use pitchleak_core::Leak;

/// Mean square residual, over the declared noise, that is far from it.
const FAR: f64 = 4.0;
/// Up to here it is near, …
const NEAR: f64 = 1.3;
/// … or as far beyond 1 as chance carries a mean of χ² terms, in standard deviations of it, …
const CHANCE_SIGMAS: f64 = 4.0;
/// … or that share of the declared wiring's, and this: effects that nobody declared leave more than noise.
const FAR_CONTRAST: f64 = 50.0;
const NEAR_AT_MOST: f64 = 4.0;
/// A residual that is less than far off contradicts the declared wiring from here on where a mistake explains this in χ²
/// and leaves chance alone.
const NOT_NOISE: f64 = 1.8;
const PLAIN_DROP: f64 = 150.0;
/// A leak so far below zero, in standard deviations, contradicts it as well.
const IMPOSSIBLE_SIGMAS: f64 = 10.0;
/// A mistake that leaves readings out must leave at least so many rows.
const ENOUGH_ROWS: usize = 40;

/// The declared wiring, with leaks by one law.
pub(super) struct Declared {
    pub priors: Priors,
    pub fit: Fit,
    /// A leak lies below zero.
    impossible: bool,
    /// Mean square residual by the law that leaves least.
    least: f64,
}

impl Declared {
    /// With leaks as C P; where those are contradicted, also with part of each through an orifice.
    pub fn by_each_law(stretch: &Recorded<'_>) -> Vec<Self> {
        let rig = stretch.rig();
        let plain = Priors::declared(rig);
        let Some(fit) = stretch.fit(&plain) else { return vec![] };
        let impossible = fit.negative_leak_sigmas() >= IMPOSSIBLE_SIGMAS;
        if fit.worst() < NOT_NOISE && !impossible {
            return vec![];
        }
        let orifices = plain.with_orifices(Leak::ALL, rig);
        let Some(through) = stretch.fit(&orifices) else { return vec![] };
        let least = fit.worst().min(through.worst());
        let plain = Self { priors: plain, fit, impossible, least };
        // Beside its orifice a leak as C P may be anything.
        let orifices = Self { priors: orifices, fit: through, impossible: false, least };
        [plain, orifices].into_iter().filter(Self::is_contradicted).collect()
    }

    fn is_contradicted(&self) -> bool {
        self.fit.worst() >= FAR || self.least >= NOT_NOISE || self.impossible
    }

    /// Whether this fit of mended records explains what the declared wiring does not.
    pub fn is_explained_by(&self, mistake: Mistake, mended: &Fit) -> bool {
        let (before, after) = (self.fit.worst(), mended.worst());
        let drop = (self.fit.mean_chi_square() - mended.mean_chi_square()) * mended.row_count() as f64;
        let far = before >= FAR && before >= CONTRAST * after && drop >= LEAST_DROP;
        let plain = self.least >= NOT_NOISE && drop >= PLAIN_DROP && self.leaves_chance(mended);
        let contradiction_gone = self.impossible && before < FAR;
        let near = is_near(mended) || after <= NEAR_AT_MOST && before >= FAR_CONTRAST * after;
        let enough_rows = mended.row_count() >= ENOUGH_ROWS.min(self.fit.row_count() / 2);
        let wanted = self.lets_flows_shrink() || !makes_flows_smaller(mistake);
        // A pressure's zero is a constant flow through the leaks: much looks like it.
        let enough = far || !matches!(mistake, Mistake::Absolute(_)) && (plain || contradiction_gone);
        near && mended.is_possible() && enough_rows && wanted && enough
    }

    /// Whether the residuals of both equations are chance alone, and neither is larger than before.
    fn leaves_chance(&self, mended: &Fit) -> bool {
        let ratios = mended.ratios.iter().zip(self.fit.ratios).zip(mended.rows);
        ratios.into_iter().all(|((after, before), rows)| {
            after.is_none_or(|after| after <= by_chance(rows) * before.unwrap_or(1.0).min(1.0))
        })
    }

    /// Flows read too large carry the piston too far; where they do not, dividing them only makes the residual small.
    fn lets_flows_shrink(&self) -> bool {
        self.fit.ratios[1].is_some_and(|ratio| ratio >= FAR)
    }
}

fn makes_flows_smaller(mistake: Mistake) -> bool {
    use Readings::{FlowA, FlowB, Flows};
    matches!(mistake, Mistake::Scaled(FlowA | FlowB | Flows, factor) if factor > 1.0)
}

/// Whether a fit leaves about the noise.
pub(super) fn is_near(fit: &Fit) -> bool {
    let near =
        |(ratio, rows): (&Option<f64>, usize)| ratio.is_none_or(|ratio| ratio <= NEAR.max(by_chance(rows)));
    fit.ratios.iter().zip(fit.rows).all(near)
}

/// Up to where chance carries a mean of so many terms of χ².
fn by_chance(rows: usize) -> f64 {
    1.0 + CHANCE_SIGMAS * (2.0 / rows.max(1) as f64).sqrt()
}
