//! What is known beforehand: effects that a diagnosis found and the declared model lacks (`[effects]`), and how often an explanation
//! is true before any data, where the rig file knows better than the table (`[decision] odds`).

use super::bound::{self, Bound};
use super::document::{Fault, RigError, Section};
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

/// The effects of a rig, as plant and estimators switch them on; only those that [`read_effects`] let through.
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
pub(super) fn read_effects(section: &Section<'_>) -> Result<EffectMap, RigError> {
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
            section.section(id)?.read(EffectValue::new(0.0, None), effect_keys(effect))?
        } else {
            EffectValue::new(section.required(id, effect_size(effect))?, None)
        };
        if set.set(effect, size.value, size.constants).is_err() {
            return Err(section.impossible(id, &size.value.to_string(), "at most eight effects at a time"));
        }
        effects.insert(effect, size);
    }
    Ok(effects)
}

/// Its size, how sure that is, and its constants by their names.
pub(super) fn effect_keys(effect: Effect) -> impl Fn(&mut Keys<'_>, &mut EffectValue) -> Done {
    move |keys, own| {
        keys.needed("value", effect_size(effect), &mut own.value)?;
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

pub(super) fn effect_size(effect: Effect) -> Bound {
    Bound::between(Dimension::Share, effect.spec().lower, effect.spec().upper)
}

/// Prior probabilities of explanations, each within its kind.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Odds(BTreeMap<&'static str, f64>);

impl Odds {
    /// The most that explanations of one kind may have together.
    pub const MOST: f64 = bound::ODDS.most();

    /// Of these explanations. Those that the list lacks are left out.
    pub fn new<'a>(shares: impl IntoIterator<Item = (&'a str, f64)>) -> Self {
        let known = |id: &str| explanations().find(|(_, known)| *known == id).map(|(_, id)| id);
        let within = |(id, share)| Some((known(id)?, bound::ODDS.nearest(share)));
        Self(shares.into_iter().filter_map(within).collect())
    }

    /// The share given to an explanation.
    pub fn share(&self, id: &str) -> Option<f64> {
        self.0.get(id).copied()
    }

    /// All that are given, by id.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.0.iter().map(|(id, share)| (*id, *share))
    }

    /// Whether none is given.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A name without its `_a` or `_b` is both, in equal parts.
    pub(super) fn read(section: &Section<'_>) -> Result<Self, RigError> {
        let mut own = Self::default();
        for key in section.keys() {
            let ids = named(key);
            let Some((kind, _)) = ids.first().copied() else {
                let allowed = "an id of `pitchleak explanations`".to_owned();
                return Err(section.fail(key, Fault::UnknownKey { key: section.path(key), allowed }));
            };
            let share = section.required(key, bound::ODDS)?;
            let part = share / ids.len() as f64;
            for (_, id) in ids {
                own.0.insert(id, bound::ODDS.nearest(part));
            }
            let sum = own.sum(kind);
            if sum > bound::ODDS.most() {
                let with = format!("{sum:.3} together with the others of its kind");
                return Err(section.impossible(key, &with, &bound::ODDS.text()));
            }
        }
        Ok(own)
    }

    /// Of the explanations of a kind.
    fn sum(&self, kind: &str) -> f64 {
        let is_of_kind = |id: &str| explanations().any(|known| known == (kind, id));
        self.iter().filter(|(id, _)| is_of_kind(id)).map(|(_, share)| share).sum()
    }
}

/// Kinds and ids of the explanations that a key stands for.
fn named(key: &str) -> Vec<(&'static str, &'static str)> {
    match explanations().find(|(_, id)| *id == key) {
        Some(one) => vec![one],
        None => explanations().filter(|(_, id)| matches!(id.strip_prefix(key), Some("_a" | "_b"))).collect(),
    }
}

/// What `pitchleak explanations` lists: the kind of each, which is one choice, and its id.
pub fn explanations() -> impl Iterator<Item = (&'static str, &'static str)> {
    EXPLANATIONS.into_iter().flat_map(|(kind, ids)| ids.split(' ').map(move |id| (kind, id)))
}

/// By kind, blanks between them.
const EXPLANATIONS: [(&str, &str); 5] = [
    ("course", "constant unfollowed cracking orifice growing accelerating opening sudden wandering creeping"),
    (
        "zeros",
        "zeros_usual flow_zeros flow_zero_a flow_zero_b flow_zeros_gross flow_zero_jump_a flow_zero_jump_b",
    ),
    (
        "departure",
        "as_declared flow_lag flow_lag_a flow_lag_b flow_lag_gross flow_gain_a flow_gain_b flow_gain flow_direction_a \
         flow_direction_b flow_drift_a flow_drift_b area_a area_b position_gain position_zero dead_volume_a dead_volume_b bulk_modulus \
         flow_lag_and_gains pressure_noise pressure_zero_gross_a pressure_zero_gross_b pressure_zero_a \
         pressure_zero_b pressure_gain_a pressure_gain_b",
    ),
    ("wander", "wandering_zeros"),
    (
        "wiring",
        "exchanged_flows exchanged_pressures exchanged_chambers exchanged_turned_flows sign_qa sign_qb sign_flows \
         lost_sign_qa lost_sign_qb lost_sign_flows other_end absolute_pressures absolute_pa absolute_pb \
         areas_exchanged unit_flows unit_qa unit_qb unit_pressures unit_pa unit_pb unit_x unit_t unit_area_a unit_area_b \
         scale_qa scale_qb scale_flows scale_x scale_t",
    ),
];
