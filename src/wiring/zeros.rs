//! A meter whose zero is off against a leak: both let oil go missing, the one always, the other with the pressure.

use super::continuity::{Continuity, Recorded};
use super::fit::Fit;
use super::priors::Priors;
use crate::rig::Rig;
use crate::trace::Record;
use pitchleak_core::{Estimate, Leak, Parameter, PerLeak};

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
    /// The zero of each meter alone, off and steady.
    pub single: [Option<SingleZero>; 2],
    /// How long the records are, s.
    pub duration_s: f64,
}

impl ZeroCheck {
    /// By how much χ² is larger without this leak where zeros may be off: what zeros and leaks explain alike counts for
    /// none, so that it follows chance (2 degrees of freedom) where there is no leak, however few the records.
    pub fn for_leak_beside_zeros(&self, leak: Leak) -> f64 {
        self.for_leak[leak] + self.for_zeros
    }
}

/// One meter's zero that is off, and steady, beside all leaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SingleZero {
    /// By how much χ² falls.
    pub drop: f64,
    /// How far it is off, m³/s.
    pub offset_m3s: Estimate<f64>,
    /// By how much the leaks' mean flows then change, m³/s.
    pub shift_m3s: PerLeak<f64>,
    /// What they then are, m³/s: as well as they are known if this zero may be off.
    pub flows_m3s: PerLeak<Estimate<f64>>,
}

/// The meters' zeros, which may both be off.
pub(super) const ZEROS: [Parameter; 2] = [Parameter::OffsetA, Parameter::OffsetB];
/// What a bend gives a fit to choose (leaks, their slopes and the oil once more) is worth less in χ² by chance.
const BEYOND_CHANCE: f64 = 25.0;

/// Holds leaks against zeros, by generalised least squares over all the records; both may change through them. Of few
/// records nothing is for a leak. `None` where there are none. Use an [`Excerpt`](super::Excerpt) of a long trace.
pub fn zero_check(records: &[Record], rig: &Rig) -> Option<ZeroCheck> {
    changing_leaks_or_zeros(&Recorded::new(records, rig)?)
}

/// Holds leaks against zeros over the last of the records: a leak that grows and then stays goes in no straight line,
/// and a steady zero would seem to explain the bend. As long as leaks that change their course explain the records
/// better than zeros do, the later half is looked at.
pub(crate) fn zero_check_lately(records: &[Record], rig: &Rig) -> Option<ZeroCheck> {
    let mut stretch = Recorded::new(records, rig)?;
    loop {
        let leaks = straight(&stretch);
        let free = with_free_zeros(&stretch, &leaks)?;
        if !do_leaks_bend(&stretch, &free) {
            return against_zeros(&stretch, &leaks, free);
        }
        stretch = Recorded::new(stretch.records.split_at(stretch.records.len() / 2).1, rig)?;
    }
}

/// Leaks that go straight through a stretch.
fn straight(stretch: &impl Continuity) -> Priors {
    Priors::declared(stretch.rig()).with_changing_leaks(stretch.duration_s())
}

fn with_free_zeros(stretch: &impl Continuity, leaks: &Priors) -> Option<Fit> {
    stretch.fit_of_any_length(&leaks.with_zeros_off(stretch.rig(), stretch.duration_s()))
}

/// Whether leaks that go straight in each half, quarter or eighth of the records explain them better than zeros do with
/// leaks that go straight throughout, whose fit this is.
fn do_leaks_bend(whole: &Recorded<'_>, zeros: &Fit) -> bool {
    let (records, rig, zeros) = (whole.records, whole.rig(), zeros.chi_square());
    let bent = |parts: usize| {
        let chi_square = |part: &[Record]| {
            let part = Recorded::new(part, rig)?;
            Some(part.fit(&straight(&part))?.chi_square())
        };
        records.chunks(records.len().div_ceil(parts)).map(chi_square).sum::<Option<f64>>()
    };
    let better = |parts: u32| {
        bent(parts as usize).is_some_and(|left| zeros - left > BEYOND_CHANCE * f64::from(parts - 1))
    };
    [2, 4, 8].into_iter().any(better)
}

/// Holds leaks against zeros over any stretch.
pub(crate) fn changing_leaks_or_zeros(stretch: &impl Continuity) -> Option<ZeroCheck> {
    held_against_zeros(stretch, &straight(stretch))
}

/// Holds `leaks` against zeros. Zeros that explain a leak only beside another one that lets oil in don't explain it.
pub(super) fn held_against_zeros(stretch: &impl Continuity, leaks: &Priors) -> Option<ZeroCheck> {
    against_zeros(stretch, leaks, with_free_zeros(stretch, leaks)?)
}

/// Holds leaks against zeros where the fit with free zeros is at hand.
fn against_zeros(stretch: &impl Continuity, leaks: &Priors, free: Fit) -> Option<ZeroCheck> {
    let zeros = leaks.with_zeros_off(stretch.rig(), stretch.duration_s());
    let free = stretch.without_inflows(free, zeros)?;
    // A leak's size must be known whatever the others are: that of a zero beside them is held against these.
    let signed = stretch.fit_of_any_length(leaks)?;
    let declared = stretch.without_inflows(signed, *leaks)?;
    let without = PerLeak::from_fn(|leak| stretch.fit_of_outflows(&zeros.without(leak)).unwrap_or(free));
    // Where nothing fits, nothing is told apart.
    let inflation = free.worst().max(1.0);
    let beyond = |other: &Fit| (other.chi_square() - declared.chi_square()) / inflation;
    Some(ZeroCheck {
        for_leak: without.map(|fit| beyond(&fit)),
        for_zeros: -beyond(&free),
        offsets_m3s: free.offsets_m3s(),
        offsets_without_m3s: without.map(|fit| fit.offsets_m3s()),
        leaks_m3spa: free.leak_coefficients(),
        single: ZEROS.map(|zero| single_zero(stretch, leaks, &signed, zero)),
        duration_s: stretch.duration_s(),
    })
}

fn single_zero(
    stretch: &impl Continuity,
    leaks: &Priors,
    declared: &Fit,
    zero: Parameter,
) -> Option<SingleZero> {
    let fit = stretch.fit_of_any_length(&leaks.with_zero_off(zero, stretch.rig()))?;
    let flows_m3s = |fit: &Fit| PerLeak::from_fn(|leak| fit.flow_m3s(leak, stretch.driven(leak).sizes));
    let beside_m3s = flows_m3s(&fit);
    Some(SingleZero {
        drop: (declared.chi_square() - fit.chi_square()) / fit.worst().max(1.0),
        offset_m3s: fit.parameter(zero),
        shift_m3s: beside_m3s.zip(flows_m3s(declared)).map(|(beside, alone)| beside.value - alone.value),
        flows_m3s: beside_m3s,
    })
}
