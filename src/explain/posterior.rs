//! The posterior over the table: which explanations of the readings are left, and how large each leak is under them.

use super::candidates::{Candidates, Scored};
use super::equations::NormalEquations;
use super::evidence::fit;
use super::independence::inflation;
use super::leak_sample::{LITTLE_LN, Weighed, Weighing, cut};
use super::mended::Mended;
use super::pass::{Pass, Tables};
use super::raw_products::{RawProducts, Statistic};
use crate::rig::Rig;
use crate::told::Told;
use pitchleak_core::PerLeak;

/// Explanations so much less probable than the best (e⁻⁹) are left out; numerical.
const LEAST_LN: f64 = 9.0;
/// A noise scale of so many times the readings' own scatter, squared, may be chance; above, an effect is missing, which is
/// alike in about ten blocks: a push of the pitch. Guesses.
const CHANCE_MISFIT2: f64 = 1.15;
const MISFIT_WORTH: f64 = 10.0;
/// Rows of an equation below which nothing can be said.
const LEAST_ROWS: f64 = 8.0;

/// A residual up to this is noise, in standard deviations of the declared noise. Chosen.
pub(crate) const NEAR: f64 = std::f64::consts::SQRT_2;

/// Explanations, best first.
pub(super) struct Posterior<'a> {
    pub weighed: Vec<Weighed<'a>>,
    /// Size of the residual in standard deviations of the declared noise, under the best explanation with the wiring as
    /// declared and under the best without.
    pub residuals: [Option<f64>; 2],
}

/// Whether there is enough to weigh.
pub(super) fn has_enough(statistic: &Statistic) -> bool {
    let rows = |c: usize| statistic.segments().iter().map(|s| s.rows(c)).sum::<f64>();
    rows(0).max(rows(1)) >= LEAST_ROWS
}

/// Weighs the whole table; `None` where nothing explains the readings.
pub(super) fn weigh<'a>(
    statistic: &Statistic,
    products: RawProducts,
    rig: &Rig,
    tables: &'a Tables,
    doubts_m3s: PerLeak<f64>,
    told: &Told,
) -> Option<Posterior<'a>> {
    let pass = Pass::new(statistic, &products, rig, tables, PerLeak::default(), told);
    let (first, inflation) = look(&pass);
    let found_m3s = PerLeak::from_fn(|leak| mean_level(&first, leak as usize));
    let products = products.worth(inflation);
    let last = Pass { doubts_m3s, ..Pass::new(statistic, &products, rig, tables, found_m3s, told) };
    let declared = last.equations(last.products, None, &last.columns());
    let posterior = weigh_all(&last, &declared, LEAST_LN);
    (!posterior.weighed.is_empty()).then_some(posterior)
}

/// Mean of C P: of a leak that opens at a pressure more than what flows, as a sensor's zero acts through C.
fn mean_level(weighed: &[Weighed<'_>], leak: usize) -> f64 {
    weighed.iter().map(|one| one.probability * one.levels_m3s[leak]).sum()
}

/// A first look: which leaks there are, and how many blocks are independent.
fn look<'a>(pass: &Pass<'a, '_>) -> (Vec<Weighed<'a>>, [f64; 2]) {
    let columns = pass.columns();
    let declared = pass.equations(pass.products, None, &columns);
    let Posterior { weighed, .. } = weigh_all(pass, &declared, LITTLE_LN);
    let inflation = weighed.first().map_or([1.0; 2], |best| {
        let coloured = if best.hypothesis.wiring.is_some() {
            [1.0; 2]
        } else {
            let fit = fit(&declared, &best.hypothesis.free);
            inflation(pass.products, &pass.scales(None), &declared, &columns, &best.hypothesis, &fit)
        };
        [0, 1].map(|c| {
            let misfit2 = best.misfits[c].powi(2);
            coloured[c].max(1.0 + MISFIT_WORTH * (misfit2 - CHANCE_MISFIT2).max(0.0))
        })
    });
    (weighed, inflation)
}

/// All explanations, as far as they are within `least_ln` of the best.
fn weigh_all<'a>(pass: &Pass<'a, '_>, declared: &NormalEquations, least_ln: f64) -> Posterior<'a> {
    let mut candidates = Candidates::with_constant_leaks(pass, declared, least_ln);
    candidates.add_courses();
    candidates.add_unfollowed();
    candidates.add_jumps();
    let mended = candidates.add_mistakes();
    let loudness = pass.over_sheet.louder().map(|ratio| ratio * ratio);
    let as_declared = Weighing { equations: declared, loudness };
    let weighings: Vec<Weighing<'_>> =
        std::iter::once(as_declared).chain(mended.iter().map(Mended::weighing)).collect();
    let mut all = candidates.best_first();
    let residual = |is: &dyn Fn(&Scored<'_>) -> bool| {
        let best = all.iter().find(|one| is(one) && one.ln_posterior.is_finite())?;
        let own = best.wiring.checked_sub(1).and_then(|at| mended.get(at));
        Some(own.map_or(best.scales[0].max(best.scales[1]).sqrt(), |own| own.residual(best.scales)))
    };
    let residuals = [residual(&|one| one.wiring == 0), residual(&|one| one.wiring > 0)];
    if tells_of_noise_alone(residuals) {
        all.retain(|one| one.wiring == 0);
    }
    Posterior { weighed: mix(pass, &weighings, all, least_ln), residuals }
}

/// Whether mistakes leave as much as the readings as declared do, and more than noise: then what prefers one is how the noise
/// is shared among the sensors, which no data sheet tells.
fn tells_of_noise_alone([declared, mistaken]: [Option<f64>; 2]) -> bool {
    declared.zip(mistaken).is_some_and(|(before, after)| after > NEAR.max(before))
}

/// Cuts leaks at zero, best first, until what follows cannot matter.
fn mix<'a>(
    pass: &Pass<'a, '_>,
    weighings: &[Weighing<'_>],
    all: Vec<Scored<'a>>,
    least_ln: f64,
) -> Vec<Weighed<'a>> {
    let mut best = f64::NEG_INFINITY;
    let mut kept: Vec<(f64, Weighed<'a>)> = Vec::new();
    for scored in all {
        if !scored.ln_posterior.is_finite() || scored.ln_posterior < best - least_ln {
            break;
        }
        let Some(weighing) = weighings.get(scored.wiring) else { continue };
        let (ln, weighed) = cut(pass, *weighing, scored, best);
        best = best.max(ln);
        kept.push((ln, weighed));
    }
    kept.retain(|(ln, _)| *ln > best - least_ln);
    let sum: f64 = kept.iter().map(|(ln, _)| (ln - best).exp()).sum();
    kept.sort_by(|a, b| b.0.total_cmp(&a.0));
    kept.into_iter().map(|(ln, one)| Weighed { probability: (ln - best).exp() / sum, ..one }).collect()
}
