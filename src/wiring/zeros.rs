//! A meter whose zero is off against a leak: both let oil go missing, the one always, the other with the pressure.

use super::blocks::{Block, blocks};
use super::fit::Fit;
use super::priors::Priors;
use crate::rig::Rig;
use crate::trace::Record;
use pitchleak_core::{Estimate, PerLeak};

/// Leaks against zeros of the flow meters that are off, and drift, undeclared. A zero is off by 1 % of full scale (1 σ):
/// what takes several times as much is rather a leak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroCheck {
    /// By how much χ² is larger where zeros stand in for this leak: beyond 10 or so it is a leak; below, a zero may be
    /// off instead; far below zero, one is.
    pub for_leak: PerLeak<f64>,
    /// By how much χ² falls where zeros are off beside all leaks: beyond chance (5 degrees of freedom at the most) they
    /// are off, or something else is that looks like it.
    pub for_zeros: f64,
    /// Zeros of meters A and B in the middle of the records with all leaks free, m³/s …
    pub offsets_m3s: [Estimate<f64>; 2],
    /// … and with each leak taken out.
    pub offsets_without_m3s: PerLeak<[Estimate<f64>; 2]>,
    /// Leak coefficients beside free zeros, m³/(s·Pa), in the middle of the records; their spread grows with the misfit.
    pub leaks_m3spa: PerLeak<Estimate<f64>>,
}

/// Holds leaks against zeros, by generalised least squares over all the records; both may change through them. `None`
/// where the records are too few. Use an [`Excerpt`](super::Excerpt) of a long trace.
pub fn zero_check(records: &[Record], rig: &Rig) -> Option<ZeroCheck> {
    let duration_s = duration_s(records)?;
    let leaks = Priors::declared(rig).with_changing_leaks(duration_s);
    held_against_zeros(&blocks(records, &rig.cylinder), rig, &leaks, duration_s)
}

/// The same of `leaks` in blocks that span so long.
pub(super) fn held_against_zeros(
    blocks: &[Block],
    rig: &Rig,
    leaks: &Priors,
    duration_s: f64,
) -> Option<ZeroCheck> {
    let zeros = leaks.with_zeros_off(rig, duration_s);
    let declared = Fit::of(blocks, rig, leaks)?;
    let free = Fit::of(blocks, rig, &zeros)?;
    let without = PerLeak::from_fn(|leak| Fit::of(blocks, rig, &zeros.without(leak)).unwrap_or(free));
    // Where nothing fits, nothing is told apart.
    let inflation = free.worst().max(1.0);
    let beyond = |other: &Fit| (other.chi_square() - declared.chi_square()) / inflation;
    Some(ZeroCheck {
        for_leak: without.map(|fit| beyond(&fit)),
        for_zeros: -beyond(&free),
        offsets_m3s: free.offsets_m3s(),
        offsets_without_m3s: without.map(|fit| fit.offsets_m3s()),
        leaks_m3spa: free.leak_coefficients(),
    })
}

pub(super) fn duration_s(records: &[Record]) -> Option<f64> {
    Some(records.last()?.t_s - records.first()?.t_s)
}
