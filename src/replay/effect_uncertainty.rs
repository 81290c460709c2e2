//! What the uncertainty of a rig file's `[effects]` makes of the leaks found.

use super::correction::Correction;
use super::estimator::Estimator;
use crate::rig::{EstimatorKind, Rig};
use crate::trace::Record;
use pitchleak_core::effects::EffectKind;
use pitchleak_core::{Effect, Estimate, PerLeak, RlsError};

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
