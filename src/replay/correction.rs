//! A rig file's `[effects]`, taken out of the readings before they are estimated, and what their uncertainty makes of the
//! leaks found.

use super::estimator::Estimator;
use crate::rig::{EstimatorKind, Rig};
use crate::trace::Record;
use pitchleak_core::effects::{EffectKind, Play};
use pitchleak_core::{
    Effect, EffectSet, Estimate, FadingMemoryFilter, Model, PerLeak, RlsError, Sample, Signals,
};

/// Memory of the derivatives that effects such as dead volume or drag ask for, s.
const MEMORY_S: f64 = 0.05;
/// No pressure is read finer than this, Pa.
const FINEST_PA: f64 = 1.0;
/// Below this share of its dead band a reading is noise: half way between silence and the band's edge.
const UNREAD_SHARE: f64 = 0.5;
/// Where a trace has no temperature, K.
const USUAL_TEMPERATURE_K: f64 = 313.15;

/// Makes of each record what a rig without the effects would have shown.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Correction {
    effects: EffectSet<f64>,
    model: Model<f64>,
    rates: Rates,
    #[serde(default)]
    sides: Sides,
    /// The effects' own leak flows, m³/s; their sizes summed over time, m³.
    #[serde(default)]
    leaks_m3s: PerLeak<f64>,
    leaked_m3: PerLeak<f64>,
    time_s: f64,
}

/// Derivatives of the signals.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct Rates {
    x: FadingMemoryFilter<f64>,
    pa: FadingMemoryFilter<f64>,
    pb: FadingMemoryFilter<f64>,
    qa: FadingMemoryFilter<f64>,
    qb: FadingMemoryFilter<f64>,
}

/// Which way the pressures went last.
#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
struct Sides {
    /// A pressure has turned once it has come back by twice this, Pa.
    turned_pa: f64,
    pa: Option<Play<f64>>,
    pb: Option<Play<f64>>,
}

impl Sides {
    fn of(smooth_pa: f64, play: &mut Option<Play<f64>>, turned_pa: f64) -> f64 {
        play.get_or_insert(Play::new(smooth_pa)).side(turned_pa, smooth_pa)
    }
}

impl Correction {
    /// The correction for a rig; `None` where its file has no effects.
    pub fn of(rig: &Rig) -> Option<Self> {
        if rig.effects.is_empty() {
            return None;
        }
        let model = Model { cylinder: rig.cylinder, fluid: rig.fluid, leaks_m3spa: PerLeak::default() };
        let filter = FadingMemoryFilter::new(MEMORY_S);
        let rates = Rates { x: filter, pa: filter, pb: filter, qa: filter, qb: filter };
        let sides = Sides { turned_pa: rig.sensors().pressure.noise_std.max(FINEST_PA), ..Sides::default() };
        Some(Self {
            effects: rig.effect_set(),
            model,
            rates,
            sides,
            leaks_m3s: PerLeak::default(),
            leaked_m3: PerLeak::default(),
            time_s: 0.0,
        })
    }

    /// Sensor effects are undone on the readings; what physical effects take is subtracted from the flows. A flow within its meter's dead
    /// band is not known: its chamber rests.
    pub fn correct(&mut self, record: &Record) -> Record {
        let reading = self.signals(record);
        let truth = self.effects.correct(&reading);
        let unread = self.unread(&reading);
        let any = self.effects.terms(&truth, &self.model, |kind| kind != EffectKind::Force);
        let of = |kind: EffectKind| self.effects.terms(&truth, &self.model, |k| k == kind);
        let sample = Sample {
            x_m: truth.x_m,
            pa_pa: truth.pa_pa,
            pb_pa: truth.pb_pa,
            qa_m3s: record.sample.qa_m3s.filter(|_| !unread.qa_m3s).map(|_| truth.qa_m3s - any.chamber_a_m3s),
            qb_m3s: record.sample.qb_m3s.filter(|_| !unread.qb_m3s).map(|_| truth.qb_m3s - any.chamber_b_m3s),
            force_n: record.sample.force_n.map(|_| truth.force_n),
        };
        let leaks = PerLeak {
            internal: of(EffectKind::InternalLeak).chamber_a_m3s,
            external_a: of(EffectKind::ExternalLeakA).chamber_a_m3s,
            external_b: of(EffectKind::ExternalLeakB).chamber_b_m3s,
        };
        let step_s = record.step_s();
        self.time_s += step_s;
        self.leaks_m3s = leaks;
        self.leaked_m3 = self.leaked_m3.zip(leaks).map(|(sum, flow)| sum + flow.abs() * step_s);
        Record { sample, ..*record }
    }

    /// Leak flows of the effects themselves at the last record, m³/s.
    pub fn leaks_m3s(&self) -> PerLeak<f64> {
        self.leaks_m3s
    }

    /// Mean leak flows of the effects themselves, m³/s: what a leak of another law carries beside the laminar one.
    pub fn mean_leaks_m3s(&self) -> PerLeak<f64> {
        self.leaked_m3.map(|sum| if self.time_s > 0.0 { sum / self.time_s } else { 0.0 })
    }

    /// Which readings show nothing because of a dead band.
    fn unread(&self, reading: &Signals<f64>) -> Signals<bool> {
        let mut unread = Signals::default();
        for active in self.effects.iter() {
            let mut shown = *reading;
            let is_silent = |flow: &mut f64| flow.abs() < UNREAD_SHARE * active.value;
            if active.effect.deaf(&mut shown).is_some_and(is_silent)
                && let Some(own) = active.effect.deaf(&mut unread)
            {
                *own = true;
            }
        }
        unread
    }

    fn signals(&mut self, record: &Record) -> Signals<f64> {
        let dt_s = record.step_s();
        let sample = &record.sample;
        let (qa, qb) = (sample.qa_m3s.unwrap_or(0.0), sample.qb_m3s.unwrap_or(0.0));
        let x = *self.rates.x.update(dt_s, sample.x_m);
        let pa = *self.rates.pa.update(dt_s, sample.pa_pa);
        let pb = *self.rates.pb.update(dt_s, sample.pb_pa);
        Signals {
            x_m: sample.x_m,
            v_mps: record.speed_mps.unwrap_or(x.slope()),
            a_mps2: x.curvature(),
            pa_pa: sample.pa_pa,
            pb_pa: sample.pb_pa,
            dpa_pas: pa.slope(),
            dpb_pas: pb.slope(),
            d2pa_pas2: pa.curvature(),
            d2pb_pas2: pb.curvature(),
            pa_side: Sides::of(pa.value(), &mut self.sides.pa, self.sides.turned_pa),
            pb_side: Sides::of(pb.value(), &mut self.sides.pb, self.sides.turned_pa),
            qa_m3s: qa,
            qb_m3s: qb,
            dqa_m3s2: self.rates.qa.update(dt_s, qa).slope(),
            dqb_m3s2: self.rates.qb.update(dt_s, qb).slope(),
            force_n: sample.force_n.unwrap_or(0.0),
            temp_k: record.temperature_k.unwrap_or(USUAL_TEMPERATURE_K),
            t_s: self.time_s,
            // Where in its play the position sensor lies is not seen here.
            ..Signals::default()
        }
    }
}

/// One more estimator for each uncertain effect, which takes it to be a standard deviation larger: the leaks
/// it finds are off by what that uncertainty costs, to first order. The file gives no correlations, so the
/// effects count as independent.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct EffectUncertainty {
    shifted: Vec<(Correction, Estimator)>,
}

impl EffectUncertainty {
    /// None for the paper's law, which knows no uncertainty.
    ///
    /// # Errors
    /// As [`Estimator::new`].
    pub fn of(rig: &Rig) -> Result<Self, RlsError> {
        if rig.estimator.kind == EstimatorKind::Paper {
            return Ok(Self { shifted: Vec::new() });
        }
        let uncertain = rig.effects.iter().filter_map(|(effect, size)| Some((*effect, size.std?)));
        let shifted = uncertain.filter_map(|(effect, std)| shifted(rig, effect, std));
        let with_estimator = |rig: Rig| {
            let correction = Correction::of(&rig)?;
            Some(Estimator::new(&rig).map(|estimator| (correction, estimator)))
        };
        Ok(Self { shifted: shifted.filter_map(with_estimator).collect::<Result<_, _>>()? })
    }

    /// How many effects are uncertain.
    pub fn count(&self) -> usize {
        self.shifted.len()
    }

    /// Takes in a record as read.
    #[inline]
    pub fn push(&mut self, record: &Record) {
        for (correction, estimator) in &mut self.shifted {
            estimator.update(&correction.correct(record));
        }
    }

    /// `found`, with spreads that hold the effects' uncertainty; `of` is how it follows from an estimator.
    pub fn widen(
        &self,
        found: PerLeak<Estimate<f64>>,
        of: impl Fn(&Correction, &Estimator) -> PerLeak<Estimate<f64>>,
    ) -> PerLeak<Estimate<f64>> {
        self.shifted.iter().fold(found, |found, (correction, estimator)| {
            found
                .zip(of(correction, estimator))
                .map(|(found, off)| Estimate { std: found.std.hypot(off.value - found.value), ..found })
        })
    }
}

/// What the effects' uncertainty adds to the spread of a `certain` figure, as a standard deviation.
pub(super) fn added_std(wide: Estimate<f64>, certain: Estimate<f64>) -> f64 {
    (wide.std * wide.std - certain.std * certain.std).max(0.0).sqrt()
}

/// The rig with one effect a standard deviation larger, or smaller where that is out of bounds.
fn shifted(rig: &Rig, effect: Effect, std: f64) -> Option<Rig> {
    let spec = effect.spec();
    if std <= 0.0 || spec.kind == EffectKind::Force {
        return None;
    }
    let mut rig = rig.clone();
    let size = rig.effects.get_mut(&effect)?;
    let within = |value: &f64| (spec.lower..=spec.upper).contains(value);
    size.value = [size.value + std, size.value - std].into_iter().find(within)?;
    Some(rig)
}
