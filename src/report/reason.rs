//! Why a verdict is doubtful or not sure, each with what to check.

use super::statement::{interval, join};
use super::zeros::zeros;
use super::{Findings, Misfit};
use crate::channels::ChannelFaultKind;
use crate::wiring::{HOW_WIRED, Wiring};
use pitchleak_core::Leak;
use serde::{Serialize, Serializer};

/// What kind of reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReasonId {
    /// A channel shows a fault by itself.
    Channel(ChannelFaultKind),
    /// A mistake of wiring, sign or unit explains what the columns as declared do not.
    Wiring,
    /// A sensor whose gain or zero is off explains what the declared sensors do not.
    SensorError,
    /// More rows are bad than good.
    MostlyBadRows,
    /// The trace asks for a bulk modulus that no oil has, or not this one.
    BulkModulusImpossible,
    /// A leak comes out negative.
    NegativeLeak,
    /// A meter whose zero is off explains the trace as well as a leak does.
    OffsetOrLeak,
    /// The estimates began anew again and again.
    KeepsChanging,
    /// The residuals are larger than the declared noise can make them.
    ModelDoesNotFit,
    /// Several leaks at once explain the trace only nearly.
    SeveralLeaks,
    /// The trace does not pin a leak down.
    NotIdentifiable,
    /// A leak's interval reaches beyond its threshold, and yet not for sure.
    Undecided,
    /// The estimator knows no uncertainty.
    NoUncertainty,
}

impl ReasonId {
    /// As in data.
    pub fn name(self) -> &'static str {
        match self {
            Self::Channel(kind) => kind.id(),
            Self::Wiring => "wiring",
            Self::SensorError => "sensor_error",
            Self::MostlyBadRows => "mostly_bad_rows",
            Self::BulkModulusImpossible => "bulk_modulus_impossible",
            Self::NegativeLeak => "negative_leak",
            Self::OffsetOrLeak => "offset_or_leak",
            Self::KeepsChanging => "keeps_changing",
            Self::ModelDoesNotFit => "model_does_not_fit",
            Self::SeveralLeaks => "several_leaks",
            Self::NotIdentifiable => "not_identifiable",
            Self::Undecided => "undecided",
            Self::NoUncertainty => "no_uncertainty",
        }
    }

    /// Whether a leak of another law than C P can be behind it.
    pub fn may_be_orifice(self) -> bool {
        matches!(self, Self::NegativeLeak | Self::KeepsChanging | Self::ModelDoesNotFit)
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
}

impl Reason {
    pub(crate) fn new(id: ReasonId, text: impl Into<String>, suggestion: impl Into<String>) -> Self {
        Self { id, text: text.into(), suggestion: Some(suggestion.into()) }
    }
}

/// Mean of ν²/S over the trace that still is no misfit, or what chance makes of few innovations …
pub const MISFIT: f64 = 2.5;
const CHANCE_SIGMAS: f64 = 5.0;
/// … and in the worst quarter of a minute: leaks that open and are mended surprise a few blocks.
const WORST_MISFIT: f64 = 3.0;
/// The position's worst mean: friction and edges of the motion leave more than in the balance.
const POSITION_MISFIT: f64 = 2.0;
/// Restarts without an alarm that was raised or cleared: a leak below its threshold may jump now and then.
const RESTARTS: u64 = 2;
/// A bulk modulus off by so many of its prior's standard deviations, in the compressibility: the prior is in the estimate
/// already, so the trace itself asks for more.
const BULK_MODULUS_SIGMAS: f64 = 3.0;
/// A negative leak matters from this share of its threshold on, and of the largest leak found: a leak of another law than
/// C P leaves a little in the others.
const NEGATIVE_SHARE: f64 = 0.5;
const NEGATIVE_SHARE_OF_LARGEST: f64 = 0.13;

/// What contradicts the model or the sensors, the likeliest cause first.
pub(super) fn contradictions(findings: &Findings<'_>) -> Vec<Reason> {
    let channels = findings
        .channels
        .iter()
        .map(|fault| Reason::new(ReasonId::Channel(fault.kind), fault.text.clone(), fault.suggestion));
    let others = [
        named(ReasonId::Wiring, findings.suspicions.wiring.as_ref(), HOW_WIRED),
        named(ReasonId::SensorError, findings.suspicions.sensor.as_ref(), "the sensor against another one"),
        mostly_bad_rows(findings),
        bulk_modulus_impossible(findings),
        negative_leak(findings),
        zeros(findings),
        keeps_changing(findings),
        model_does_not_fit(findings),
        several_leaks(findings),
    ];
    let open = |reason: &Reason| findings.suspicions.orifice.is_none() || !reason.id.may_be_orifice();
    channels.chain(others.into_iter().flatten()).filter(open).collect()
}

/// What the trace says too little of.
pub(super) fn gaps(findings: &Findings<'_>) -> Vec<Reason> {
    if findings.misfit.is_none() {
        let text = "the paper's law knows no uncertainty: its figures may be right or not";
        return vec![Reason::new(ReasonId::NoUncertainty, text, "replay with `--estimator rls`")];
    }
    let (unknown, known): (Vec<_>, Vec<_>) =
        Leak::ALL.into_iter().partition(|leak| !findings.is_known(*leak));
    let open: Vec<_> =
        known.into_iter().filter(|leak| !findings.is_below(*leak) && !findings.active[*leak]).collect();
    let unknown = (!unknown.is_empty()).then(|| {
        Reason::new(
            ReasonId::NotIdentifiable,
            format!("this trace cannot tell about {} leaks", join(&unknown, "and")),
            "record longer, with the piston moving and both pressures changing",
        )
    });
    unknown.into_iter().chain(open.into_iter().map(|leak| undecided(findings, leak))).collect()
}

fn undecided(findings: &Findings<'_>, leak: Leak) -> Reason {
    let (flow, threshold) = (interval(&findings.leakage[leak]), findings.threshold_lpm[leak]);
    Reason::new(
        ReasonId::Undecided,
        format!("{} leak of {flow} L/min: may be above {threshold:.2} L/min or not", leak.label()),
        "record longer: the interval narrows with the square root of the time",
    )
}

/// What explains the trace, with the lines that mend it.
fn named(id: ReasonId, found: Option<&Wiring>, check: &str) -> Option<Reason> {
    let found = found?;
    Some(Reason::new(id, found.suggestion.clone(), found.remedy(check)))
}

/// What remains may not stand for the cylinder.
fn mostly_bad_rows(findings: &Findings<'_>) -> Option<Reason> {
    let trace = findings.trace;
    let rows = trace.samples + trace.skipped;
    (trace.skipped > trace.samples).then(|| {
        Reason::new(
            ReasonId::MostlyBadRows,
            format!("{} of {rows} rows are bad and were skipped", trace.skipped),
            "see the warnings on what is wrong with them, and `pitchleak columns` on how the file is read",
        )
    })
}

fn bulk_modulus_impossible(findings: &Findings<'_>) -> Option<Reason> {
    let found = &findings.estimates.bulk_modulus;
    let declared = &findings.fluid;
    let relative_prior = declared.bulk_modulus_std_pa / declared.bulk_modulus_pa;
    // In the compressibility, which is what the equations are linear in.
    let off = (declared.bulk_modulus_pa / found.value - 1.0).abs();
    (found.std.is_some() && off > BULK_MODULUS_SIGMAS * relative_prior).then(|| {
        Reason::new(
            ReasonId::BulkModulusImpossible,
            format!(
                "the trace asks for a bulk modulus of {:.2} GPa where the rig file says {:.2} ± {:.2} GPa",
                found.value / 1e9,
                declared.bulk_modulus_pa / 1e9,
                declared.bulk_modulus_std_pa / 1e9
            ),
            "check the units and wires of pressures and position, then dead volumes, hoses and air in the oil",
        )
    })
}

/// Oil does not flow in from outside: something else than the leak is at work, and as strong. What is far below the
/// threshold harms no verdict.
fn negative_leak(findings: &Findings<'_>) -> Option<Reason> {
    let largest = findings.leakage.iter().map(|(_, leakage)| leakage.mean_lpm).fold(0.0, f64::max);
    let is_negative = |leak: &Leak| {
        let leakage = &findings.leakage[*leak];
        let matters =
            (NEGATIVE_SHARE * findings.threshold_lpm[*leak]).max(NEGATIVE_SHARE_OF_LARGEST * largest);
        leakage.mean_lpm < -matters && leakage.is_negative()
    };
    let negative: Vec<_> = Leak::ALL.into_iter().filter(is_negative).collect();
    let first = *negative.first()?;
    let flow = interval(&findings.leakage[first]);
    Some(Reason::new(
        ReasonId::NegativeLeak,
        format!("the {} leak comes out negative ({flow} L/min), which cannot be", first.label()),
        "check the zeros of the flow meters, or declare how far they may be off (`bias`); `pitchleak diagnose` looks for \
         an effect that the rig file lacks",
    ))
}

fn keeps_changing(findings: &Findings<'_>) -> Option<Reason> {
    let Misfit { restarts, since_s, .. } = findings.misfit?;
    let begun = findings.episodes.iter().filter(|episode| episode.from_s >= since_s).count();
    let ended: Vec<_> =
        findings.episodes.iter().filter(|episode| episode.to_s.is_some_and(|to_s| to_s >= since_s)).collect();
    let explained = (begun + ended.len()) as u64;
    let more_often = restarts > RESTARTS + explained;
    // One leak may come and go; two that do so by turns are no leaks.
    let by_turns = ended.iter().any(|episode| episode.fault != ended[0].fault);
    let what =
        if more_often { "more often than a leak came or went" } else { "and leaks came and went by turns" };
    (more_often || restarts > RESTARTS && by_turns).then(|| {
        Reason::new(
            ReasonId::KeepsChanging,
            format!("the estimates began anew {restarts} times, {what}"),
            "check for loose contacts, sensors that hang, and changes of the rig during the recording",
        )
    })
}

const SENSORS_TELL: &str = "check whether the sensors are as good as declared and wired as declared (`pitchleak check`); `pitchleak \
                            diagnose` looks for an effect that the model lacks";

impl Misfit {
    /// What chance makes of the balance's at the most.
    fn chance(&self) -> f64 {
        1.0 + CHANCE_SIGMAS * (2.0 / self.balances.max(1) as f64).sqrt()
    }

    /// Whether model and declared noise do not explain it.
    pub fn contradicts(&self) -> bool {
        let balance = self.balance > self.chance().max(MISFIT) || self.worst_window > WORST_MISFIT;
        balance || self.worst_position > POSITION_MISFIT
    }
}

/// Several leaks at once are rarer than a wrong sensor: they have to explain the trace to the noise.
fn several_leaks(findings: &Findings<'_>) -> Option<Reason> {
    let (misfit, faults) = (findings.misfit?, findings.faults());
    let beyond = misfit.balance > misfit.chance() && misfit.balance <= MISFIT;
    (faults.len() > 1 && beyond).then(|| {
        Reason::new(
            ReasonId::SeveralLeaks,
            format!(
                "{} leaks at once leave residuals {:.1} times the noise of [sensors], more than chance",
                join(&faults, "and"),
                misfit.balance.sqrt()
            ),
            SENSORS_TELL,
        )
    })
}

fn model_does_not_fit(findings: &Findings<'_>) -> Option<Reason> {
    let misfit = findings.misfit?;
    misfit.contradicts().then(|| {
        let times = misfit.worst_window.max(misfit.balance).max(misfit.worst_position).sqrt();
        let at_least = if times > 3.5 { "at least " } else { "" };
        Reason::new(
            ReasonId::ModelDoesNotFit,
            format!(
                "model and declared noise do not explain this trace: its residuals are {at_least}{times:.1} times the \
                 noise of [sensors]"
            ),
            SENSORS_TELL,
        )
    })
}
