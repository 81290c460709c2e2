//! Why a verdict is doubtful or not sure, each with what to check.

use super::Findings;
use super::statement::{interval, join};
use crate::channels::ChannelFaultKind;
use crate::explain::{Decision, Explained, Mistake, WIRING_DOUBT};
use crate::signal::Signal;
use crate::units::readable;
use crate::wiring::remedy;
use pitchleak_core::{Estimate, Leak};
use serde::{Serialize, Serializer};

/// What kind of reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReasonId {
    /// A channel shows a fault by itself.
    Channel(ChannelFaultKind),
    /// A mistake of wiring, sign or unit explains what the columns as declared do not.
    Wiring,
    /// More rows are bad than good.
    MostlyBadRows,
    /// A hold asks for a bulk modulus that the rig file rules out.
    BulkModulusImpossible,
    /// A hold's leak comes out negative.
    NegativeLeak,
    /// A sensor that is off explains the trace as well as a leak does.
    OffsetOrLeak,
    /// The residuals are larger than the declared noise can make them.
    ModelDoesNotFit,
    /// The trace does not pin a leak down.
    NotIdentifiable,
    /// A leak's interval reaches beyond its threshold, and yet not for sure.
    Undecided,
    /// No rig file was given, and the trace is of another cylinder than the paper's.
    NoRigFile,
    /// Between two readings the piston moves unseen.
    SampledTooSeldom,
    /// The estimator knows no uncertainty.
    NoUncertainty,
}

impl ReasonId {
    /// As in data.
    pub fn name(self) -> &'static str {
        match self {
            Self::Channel(kind) => kind.id(),
            Self::Wiring => "wiring",
            Self::MostlyBadRows => "mostly_bad_rows",
            Self::BulkModulusImpossible => "bulk_modulus_impossible",
            Self::NegativeLeak => "negative_leak",
            Self::OffsetOrLeak => "offset_or_leak",
            Self::ModelDoesNotFit => "model_does_not_fit",
            Self::NotIdentifiable => "not_identifiable",
            Self::Undecided => "undecided",
            Self::NoRigFile => "no_rig_file",
            Self::SampledTooSeldom => "sampled_too_seldom",
            Self::NoUncertainty => "no_uncertainty",
        }
    }

    /// Whether it has to be mended before anything is said of leaks.
    pub(super) fn precedes_a_verdict(self) -> bool {
        matches!(self, Self::SampledTooSeldom | Self::NoRigFile)
    }
}

impl Serialize for ReasonId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// One reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reason {
    /// What kind.
    pub id: ReasonId,
    /// What was seen, without a full stop.
    pub text: String,
    /// What to check, or to record, without a full stop.
    pub suggestion: Option<String>,
    /// Sensors that it speaks against.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<Signal>,
}

impl Reason {
    pub(crate) fn new(id: ReasonId, text: impl Into<String>, suggestion: impl Into<String>) -> Self {
        Self { id, text: text.into(), suggestion: Some(suggestion.into()), sensors: Vec::new() }
    }

    fn against(self, sensors: &[Signal]) -> Self {
        Self { sensors: sensors.to_vec(), ..self }
    }
}

/// What contradicts the model or the sensors, the likeliest cause first.
pub(super) fn contradictions(findings: &Findings<'_>) -> Vec<Reason> {
    let channels = findings.channels.iter().map(|fault| {
        Reason::new(ReasonId::Channel(fault.kind), fault.text.clone(), fault.suggestion)
            .against(&[fault.channel])
    });
    let wiring = wiring(findings);
    let misfit = findings.decision.filter(|_| wiring.is_none()).and_then(model_does_not_fit);
    channels.chain([wiring, mostly_bad_rows(findings), misfit].into_iter().flatten()).collect()
}

/// The mistake of wiring that explains the trace, with the lines that mend it.
fn wiring(findings: &Findings<'_>) -> Option<Reason> {
    if let Some(found) = &findings.wiring {
        let reason = Reason::new(ReasonId::Wiring, found.suggestion.clone(), remedy(found.mending()));
        return Some(reason.against(&found.sensors));
    }
    // What leaves as much as that is no explanation.
    let is_likely = |decision: &&Decision| decision.wiring > WIRING_DOUBT && !decision.fits_nothing();
    let decision = findings.decision.filter(is_likely)?;
    let best = decision.explanations.iter().find(|one| one.wiring)?;
    let percent = 100.0 * decision.wiring;
    let text = format!("the trace is explained if {} ({percent:.0} %)", best.cause);
    let table = best.mistake.map_or("columns", Mistake::table);
    let mending = (!best.columns.is_empty()).then_some((table, &best.columns[..]));
    Some(Reason::new(ReasonId::Wiring, text, remedy(mending)).against(&best.sensors))
}

/// What the trace says too little of.
pub(super) fn gaps(findings: &Findings<'_>) -> Vec<Reason> {
    if !findings.knows_noise {
        let text = "the paper's law knows no uncertainty: its figures may be right or not";
        return vec![Reason::new(ReasonId::NoUncertainty, text, "replay with `--estimator rls`")];
    }
    if let Some(seldom) = sampled_too_seldom(findings) {
        return vec![seldom];
    }
    if let Some(other) = findings.decision.and_then(|decision| another_cylinder(findings, decision)) {
        return vec![other];
    }
    let Some(decision) = findings.decision else {
        let text = "this trace is too short to tell about leaks, or nothing explains it at all";
        return vec![Reason::new(ReasonId::NotIdentifiable, text, RECORD)];
    };
    // An alarm that stands is no decision.
    let (_, open) = findings.below_and_open(&decision.faults);
    let (away, open): (Vec<_>, Vec<_>) = open.into_iter().partition(|leak| findings.is_away(*leak));
    let away = (!away.is_empty()).then(|| {
        let text = format!("{} leaks come and go, and the last seconds show none", join(&away, "and"));
        Reason::new(ReasonId::Undecided, text, "record some minutes, or watch it (`pitchleak watch`)")
    });
    let is_untold = |leak: &Leak| {
        let (flow, threshold_lpm) = (&findings.leakage[*leak], findings.threshold_lpm[*leak]);
        let shows_it =
            flow.std_lpm.is_some_and(|std| Estimate { value: 0.0, std }.half_width95() < threshold_lpm);
        decision.probability[*leak] <= TELLS_NOTHING && !shows_it
    };
    let (untold, undecided): (Vec<_>, Vec<_>) = open.into_iter().partition(is_untold);
    let untold = (!untold.is_empty()).then(|| {
        let text = format!("this trace cannot tell about {} leaks", join(&untold, "and"));
        Reason::new(ReasonId::NotIdentifiable, text, RECORD)
    });
    away.into_iter()
        .chain(untold)
        .chain(undecided.into_iter().map(|leak| self::undecided(findings, decision, leak)))
        .collect()
}

/// What of an explanation is the cylinder's, or a meter's scale, by which areas show.
const OF_THE_CYLINDER: [&str; 5] = ["gain", "area", "dead_volume", "stroke", "exchanged"];

/// A trace that nobody gave a rig file for is judged on the paper's cylinder where it is one.
fn another_cylinder(findings: &Findings<'_>, decision: &Decision) -> Option<Reason> {
    let best = decision.explanations.first().filter(|_| findings.assumed.rig)?;
    OF_THE_CYLINDER.iter().any(|part| best.id.contains(part)).then(|| {
        Reason::new(
            ReasonId::NoRigFile,
            format!("no rig file was given, and this is hardly the paper's cylinder: {}", best.cause),
            "say yours: `pitchleak init TRACE` begins a rig.toml beside the trace",
        )
    })
}

/// One reading in a block of 0.25 s: with fewer the trapezoids between readings are not what has flowed, and no noise says so.
const LEAST_RATE_HZ: f64 = 4.0;

/// Readings that come once a second are a control system's log, not a recording.
fn sampled_too_seldom(findings: &Findings<'_>) -> Option<Reason> {
    let rate_hz = findings.trace.slowest_hz.filter(|rate_hz| *rate_hz < LEAST_RATE_HZ)?;
    let text = format!(
        "readings come every {} s, and between them the piston moves unseen",
        readable(1.0 / rate_hz, 2)
    );
    Some(Reason::new(
        ReasonId::SampledTooSeldom,
        text,
        "record 10 to 1000 readings a second, samples and not averages, for a minute in motion",
    ))
}

const RECORD: &str = "record longer, with the piston moving and both pressures changing";
/// A leak as probable as before any data is one that the data say nothing of, where its interval is as wide as its threshold. The table's share of a
/// leak.
const TELLS_NOTHING: f64 = 0.05;

/// A leak that may be above its threshold, and what else explains the trace.
fn undecided(findings: &Findings<'_>, decision: &Decision, leak: Leak) -> Reason {
    let threshold = findings.threshold_lpm[leak];
    let percent = 100.0 * decision.probability[leak];
    let text = format!("{} leak above {threshold:.2} L/min with {percent:.0} %", leak.label());
    let without = |one: &&Explained| one.leakage[leak] < threshold;
    match decision.explanations.iter().find(without).filter(|one| !one.cause.is_empty()) {
        Some(other) => Reason::new(
            ReasonId::OffsetOrLeak,
            format!("{text}, or {} ({:.0} %)", other.cause, 100.0 * other.probability),
            other.remedy.clone().unwrap_or_else(|| RECORD.to_owned()).trim_end_matches('.').to_owned(),
        )
        .against(&other.sensors),
        None => Reason::new(
            ReasonId::Undecided,
            format!("{text}: {} L/min", interval(&findings.leakage[leak])),
            "record longer: the interval narrows with the square root of the time",
        ),
    }
}

/// What remains may not stand for the cylinder.
fn mostly_bad_rows(findings: &Findings<'_>) -> Option<Reason> {
    let trace = &findings.trace;
    let rows = trace.samples + trace.skipped;
    (trace.skipped > trace.samples).then(|| {
        Reason::new(
            ReasonId::MostlyBadRows,
            format!("{} of {rows} rows are bad and were skipped", trace.skipped),
            if trace.is_out_of_order { SORT } else { SEE },
        )
    })
}

const SORT: &str = "they are not in the order of time: sort them by time and read the trace again";
const SEE: &str =
    "see the warnings on what is wrong with them, and `pitchleak columns` on how the file is read";

const SENSORS_TELL: &str = "check whether the sensors are as good as declared and wired as declared (`pitchleak check`); `pitchleak \
                            diagnose` looks for an effect that the model lacks";

fn model_does_not_fit(decision: &Decision) -> Option<Reason> {
    decision.fits_nothing().then(|| {
        let text = if decision.strained {
            "no explanation known fits this trace: the nearest takes sizes that no sensor and no rig is off by".to_owned()
        } else {
            format!(
                "no explanation known fits this trace: what remains is {:.1} times what the readings scatter",
                decision.misfit
            )
        };
        Reason::new(ReasonId::ModelDoesNotFit, text, SENSORS_TELL)
    })
}
