//! The verdict as sentences.

use super::{Episode, Findings, Leakage, Reason, Status};
use crate::explain::MISFIT_TOLD;
use crate::units::duration;
use pitchleak_core::{Estimate, Leak};

/// Where to look for a leak.
pub fn advice(leak: Leak) -> &'static str {
    match leak {
        Leak::Internal => "oil passes the piston seal: plan its change, check the bore for scoring",
        Leak::ExternalA => "oil leaves the piston-side chamber: check its port, hose, fittings and valve",
        Leak::ExternalB => "oil leaves the rod-side chamber: check rod seal, port, hose and valve",
    }
}

/// The verdict in a few sentences: first why it is in doubt, if it is, then what leaks, then what does not, then what
/// happened before.
pub(super) fn text(findings: &Findings<'_>, status: Status, faults: &[Leak], reasons: &[Reason]) -> String {
    let mut sentences = Vec::new();
    let (below, open) = findings.below_and_open(faults);
    if status.is_sure() {
        sentences.extend(faults.iter().map(|leak| fault(findings, *leak)));
        sentences.extend(law(findings));
        sentences.extend(excluded(findings, &below));
        // A sure verdict says nothing of these.
        sentences.extend(
            (!open.is_empty()).then(|| format!("This trace cannot tell about {} leaks.", join(&open, "and"))),
        );
        sentences.extend(notes(findings));
        sentences.extend(remains(findings));
    } else {
        sentences.extend(reasons.iter().take(1).flat_map(why));
        sentences.extend(apparent(findings, faults));
        if status == Status::NotSure {
            sentences.extend(excluded(findings, &below));
            sentences.extend(remains(findings));
        }
    }
    sentences.extend(before(findings, faults));
    // Without any rig file the line of the rig says so.
    if findings.assumed.sensors && !findings.assumed.rig {
        sentences.push("The rig file has no [sensors]: meters as the paper's are supposed.".to_owned());
    }
    // Of a leak that the trace cannot tell about a sure verdict says no more.
    let told = Leak::ALL.into_iter().filter(|leak| !(status.is_sure() && open.contains(leak)));
    sentences.extend(told.filter_map(|leak| grows(findings, leak, status)));
    sentences.join(" ")
}

/// What was seen, and what to check, a sentence each.
pub(crate) fn why(reason: &Reason) -> impl Iterator<Item = String> {
    std::iter::once(sentence(&reason.text)).chain(reason.suggestion.as_deref().map(sentence))
}

fn fault(findings: &Findings<'_>, leak: Leak) -> String {
    let label = capital(leak.label());
    match Episode::last_of(&findings.episodes, leak) {
        Some(last) if last.to_s.is_some() => {
            let count = findings.episodes.iter().filter(|episode| episode.fault == leak).count();
            let often = if count > 1 { format!(", {count} times") } else { String::new() };
            format!(
                "{label} leak that comes and goes{often}, last {:.2} L/min on average until {}: {}.",
                last.mean_lpm,
                findings.trace.time(last.to_s.unwrap_or(last.from_s), 1),
                advice(leak)
            )
        }
        Some(last) if !findings.is_known(leak) => format!(
            "{label} leak since {}, {:.2} L/min on average: {}.",
            findings.trace.time(last.from_s, 1),
            last.mean_lpm,
            advice(leak)
        ),
        _ => format!("{label} leak of {} L/min: {}.", interval(&findings.leakage[leak]), advice(leak)),
    }
}

/// By which law they leak, where it is not the model's for certain.
fn law(findings: &Findings<'_>) -> Option<String> {
    let decision = findings.decision?;
    let is_so = |law: &str| {
        let has_law = |part: &str| part.split_once(':').is_some_and(|(_, own)| own == law);
        decision.probability_where(has_law) >= LAW_SURE
    };
    LAWS.iter().find(|(law, _)| is_so(law)).map(|(_, text)| (*text).to_owned())
}

/// Laws, as in the table of explanations, and in words.
const LAWS: [(&str, &str); 3] = [
    ("orifice", "It leaks as through an orifice, by the root of the pressure."),
    ("cracking", "It opens at a pressure."),
    (
        "unfollowed",
        "It is steadier than the pressures read: look whether one of their sensors hangs or lags.",
    ),
];

/// A law is named where it is at least so probable: explanations below 1 % are not listed. Chosen.
const LAW_SURE: f64 = 0.9;

/// Leaks whose upper bound is below the threshold.
fn excluded(findings: &Findings<'_>, below: &[Leak]) -> Option<String> {
    let limit = below.iter().map(|leak| findings.threshold_lpm[*leak]).fold(0.0, f64::max);
    (!below.is_empty()).then(|| format!("No {} leak above {limit:.2} L/min.", join(below, "or")))
}

/// What of sensors and rig is not as declared, which the verdict has taken into account.
fn notes(findings: &Findings<'_>) -> impl Iterator<Item = String> {
    let notes = findings.decision.into_iter().flat_map(|decision| &decision.notes);
    let stands = Leak::ALL.into_iter().filter(|leak| findings.active[*leak] && findings.is_below(*leak));
    let stands = match stands.collect::<Vec<_>>().as_slice() {
        [] => None,
        [one] => Some(format!("That explains the alarm of the {} leak.", one.label())),
        some => Some(format!("That explains the alarms of the {} leaks.", join(some, "and"))),
    };
    notes.map(|note| format!("Besides, {}.", note.text)).chain(stands)
}

/// What no explanation fits, where it is too little to contradict a verdict whose intervals it widens.
fn remains(findings: &Findings<'_>) -> Option<String> {
    let decision = findings.decision?;
    let misfit = decision.misfit;
    (misfit > MISFIT_TOLD && !decision.fits_nothing()).then(|| {
        format!("What remains unexplained is {misfit:.1} times what the readings scatter: the intervals allow for it.")
    })
}

/// What alarms a verdict in doubt stands beside.
fn apparent(findings: &Findings<'_>, faults: &[Leak]) -> Option<String> {
    let flow = |leak: &Leak| {
        let flow =
            findings.is_known(*leak).then(|| format!(" of {} L/min", interval(&findings.leakage[*leak])));
        flow.unwrap_or_default()
    };
    match faults {
        [] => None,
        [one] => Some(format!("Until then an apparent {} leak{} stays in doubt.", one.label(), flow(one))),
        many => {
            let named: Vec<_> = many.iter().map(|leak| format!("{}{}", leak.label(), flow(leak))).collect();
            Some(format!("Until then these apparent leaks stay in doubt: {}.", named.join(", ")))
        }
    }
}

/// Episodes that ended, faults of channels before the last stretch of a stream, and sudden changes.
fn before(findings: &Findings<'_>, faults: &[Leak]) -> Vec<String> {
    // Beside sensors that are off alarms were raised and cleared for those.
    let told = findings.decision.is_none_or(|decision| decision.as_declared);
    let ended = Leak::ALL.into_iter().filter(|leak| told && !faults.contains(leak)).filter_map(|leak| {
        let own: Vec<_> = findings.episodes.iter().filter(|episode| episode.fault == leak).collect();
        let last = own.last()?;
        let often = if own.len() > 1 { format!(", the last of {} times", own.len()) } else { String::new() };
        Some(format!(
            "Earlier: {} leak of {:.2} L/min from {} to {}{often}.",
            leak.label(),
            last.mean_lpm,
            findings.trace.time(last.from_s, 1),
            findings.trace.time(last.to_s?, 1)
        ))
    });
    let changed = findings.changed_at_s.map(|at_s| {
        let at = findings.trace.time(at_s, 2);
        match findings.restarts_in_all {
            0 | 1 => format!("The leaks changed at {at}: figures are those since then."),
            restarts => {
                format!("The leaks changed {restarts} times, last at {at}: figures are those since then.")
            }
        }
    });
    let channels = findings.earlier_channels.iter().map(|fault| format!("Earlier: {}.", fault.text));
    ended.chain(channels).chain(changed).collect()
}

fn grows(findings: &Findings<'_>, leak: Leak, status: Status) -> Option<String> {
    let trend = findings.trends[leak].filter(|trend| trend.is_significant() && status != Status::Doubtful)?;
    let Estimate { value, std } = trend.slope();
    // A slope is the estimator's, by constant sensors: whether it is the leak's the posterior says.
    if findings.decision.is_some_and(|decision| !decision.is_drifting(leak)) {
        return None;
    }
    let slope = with_interval(value.abs(), Some(std));
    let verb = if value > 0.0 { "grows" } else { "falls" };
    let reaches = trend.reaches_threshold_in_s.map(|time| {
        let [low, high] = time.ci95;
        format!(
            ": if it goes on so, it is at {:.2} L/min in {} ({} to {})",
            findings.threshold_lpm[leak],
            duration(time.value),
            duration(low),
            duration(high)
        )
    });
    let oil = trend.oil.map(|oil| {
        let [with, beyond] = [oil.with_viscosity, oil.beyond_viscosity]
            .map(|part| with_interval(part.slope_lpm_per_h, Some(part.std)));
        format!(" ({with} of it follows the oil's viscosity, {beyond} does not)")
    });
    Some(format!(
        "The {} leak {verb} by {slope} L/min per hour{}{}.",
        leak.label(),
        oil.unwrap_or_default(),
        reaches.unwrap_or_default()
    ))
}

fn sentence(text: &str) -> String {
    capital(text) + "."
}

/// With a capital first letter.
pub fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// "internal, external A or external B".
pub(crate) fn join(leaks: &[Leak], word: &str) -> String {
    match leaks {
        [one] => one.label().to_owned(),
        [head @ .., last] => {
            let head: Vec<_> = head.iter().map(|leak| leak.label()).collect();
            format!("{} {word} {}", head.join(", "), last.label())
        }
        [] => String::new(),
    }
}

/// Mean flow and half width of its 95 % interval, L/min.
pub fn interval(leakage: &Leakage) -> String {
    with_interval(leakage.mean_lpm, leakage.std_lpm)
}

/// Value and half width of the 95 % interval, to two digits of the half width.
pub fn with_interval(value: f64, std: Option<f64>) -> String {
    let Some(half) = std.map(|std| Estimate { value, std }.half_width95()).filter(|half| half.is_finite())
    else {
        return format!("{value:.4}");
    };
    let decimals = if half > 0.0 { (1.0 - half.log10().floor()).clamp(0.0, 6.0) as usize } else { 6 };
    let text = format!("{value:.decimals$} ± {half:.decimals$}");
    // No minus before a zero.
    match text.strip_prefix('-') {
        Some(rest) if !rest.split(' ').next().is_some_and(|v| v.contains(|c| ('1'..='9').contains(&c))) => {
            rest.to_owned()
        }
        _ => text,
    }
}
