//! `[decision] odds`: how often an explanation is true before any data, where the rig file knows better than the table.

use super::bound;
use super::document::{Fault, RigError, Section};
use std::collections::BTreeMap;

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
    ("course", "constant cracking orifice growing accelerating opening sudden wandering creeping"),
    (
        "zeros",
        "zeros_usual flow_zeros flow_zero_a flow_zero_b flow_zeros_gross flow_zero_jump_a flow_zero_jump_b",
    ),
    (
        "departure",
        "as_declared flow_lag flow_lag_a flow_lag_b flow_lag_gross flow_gain_a flow_gain_b flow_gain flow_drift_a \
         flow_drift_b area_a area_b position_gain position_zero dead_volume_a dead_volume_b bulk_modulus \
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
