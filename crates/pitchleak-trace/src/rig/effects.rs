//! `[effects]`: what a diagnosis found and the declared model lacks.

use super::bound::{self, Bound};
use super::document::{RigError, Section};
use super::keys::{Done, Keys};
use crate::units::Dimension;
use pitchleak_core::effects::EffectConstants;
use pitchleak_core::{Effect, EffectSet};
use std::collections::BTreeMap;

/// The size of an effect, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectValue {
    /// Its parameter, in the unit of its [`EffectSpec`](pitchleak_core::effects::EffectSpec).
    pub value: f64,
    /// Standard deviation of the parameter, where known.
    pub std: Option<f64>,
    /// The constants it is not linear in.
    pub constants: EffectConstants<f64>,
}

impl EffectValue {
    /// An effect of this size with the usual constants.
    pub fn new(value: f64, std: Option<f64>) -> Self {
        Self { value, std, constants: EffectConstants::default() }
    }
}

/// `[effects]`.
pub type EffectMap = BTreeMap<Effect, EffectValue>;

/// The effects of a rig, as plant and estimators switch them on; only those that [`read`] let through.
pub(super) fn effect_set(effects: &EffectMap) -> EffectSet<f64> {
    let mut set = EffectSet::default();
    for (effect, size) in effects {
        // A map built by hand may hold more or larger effects than exist; those stay off.
        let _ = set.set(*effect, size.value, size.constants);
    }
    set
}

/// Reads `id = value`, or `id = { value, std, … }` with constants of the effect's constants by their names; bare
/// numbers are SI.
pub(super) fn read(section: &Section<'_>) -> Result<EffectMap, RigError> {
    let ids: Vec<&str> = Effect::ALL.iter().map(|effect| effect.spec().id).collect();
    section.allow(&ids)?;
    let mut effects = EffectMap::new();
    let mut set = EffectSet::default();
    for effect in Effect::ALL.iter().copied() {
        let id = effect.spec().id;
        if !section.has(id) {
            continue;
        }
        let size = if section.is_table(id) {
            section.section(id)?.read(EffectValue::new(0.0, None), keys(effect))?
        } else {
            EffectValue::new(section.required(id, size(effect))?, None)
        };
        if set.set(effect, size.value, size.constants).is_err() {
            return Err(section.impossible(id, &size.value.to_string(), "at most eight effects at a time"));
        }
        effects.insert(effect, size);
    }
    Ok(effects)
}

/// Its size, how sure that is, and its constants by their names.
pub(super) fn keys(effect: Effect) -> impl Fn(&mut Keys<'_>, &mut EffectValue) -> Done {
    move |keys, own| {
        keys.needed("value", size(effect), &mut own.value)?;
        keys.optional("std", bound::EFFECT_STD, &mut own.std)?;
        effect.constants().iter().try_for_each(|constant| {
            let (spec, usual) = (constant.spec(), EffectConstants::default().get(*constant));
            let within = Bound::between(Dimension::Share, spec.lower, spec.upper);
            let mut value = own.constants.get(*constant);
            keys.number(spec.id, within, &mut value, usual)?;
            own.constants = own.constants.with(*constant, value);
            Ok(())
        })
    }
}

pub(super) fn size(effect: Effect) -> Bound {
    Bound::between(Dimension::Share, effect.spec().lower, effect.spec().upper)
}
