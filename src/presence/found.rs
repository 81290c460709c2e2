//! What was found of the leaks, in words and as a report.

use super::belief::{Belief, Beliefs, Place, size, weigh};
use super::{EMPTY_PA, Pressures};
use crate::hold::HoldSummary;
use crate::report::{
    EstimateEntry, Estimates, Leakage, Reason, ReasonId, ReplayReport, Status, TraceSummary, Verdict, advice,
    capital, join, why, with_interval,
};
use crate::rig::Rig;
use crate::units::{LPM_PER_M3S, readable};
use pitchleak_core::{Estimate, Leak, PerLeak};
use serde::Serialize;

/// A leak is ruled out at no less than this pressure: at none, none flows, Pa.
const LEAST_DRIVING_PA: f64 = 20e5;
/// Below this mean |P_L| zeros of the pressure sensors decide which way oil would pass the piston, Pa.
const LEAST_LOAD_PA: f64 = 2e5;
/// … or, where a leak may be as large as any, from so many standard deviations on: a half normal's mean is 1.3.
const TOLD_SIGMAS: f64 = 2.0;
/// Standard deviation of a coefficient of which the trace tells next to nothing, in those of what is believed before.
const UNKNOWN: f64 = 0.5;

/// One leak, as a mean over the usable time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FoundLeak {
    /// Probability that there is such a leak at all.
    pub probability: f64,
    /// The interval that holds its flow with 95 % where there is one, L/min.
    pub ci95_lpm: [f64; 2],
    /// The smallest flow that this trace would find, L/min.
    pub smallest_lpm: f64,
    /// Mean pressure that drives it, bar: |P_A − P_B|, P_A or P_B.
    pub pressure_bar: f64,
}

/// What the readings say of the leaks.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub beliefs: Beliefs,
    /// Means of |P_L|, P_A, P_B, Pa.
    pub pressures_pa: PerLeak<f64>,
    /// P_A − P_B, Pa.
    pub load_pressure_pa: f64,
    /// What the method itself may be off by, m³/(s·Pa): no smaller leak is found.
    pub floor_m3spa: PerLeak<f64>,
}

/// What is said of each leak.
struct Sorted {
    found: Vec<Leak>,
    excluded: Vec<Leak>,
    open: Vec<Leak>,
}

/// How one method words its verdict.
pub(crate) struct Wording<'a> {
    /// Who tells, or cannot.
    pub teller: &'a str,
    /// What goes with a leak that was found.
    pub beside: &'a dyn Fn(Leak) -> Option<String>,
    /// What the verdict rests on.
    pub basis: String,
    /// Why nothing is sure although oil leaks by some way or other, where these stay open.
    pub undecided: Option<Why<'a>>,
    /// Why these leaks stay open.
    pub open: Why<'a>,
}

/// Why leaks stay open.
type Why<'a> = &'a dyn Fn(&[Leak]) -> Reason;

/// A compressibility off by so many of the rig file's standard deviations contradicts it.
const BULK_MODULUS_SIGMAS: f64 = 3.0;

impl Belief {
    /// Whether hardly more is known of a leak than before any reading: before it may as well be none.
    fn is_untold(&self) -> bool {
        self.std >= UNKNOWN * self.prior_std && self.mean < TOLD_SIGMAS * self.std
    }
}

impl Found {
    /// By the likelihood at some places of κ.
    pub fn new(places: &[Place], pressures: &Pressures, rig: &Rig) -> Self {
        let pressures_pa = pressures.sizes_pa();
        // P_L swings about zero, and what leaks past the piston is no larger for that.
        let PerLeak { external_a: a_pa, external_b: b_pa, .. } = pressures_pa;
        let driving_pa = [0.5 * (a_pa + b_pa), a_pa, b_pa];
        let sizes = Leak::ALL.map(|leak| size(rig, leak, driving_pa[leak as usize].max(LEAST_LOAD_PA)));
        Self {
            beliefs: weigh(places, sizes, 1.0 - rig.decision.alpha),
            pressures_pa,
            load_pressure_pa: pressures.load_pa(),
            floor_m3spa: PerLeak::default(),
        }
    }

    /// The same, where κ has this spread and no smaller leaks than `floor_m3spa` are found.
    pub fn with_oil(mut self, kappa: f64, std: f64, floor_m3spa: PerLeak<f64>) -> Self {
        self.beliefs.kappa = Estimate { value: kappa, std };
        Self { floor_m3spa, ..self }
    }

    /// Each leak.
    pub fn leaks(&self) -> PerLeak<FoundLeak> {
        self.beliefs.leaks.zip(self.pressures_pa).zip(self.floor_m3spa).map(
            |((belief, pressure_pa), floor)| {
                let lpm = |coefficient: f64| coefficient * pressure_pa * LPM_PER_M3S;
                FoundLeak {
                    probability: belief.probability,
                    ci95_lpm: belief.interval.map(lpm),
                    smallest_lpm: lpm(belief.smallest.max(floor)),
                    pressure_bar: pressure_pa / 1e5,
                }
            },
        )
    }

    /// The verdict, where the readings contradict what is declared by `contradictions`.
    pub fn verdict(&self, rig: &Rig, contradictions: Vec<Reason>, wording: &Wording<'_>) -> Verdict {
        let threshold_lpm = rig.alarms.threshold_m3s.map(|flow| flow * LPM_PER_M3S);
        let Sorted { found, excluded, open } = self.sorted(&threshold_lpm, 1.0 - rig.decision.alpha);
        if !contradictions.is_empty() {
            let apparent = self.apparent(&found).unwrap_or_default();
            return told(Status::Doubtful, found, contradictions, &apparent);
        }
        let mut sentences: Vec<String> = Vec::new();
        for leak in &found {
            sentences.push(self.leak(*leak, threshold_lpm[*leak]));
            sentences.extend(self.alike(*leak));
            sentences.extend((wording.beside)(*leak));
        }
        sentences.extend(self.none_above(&excluded, &threshold_lpm));
        if !found.is_empty() && !open.is_empty() {
            sentences.push(format!("{} cannot tell about {} leaks.", wording.teller, join(&open, "and")));
        }
        sentences.push(wording.basis.clone());
        let (status, reasons) = match &wording.undecided {
            _ if !found.is_empty() => (Status::Leak, Vec::new()),
            Some(undecided) => (Status::NotSure, vec![undecided(&open)]),
            None if open.is_empty() => (Status::Sound, Vec::new()),
            None => (Status::NotSure, vec![self.empty().unwrap_or_else(|| (wording.open)(&open))]),
        };
        told(status, found, reasons, &sentences.join(" "))
    }

    /// Says so where a chamber is nearly empty on average: little drives a leak there, and what flows in fills it up, so that none is ruled
    /// out.
    fn empty(&self) -> Option<Reason> {
        let PerLeak { external_a: a_pa, external_b: b_pa, .. } = self.pressures_pa;
        (a_pa.min(b_pa) < EMPTY_PA).then(|| {
            Reason::new(
                ReasonId::NotIdentifiable,
                format!(
                    "a chamber is nearly empty: P_A is {:.1} bar on average and P_B {:.1} bar",
                    a_pa / 1e5,
                    b_pa / 1e5
                ),
                "a leak may have emptied it: look for oil outside, and record where both chambers are under 20 bar or more",
            )
        })
    }

    /// Says so where `teller` asks for another oil than the rig file's.
    pub fn other_oil(&self, rig: &Rig, teller: &str) -> Option<Reason> {
        let (declared_pa, std_pa) = (rig.fluid.bulk_modulus_pa, rig.fluid.bulk_modulus_std_pa);
        let Estimate { value: kappa, std } = self.beliefs.kappa;
        let chance = std.hypot(std_pa / declared_pa);
        let is_off = (kappa - 1.0).abs() > BULK_MODULUS_SIGMAS * chance;
        (is_off && std_pa > 0.0).then(|| {
            Reason::new(
                ReasonId::BulkModulusImpossible,
                format!(
                    "the {teller} asks for a bulk modulus of {:.2} GPa, and the rig file says {:.2} ± {:.2} GPa",
                    1e-9 * declared_pa / kappa,
                    declared_pa / 1e9,
                    std_pa / 1e9
                ),
                if kappa > 1.0 {
                    "compare [cylinder] with its drawing, dead volumes included, and look for air in the oil"
                } else {
                    "compare [cylinder] with its drawing, dead volumes included: no oil is much stiffer than its data sheet"
                },
            )
        })
    }

    /// Whether the pressures hardly differ, so that an internal leak alone stays open.
    pub fn is_flat(&self, open: &[Leak]) -> bool {
        open == [Leak::Internal] && self.pressures_pa.internal < LEAST_DRIVING_PA
    }

    /// Which leaks are there for `sure`, and which are below their thresholds.
    fn sorted(&self, threshold_lpm: &PerLeak<f64>, sure: f64) -> Sorted {
        let is_driven = |leak: Leak| leak != Leak::Internal || self.pressures_pa.internal > LEAST_LOAD_PA;
        let is_found = |leak: &Leak| {
            let belief = &self.beliefs.leaks[*leak];
            is_driven(*leak) && belief.probability >= sure && belief.interval[0] >= self.floor_m3spa[*leak]
        };
        let (found, others): (Vec<_>, Vec<_>) = Leak::ALL.into_iter().partition(is_found);
        let is_empty = self.empty().is_some();
        let is_excluded =
            |leak: &Leak| !is_empty && is_driven(*leak) && self.at_most_lpm(*leak) < threshold_lpm[*leak];
        let (excluded, open) = others.into_iter().partition(is_excluded);
        Sorted { found, excluded, open }
    }

    /// Upper end of a leak's interval, at the pressure that drives it or the least that counts, L/min.
    fn at_most_lpm(&self, leak: Leak) -> f64 {
        let driving_pa = self.pressures_pa[leak].max(LEAST_DRIVING_PA);
        self.beliefs.leaks[leak].interval[1] * driving_pa * LPM_PER_M3S
    }

    /// `0.020 ± 0.002`, in L/min.
    fn flow(&self, leak: Leak) -> String {
        let to_lpm = self.pressures_pa[leak] * LPM_PER_M3S;
        let belief = &self.beliefs.leaks[leak];
        with_interval(belief.mean * to_lpm, Some(belief.std * to_lpm))
    }

    /// A leak that was found, and what to do.
    fn leak(&self, leak: Leak, threshold_lpm: f64) -> String {
        let (flow, bar) = (self.flow(leak), self.pressures_pa[leak] / 1e5);
        let most = self.beliefs.leaks[leak].interval[1] * self.pressures_pa[leak] * LPM_PER_M3S;
        let small = if most < threshold_lpm {
            format!(" It is below the alarm threshold of {threshold_lpm:.2} L/min.")
        } else {
            String::new()
        };
        format!("{} leak of {flow} L/min at {bar:.0} bar: {}.{small}", capital(leak.label()), advice(leak))
    }

    /// The leaks that look like one that was found, and are less likely only because they are more.
    fn alike(&self, leak: Leak) -> Option<String> {
        let set = self.beliefs.leaks[leak].alike?;
        let others: Vec<Leak> = Leak::ALL.into_iter().filter(|other| set[*other]).collect();
        (!others.is_empty()).then(|| {
            let others = join(&others, "and");
            format!("Without it {others} leaks would explain the readings as well: measure again under another load.")
        })
    }

    /// What is ruled out.
    fn none_above(&self, excluded: &[Leak], threshold_lpm: &PerLeak<f64>) -> Option<String> {
        let most = excluded.iter().map(|leak| self.at_most_lpm(*leak)).fold(0.0, f64::max);
        let threshold = excluded.iter().map(|leak| threshold_lpm[*leak]).fold(0.0, f64::max);
        // Rounded up: nothing above it is left.
        let step = 10f64.powf(most.max(1e-4).log10().floor() - 1.0);
        let bound = readable(((most / step).ceil() * step).max(1e-4).min(threshold), 2);
        (!excluded.is_empty()).then(|| format!("No {} leak above {bound} L/min.", join(excluded, "or")))
    }

    /// Leaks that are in doubt.
    fn apparent(&self, leaks: &[Leak]) -> Option<String> {
        let each = |leak: &Leak| format!("{} of {} L/min", leak.label(), self.flow(*leak));
        let named: Vec<_> = leaks.iter().map(each).collect();
        (!named.is_empty())
            .then(|| format!("Until then these apparent leaks stay in doubt: {}.", named.join(", ")))
    }

    fn leakage(&self, leak: Leak) -> Leakage {
        let (belief, pressure_pa) = (&self.beliefs.leaks[leak], self.pressures_pa[leak]);
        if belief.is_untold() {
            return UNTOLD;
        }
        let flow = Estimate { value: belief.mean * pressure_pa, std: belief.std * pressure_pa };
        let size = Leakage::new(flow);
        let against = leak == Leak::Internal && self.load_pressure_pa < 0.0;
        let net_lpm = if against { -size.mean_lpm } else { size.mean_lpm };
        Leakage { net_mean_lpm: Some(net_lpm), ..size }
    }
}

/// What is not told is no number that anyone should act on.
const UNTOLD: Leakage = Leakage { mean_lpm: 0.0, net_mean_lpm: None, std_lpm: None, since: None };

/// The report on a trace that was judged without flow meters; without `found`, it was too short.
pub(crate) fn report(
    trace: TraceSummary,
    rig: &Rig,
    found: Option<&Found>,
    verdict: Verdict,
    hold: Option<HoldSummary>,
) -> ReplayReport {
    ReplayReport {
        wiring: None,
        schema: ReplayReport::SCHEMA,
        rig: rig.name.clone(),
        estimator: rig.estimator.kind,
        estimates: estimates(rig, found),
        leakage: PerLeak::from_fn(|leak| found.map_or(UNTOLD, |found| found.leakage(leak))),
        flow_meter_offsets: None,
        normalised_innovation: None,
        hold,
        valve: None,
        verdict,
        trend: PerLeak::default(),
        episodes: Vec::new(),
        spells: Vec::new(),
        changed_at_s: None,
        alarms: Vec::new(),
        score: None,
        trace,
    }
}

fn estimates(rig: &Rig, found: Option<&Found>) -> Estimates {
    let untold = |value, unit| {
        EstimateEntry::without_spread(value, unit).not_identifiable("this trace does not tell it")
    };
    let leaks = PerLeak::from_fn(|leak| match found {
        Some(found) => coefficient(&found.beliefs.leaks[leak]),
        None => untold(0.0, EstimateEntry::COEFFICIENT_UNIT),
    });
    let oil = match found {
        Some(found) => bulk_modulus(&found.beliefs.kappa, rig),
        None => untold(rig.fluid.bulk_modulus_pa, EstimateEntry::BULK_MODULUS_UNIT),
    };
    Estimates {
        internal_leak_coefficient: leaks.internal,
        external_leak_a_coefficient: leaks.external_a,
        external_leak_b_coefficient: leaks.external_b,
        bulk_modulus: oil,
    }
}

fn coefficient(belief: &Belief) -> EstimateEntry {
    let estimate = Estimate { value: belief.mean, std: belief.std };
    let entry = EstimateEntry {
        ci95: Some(belief.interval),
        ..EstimateEntry::new(estimate, EstimateEntry::COEFFICIENT_UNIT)
    };
    if belief.is_untold() { entry.not_identifiable("this trace says little about it") } else { entry }
}

/// β = 1/κ; the trace tells it where it halves what the rig file leaves open.
fn bulk_modulus(kappa: &Estimate<f64>, rig: &Rig) -> EstimateEntry {
    let Estimate { value, std } = *kappa;
    let declared_pa = rig.fluid.bulk_modulus_pa;
    let [low, high] = kappa.ci95();
    let stiffest = if low > 0.0 { declared_pa / low } else { f64::INFINITY };
    let estimate = Estimate { value: declared_pa / value, std: declared_pa * std / (value * value) };
    let entry = EstimateEntry {
        ci95: Some([declared_pa / high, stiffest]),
        ..EstimateEntry::new(estimate, EstimateEntry::BULK_MODULUS_UNIT)
    };
    if low <= 0.0 {
        return entry.not_identifiable("the pressures hardly change by more than their noise");
    }
    if std < UNKNOWN * rig.fluid.bulk_modulus_std_pa / declared_pa {
        return entry;
    }
    entry.not_identifiable("this trace says little beyond the rig file")
}

/// First why it is in doubt, if it is, then what was found.
pub(crate) fn told(status: Status, faults: Vec<Leak>, reasons: Vec<Reason>, found: &str) -> Verdict {
    let why = reasons.iter().take(1).flat_map(why);
    let text: Vec<String> = why.chain((!found.is_empty()).then(|| found.to_owned())).collect();
    Verdict { status, faults, text: text.join(" "), reasons, probability: None, explanations: Vec::new() }
}
