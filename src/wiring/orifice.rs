//! A leak through an orifice, Q = C √P, against the model's C P: cracks and loose fittings leak so.

use super::continuity::Continuity;
use super::contradiction::is_near;
use super::fit::Fit;
use super::priors::Priors;
use super::sensor_error::ERRORS;
use super::zeros::{ZeroCheck, held_against_zeros};
use super::{APART, LEAST_DROP};
use pitchleak_core::{Estimate, Leak, PerLeak};

/// A coefficient further below zero is no orifice's, standard deviations.
const NEGATIVE_SIGMAS: f64 = 3.0;
/// Two fits whose leaks are closer than this share of the alarm's threshold say the same of the cylinder.
const SAME_SHARE: f64 = 0.5;

/// Leaks by both laws, C P and C √P.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orifice {
    /// Size of the residual in standard deviations of the declared noise with leaks as C P alone, …
    pub before: f64,
    /// … and with part of them through an orifice.
    pub after: f64,
    /// Mean sizes of the leaks' flows over the records, m³/s, …
    pub sizes_m3s: PerLeak<Estimate<f64>>,
    /// … and means with their signs: an internal leak flows either way.
    pub net_m3s: PerLeak<f64>,
    /// The leaks by both laws held against zeros of the meters.
    pub zeros: Option<ZeroCheck>,
}

/// Whether `leaks` of which a part passes an orifice explain the stretch where leaks as C P do not, and no gain or
/// zero of a sensor does as well that would leave another leak; `None` where they don't.
pub(crate) fn orifice(stretch: &impl Continuity, leaks: PerLeak<bool>) -> Option<Orifice> {
    let rig = stretch.rig();
    let plain = Priors::declared(rig);
    let leaking: Vec<Leak> = Leak::ALL.into_iter().filter(|leak| leaks[*leak]).collect();
    let through = plain.with_orifices(leaking.iter().copied(), rig);
    let declared = stretch.fit(&plain)?;
    let fit = stretch.fit(&through)?;
    let backwards = Leak::ALL.into_iter().any(|leak| fit.orifice_sigmas(leak) < -NEGATIVE_SIGMAS);
    let drop = declared.chi_square() - fit.chi_square();
    if drop < LEAST_DROP || !is_near(&fit) || !fit.is_possible() || backwards {
        return None;
    }
    let rivals = ERRORS.map(|error| plain.with_error(error, rig)).into_iter();
    let rivals = rivals.chain([plain.with_zeros_off(rig, stretch.duration_s())]);
    let size = |fit: &Fit, leak: Leak| fit.flow_m3s(leak, stretch.driven(leak).sizes);
    let agrees = |rival: &Fit| {
        leaking.iter().all(|leak| {
            let apart_m3s = size(rival, *leak).value - size(&fit, *leak).value;
            apart_m3s.abs() < SAME_SHARE * rig.alarms.threshold_m3s[*leak]
        })
    };
    let is_beaten = |rival: &Fit| rival.chi_square() > fit.chi_square() + APART || agrees(rival);
    let is_best = rivals.filter_map(|rival| stretch.fit(&rival)).all(|rival| is_beaten(&rival));
    is_best.then(|| Orifice {
        before: declared.worst().sqrt(),
        after: fit.worst().sqrt(),
        sizes_m3s: PerLeak::from_fn(|leak| size(&fit, leak)),
        net_m3s: PerLeak::from_fn(|leak| fit.flow_m3s(leak, stretch.driven(leak).net).value),
        zeros: held_against_zeros(stretch, &through),
    })
}
