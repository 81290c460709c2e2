//! What zeros of the flow meters that are off, undeclared, leave of a leak.

use super::statement::with_interval;
use super::{Findings, Reason, ReasonId};
use crate::units::LPM_PER_M3S;
use crate::wiring::{SingleZero, ZeroCheck};
use pitchleak_core::Leak;

/// χ² by which a leak has to explain the trace better than zeros that are off: one of 2 % of full scale costs 4.
const LEAK_OVER_ZEROS: f64 = 4.0;
/// χ² that a leak has to explain beside zeros that are off: beyond chance, three standard deviations.
const LEAK_BESIDE_ZEROS: f64 = 9.0;
/// Zeros that would have to be off by more than this, as shares of full scale, both meters together (root of the sum of
/// squares), for a leak that stands alone and is larger than one zero may be off, are not: a leak through an orifice would
/// pass for them otherwise.
const ZEROS_AT_MOST: f64 = 0.023;
const ZERO_AT_MOST: f64 = 0.02;
/// χ² by which one steady zero beside all leaks has to explain the trace better to be called so: five standard deviations.
const ZERO_BEYOND_CHANCE: f64 = 25.0;
/// χ² by which such a zero counts for what it may change: three standard deviations.
const ZERO_LIKELY: f64 = 9.0;
/// A leak is known beside a zero that may be off where this many standard deviations are within its alarm's threshold …
const KNOWN_SIGMAS: f64 = 2.0;
/// … or this share of it: who acts on it acts alike.
const KNOWN_SHARE: f64 = 1.0 / 3.0;
/// Of a shorter stretch it is said how short it is, s.
const SHORT_S: f64 = 10.0;

const ZEROS_TELL: &str = "read the meters with their valves shut, or record while the pressures change; how far zeros may be \
                          off belongs in the rig file (`bias`)";

/// Why zeros of the meters put a leak that stands in doubt.
pub(super) fn zeros(findings: &Findings<'_>) -> Option<Reason> {
    let zeros = findings.suspicions.zeros?;
    let text = offset_or_leak(findings, &zeros)
        .or_else(|| offset_in_leak(findings, &zeros))
        .or_else(|| size_unknown(findings, &zeros))?;
    Some(Reason::new(ReasonId::OffsetOrLeak, text, ZEROS_TELL))
}

/// Leaks whose alarm stands.
fn standing<'a>(findings: &'a Findings<'_>) -> impl Iterator<Item = Leak> + 'a {
    Leak::ALL.into_iter().filter(|leak| findings.active[*leak])
}

/// No leak may be there.
fn offset_or_leak(findings: &Findings<'_>, zeros: &ZeroCheck) -> Option<String> {
    let leak = standing(findings).find(|leak| {
        let explained =
            zeros.for_leak[*leak] < LEAK_OVER_ZEROS || zeros.for_leak_beside_zeros(*leak) < LEAK_BESIDE_ZEROS;
        explained && may_be_zeros(findings, zeros, *leak)
    })?;
    let offsets = zeros.offsets_without_m3s[leak].map(|offset| offset.scaled(LPM_PER_M3S));
    let off = offsets.iter().zip(["qa", "qb"]).filter(|(offset, _)| offset.value.abs() > 2.0 * offset.std);
    let off = off
        .map(|(offset, name)| format!("{name} by {} L/min", with_interval(offset.value, Some(offset.std))));
    let off: Vec<_> = off.collect();
    let by = if off.is_empty() { String::new() } else { format!(" ({})", off.join(", ")) };
    let of_what = if zeros.duration_s < SHORT_S {
        format!("the {:.1} s that count so far", zeros.duration_s)
    } else {
        "this trace".to_owned()
    };
    Some(format!(
        "zeros of the flow meters that are off{by} explain {of_what} nearly as well as the {} leak does (χ² {:+.1})",
        leak.label(),
        zeros.for_leak[leak]
    ))
}

/// Whether meters are off by so much now and then. Several leaks at once are rarer than a wrong meter.
fn may_be_zeros(findings: &Findings<'_>, zeros: &ZeroCheck, leak: Leak) -> bool {
    let [a, b] = findings.meters_lpm;
    let [off_a, off_b] = zeros.offsets_without_m3s[leak].map(|offset| offset.value * LPM_PER_M3S);
    (off_a / a).hypot(off_b / b) <= ZEROS_AT_MOST
        || findings.leakage[leak].mean_lpm <= ZERO_AT_MOST * a.min(b)
        || standing(findings).count() > 1
}

/// Each meter's zero.
fn singles(zeros: &ZeroCheck) -> impl Iterator<Item = (&'static str, SingleZero)> {
    ["qa", "qb"].into_iter().zip(zeros.single).filter_map(|(name, zero)| Some((name, zero?)))
}

/// A leak is there, but its size has a meter's zero in it.
fn offset_in_leak(findings: &Findings<'_>, zeros: &ZeroCheck) -> Option<String> {
    let changed = |zero: &SingleZero| {
        let shift_lpm = zero.shift_m3s.map(|shift| shift * LPM_PER_M3S);
        let leak = standing(findings).find(|leak| shift_lpm[*leak].abs() >= findings.threshold_lpm[*leak])?;
        Some((leak, shift_lpm[leak]))
    };
    let likely = singles(zeros).filter(|(_, zero)| zero.drop >= ZERO_BEYOND_CHANCE);
    let likely = likely.filter_map(|(name, zero)| Some((name, zero, changed(&zero)?)));
    let (name, zero, (leak, shift_lpm)) = likely.max_by(|(_, a, _), (_, b, _)| a.drop.total_cmp(&b.drop))?;
    let offset = zero.offset_m3s.scaled(LPM_PER_M3S);
    Some(format!(
        "a zero of {name} that is off by {} L/min explains this trace better (χ² {:+.0}); the {} leak is then {:.2} L/min {}",
        with_interval(offset.value, Some(offset.std)),
        -zero.drop,
        leak.label(),
        shift_lpm.abs(),
        if shift_lpm < 0.0 { "smaller" } else { "larger" }
    ))
}

/// A leak is there, but as long as a meter's zero may be off its size is not known: the stretch is too short to tell, or
/// says that the zero is off, if only by chance.
fn size_unknown(findings: &Findings<'_>, zeros: &ZeroCheck) -> Option<String> {
    let is_unknown = |zero: &SingleZero, leak: Leak| {
        let std_lpm = LPM_PER_M3S * zero.flows_m3s[leak].std;
        let shift_lpm = LPM_PER_M3S * zero.shift_m3s[leak].abs();
        let threshold_lpm = findings.threshold_lpm[leak];
        let share_lpm = KNOWN_SHARE * LPM_PER_M3S * zero.flows_m3s[leak].value;
        KNOWN_SIGMAS * std_lpm >= threshold_lpm.max(share_lpm)
            || zero.drop >= ZERO_LIKELY && shift_lpm + std_lpm >= threshold_lpm
    };
    let (name, zero, leak) = singles(zeros).find_map(|(name, zero)| {
        let leak = standing(findings).find(|leak| is_unknown(&zero, *leak))?;
        Some((name, zero, leak))
    })?;
    let flow = zero.flows_m3s[leak].scaled(LPM_PER_M3S);
    Some(format!(
        "how large the {} leak is cannot be told from a zero of {name} that is off: beside one it is {} L/min",
        leak.label(),
        with_interval(flow.value, Some(flow.std))
    ))
}
