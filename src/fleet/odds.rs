//! Odds learnt over a fleet: how often each explanation is true, by what explains its traces.
//!
//! The shares of a mixture, by expectation and maximisation (Dempster, Laird, Rubin 1977, "Maximum likelihood from
//! incomplete data"), kind by kind. A trace's probabilities over the odds that it was judged with are its likelihoods, so
//! traces judged with other odds count alike. The table's own shares are a Dirichlet prior (Gelman et al., Bayesian Data
//! Analysis, section 3.4).

use super::FleetRow;
use crate::explain::{Entry, Kind, Prior, explanations};
use crate::report::Status;
use crate::rig::Odds;
use pitchleak_core::Leak;
use serde::Serialize;
use std::collections::HashMap;

/// The table counts as so many cylinders. A guess.
const TABLE_WORTH: f64 = 20.0;
/// What explains less than half a cylinder is left to the table: as likely as not, nobody has met it.
const LEAST_MET: f64 = 0.5;
/// Shares have settled where none moves by more; numerical.
const SETTLED: f64 = 1e-9;
const MOST_ROUNDS: usize = 1000;

/// How often explanations are true in a fleet.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FleetOdds {
    /// Cylinders that were learnt from.
    pub cylinders: usize,
    /// What was met, kind by kind; the others keep the table's proportions in what is left.
    pub shares: Vec<LearntShare>,
}

/// How often an explanation is true.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LearntShare {
    /// Its name in `[decision] odds`; one without `_a` or `_b` is both.
    pub id: String,
    /// In how many cylinders of one, the table's share included.
    pub share: f64,
    /// By the table.
    pub table: f64,
    /// In how many cylinders it was met, as far as the posterior tells.
    pub cylinders: f64,
}

impl FleetOdds {
    /// Of the traces that have a verdict by the posterior, each cylinder once.
    pub fn learn(rows: &[FleetRow]) -> Self {
        let choices = Choice::all();
        let told: Vec<Told<'_>> = rows.iter().filter_map(|row| Told::by(row, &choices)).collect();
        let mut traces: HashMap<&str, f64> = HashMap::new();
        for one in &told {
            *traces.entry(one.cylinder).or_default() += 1.0;
        }
        let mut shares: Vec<f64> = choices.iter().map(|choice| choice.table).collect();
        let mut met = vec![0.0; choices.len()];
        for _ in 0..MOST_ROUNDS {
            met.fill(0.0);
            for one in &told {
                let weight = traces.get(one.cylinder).map_or(0.0, |traces| 1.0 / traces);
                one.count(&choices, &shares, weight, &mut met);
            }
            let next = updated(&choices, &met);
            let moved = next.iter().zip(&shares).map(|(new, old)| (new - old).abs()).fold(0.0, f64::max);
            shares = next;
            if moved < SETTLED {
                break;
            }
        }
        Self { cylinders: traces.len(), shares: named(&choices, &shares, &met) }
    }

    /// The lines of a rig file that put them in the table's place; none where nothing was met.
    pub fn to_toml(&self) -> Option<String> {
        // Never rounded up: together they may be at their bound.
        let percent = |share: f64| (1e4 * share).floor().max(1.0) / 1e2;
        let line = |one: &LearntShare| format!("{} = \"{} %\"", one.id, percent(one.share));
        let odds: Vec<String> = self.shares.iter().map(line).collect();
        (!odds.is_empty()).then(|| format!("[decision]\nodds = {{ {} }}\n", odds.join(", ")))
    }
}

/// What one entry of a rig file's odds can say: of both chambers the same.
struct Choice {
    kind: Kind,
    /// None: no entry of this kind is true.
    ids: Vec<&'static str>,
    table: f64,
}

impl Choice {
    fn all() -> Vec<Self> {
        let entries = explanations();
        let mut all: Vec<Self> = Vec::new();
        for Entry { kind, id, share, .. } in &entries {
            let twin =
                |known: &&mut Self| known.kind == *kind && known.ids.iter().any(|other| are_twins(id, other));
            match all.iter_mut().find(twin) {
                Some(known) => {
                    known.ids.push(id);
                    known.table += share;
                }
                None => all.push(Self { kind: *kind, ids: vec![id], table: *share }),
            }
        }
        for kind in [Kind::Wander, Kind::Wiring] {
            let of_kind = entries.iter().filter(|entry| entry.kind == kind);
            let table = 1.0 - of_kind.map(|entry| entry.share).sum::<f64>();
            all.push(Self { kind, ids: Vec::new(), table });
        }
        all
    }

    fn has(&self, id: Option<&str>) -> bool {
        id.map_or(self.ids.is_empty(), |id| self.ids.contains(&id))
    }

    /// What one of its entries' likelihood counts over: its prior where `entries` are weighed, times how many share the
    /// choice's odds.
    fn prior(&self, id: Option<&str>, entries: &[Entry]) -> f64 {
        let of_kind = || entries.iter().filter(|entry| entry.kind == self.kind);
        match id {
            Some(id) => {
                let share = of_kind().find(|entry| entry.id == id).map_or(1.0, |entry| entry.share);
                share * self.ids.len() as f64
            }
            None => 1.0 - of_kind().map(|entry| entry.share).sum::<f64>(),
        }
    }

    /// Names in a rig file: one where both chambers have one in common.
    fn names(&self) -> Vec<&str> {
        match self.ids.as_slice() {
            [a, _] if !explanations().iter().any(|entry| entry.id == without_chamber(a)) => {
                vec![without_chamber(a)]
            }
            ids => ids.to_vec(),
        }
    }
}

fn without_chamber(id: &str) -> &str {
    id.strip_suffix("_a").or_else(|| id.strip_suffix("_b")).unwrap_or(id)
}

fn are_twins(one: &str, other: &str) -> bool {
    let has_chamber = |id: &str| without_chamber(id).len() < id.len();
    has_chamber(one) && has_chamber(other) && without_chamber(one) == without_chamber(other)
}

/// What one trace says of the choices.
struct Told<'r> {
    cylinder: &'r str,
    /// Of each choice, over the odds that it was judged with.
    likelihoods: Vec<f64>,
    /// Of each choice's kind: how much of the posterior speaks of it.
    masses: Vec<f64>,
}

impl<'r> Told<'r> {
    /// None without a posterior, or where the readings deserve none.
    fn by(row: &'r FleetRow, choices: &[Choice]) -> Option<Self> {
        let doubtful = row.status == Some(Status::Doubtful);
        if row.explanations.is_empty() || doubtful && row.reasons.first().is_none_or(|id| id != "wiring") {
            return None;
        }
        let odds = Odds::new(row.odds.iter().map(|(id, share)| (id.as_str(), *share)));
        let entries = Prior::new(&odds).of(explanations());
        let mut told = Self {
            cylinder: &row.cylinder,
            likelihoods: vec![0.0; choices.len()],
            masses: vec![0.0; choices.len()],
        };
        let listed: f64 = row.explanations.iter().map(|one| one.probability).sum();
        for explanation in &row.explanations {
            let probability = explanation.probability / listed;
            for (kind, id) in chosen(&explanation.id, &entries) {
                for (at, choice) in choices.iter().enumerate().filter(|(_, choice)| choice.kind == kind) {
                    told.masses[at] += probability;
                    if choice.has(id) {
                        told.likelihoods[at] += probability / choice.prior(id, &entries);
                    }
                }
            }
        }
        Some(told)
    }

    /// Adds how much of this trace each choice explains, were these the shares.
    fn count(&self, choices: &[Choice], shares: &[f64], weight: f64, met: &mut [f64]) {
        let joint: Vec<f64> = shares.iter().zip(&self.likelihoods).map(|(share, of)| share * of).collect();
        for (at, choice) in choices.iter().enumerate() {
            let whole = in_kind(choice.kind, choices, &joint);
            if whole > 0.0 {
                met[at] += weight * self.masses[at] * joint[at] / whole;
            }
        }
    }
}

/// The entries that an explanation consists of by its id: leaks with their courses, and what is off, joined by `+`. A leak
/// of no named course is constant, and what is not named is as usual, unless wires are wrong: beside those nothing else is
/// weighed.
fn chosen(explanation: &str, entries: &[Entry]) -> Vec<(Kind, Option<&'static str>)> {
    let known = |id: &str| entries.iter().find(|entry| entry.id == id);
    let entry = |part: &str| match part.split_once(':') {
        Some((_, course)) => known(course),
        None if Leak::ALL.iter().any(|leak| leak.id() == part) => known("constant"),
        None => known(part),
    };
    let named = explanation.split('+').filter_map(entry).map(|entry| (entry.kind, Some(entry.id)));
    let mut all: Vec<_> = named.collect();
    let usual = [
        (Kind::Wiring, None),
        (Kind::Zeros, Some("zeros_usual")),
        (Kind::Departure, Some("as_declared")),
        (Kind::Wander, None),
    ];
    for (kind, id) in usual {
        let is_wired = all.contains(&(Kind::Wiring, None));
        if !all.iter().any(|(other, _)| *other == kind) && (kind == Kind::Wiring || is_wired) {
            all.push((kind, id));
        }
    }
    all
}

/// Sum over the choices of one kind.
fn in_kind(kind: Kind, choices: &[Choice], values: &[f64]) -> f64 {
    choices.iter().zip(values).filter(|(choice, _)| choice.kind == kind).map(|(_, value)| value).sum()
}

/// The most probable shares after so many were met.
fn updated(choices: &[Choice], met: &[f64]) -> Vec<f64> {
    let share = |(choice, own): (&Choice, &f64)| {
        (TABLE_WORTH * choice.table + own) / (TABLE_WORTH + in_kind(choice.kind, choices, met))
    };
    choices.iter().zip(met).map(share).collect()
}

/// What was met, as a rig file takes it: together at most what it allows of a kind.
fn named(choices: &[Choice], shares: &[f64], met: &[f64]) -> Vec<LearntShare> {
    let is_told = |at: &usize| met[*at] >= LEAST_MET && !choices[*at].ids.is_empty();
    let told: Vec<usize> = (0..choices.len()).filter(is_told).collect();
    let mut out = Vec::new();
    for &at in &told {
        let choice = &choices[at];
        let of_kind: f64 = told
            .iter()
            .filter(|&&other| choices[other].kind == choice.kind)
            .map(|&other| shares[other])
            .sum();
        let names = choice.names();
        let part = 1.0 / names.len() as f64;
        let share = shares[at] * (Odds::MOST / of_kind).min(1.0);
        out.extend(names.iter().map(|id| LearntShare {
            id: (*id).to_owned(),
            share: part * share,
            table: part * choice.table,
            cylinders: part * met[at],
        }));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rig;
    use crate::fleet::{FleetExplanation, TraceIdentity};
    use std::collections::BTreeMap;

    /// A trace of `cylinder` that these explain.
    fn row(cylinder: usize, explanations: &[(&str, f64)]) -> FleetRow {
        let identity = TraceIdentity { cylinder: format!("T{cylinder}"), begins: None };
        let explanation = |(id, probability): &(&str, f64)| FleetExplanation {
            id: (*id).to_owned(),
            probability: *probability,
        };
        FleetRow {
            status: Some(Status::Sound),
            error: None,
            explanations: explanations.iter().map(explanation).collect(),
            ..FleetRow::failed(&identity, format!("{cylinder}.csv"), String::new())
        }
    }

    fn share(odds: &FleetOdds, id: &str) -> f64 {
        odds.shares.iter().find(|one| one.id == id).map_or(0.0, |one| one.share)
    }

    #[test]
    fn what_is_sure_is_counted_beside_the_table() {
        let mut rows: Vec<_> = (0..90).map(|cylinder| row(cylinder, &[("sound", 1.0)])).collect();
        rows.extend((90..96).map(|cylinder| row(cylinder, &[("flow_zero_a", 1.0)])));
        rows.extend((96..100).map(|cylinder| row(cylinder, &[("internal:growing+flow_zero_b+area_a", 1.0)])));
        let odds = FleetOdds::learn(&rows);
        assert_eq!(odds.cylinders, 100);
        let zeros = explanations().into_iter().filter(|entry| entry.kind == Kind::Zeros);
        let table: f64 =
            zeros.filter(|one| ["flow_zero_a", "flow_zero_b"].contains(&one.id)).map(|one| one.share).sum();
        assert!((share(&odds, "flow_zero") - (20.0 * table + 10.0) / 120.0).abs() < 1e-9, "{odds:?}");
        let growing = odds.shares.iter().find(|one| one.id == "growing").unwrap();
        assert!((growing.share - (20.0 * growing.table + 4.0) / 24.0).abs() < 1e-9);
        assert!(share(&odds, "orifice") < 1e-12, "nobody met one");
    }

    #[test]
    fn traces_that_say_nothing_leave_the_table_as_it_is() {
        let entries = explanations();
        let zeros = |entry: &&Entry| entry.kind == Kind::Zeros;
        let usual = |entry: &Entry| if entry.id == "zeros_usual" { "sound" } else { entry.id };
        let said: Vec<_> = entries.iter().filter(zeros).map(|entry| (usual(entry), entry.share)).collect();
        let rows: Vec<_> = (0..50).map(|cylinder| row(cylinder, &said)).collect();
        let odds = FleetOdds::learn(&rows);
        // What is too rare to have been met keeps its share; without it they are at their bound.
        let met: f64 = odds.shares.iter().filter(|one| one.id.contains("zero")).map(|one| one.table).sum();
        for one in odds.shares.iter().filter(|one| one.id.starts_with("flow_zero")) {
            let expected = (Odds::MOST / met).min(1.0) * one.table;
            assert!((one.share - expected).abs() < 1e-9, "{met} {one:?}");
        }
    }

    /// The same likelihoods, seen with other odds, teach the same.
    #[test]
    fn what_is_learnt_does_not_depend_on_the_odds_before() {
        let seen_with = |odds: &[(&str, f64)]| {
            let prior = Prior::new(&Odds::new(odds.iter().copied())).of(explanations());
            let share = |id: &str| prior.iter().find(|entry| entry.id == id).unwrap().share;
            let joint = [2.0 * share("zeros_usual"), 9.0 * share("flow_zero_a"), 0.5 * share("flow_zeros")];
            let sum: f64 = joint.iter().sum();
            let ids = ["sound", "flow_zero_a", "flow_zeros"];
            let said: Vec<_> = ids.into_iter().zip(joint.map(|one| one / sum)).collect();
            let odds: BTreeMap<_, _> = odds.iter().map(|(id, share)| ((*id).to_owned(), *share)).collect();
            let rows: Vec<_> = (0..80).map(|at| FleetRow { odds: odds.clone(), ..row(at, &said) }).collect();
            FleetOdds::learn(&rows)
        };
        let (plain, told) = (seen_with(&[]), seen_with(&[("flow_zero_a", 0.3), ("flow_zeros", 0.01)]));
        assert!((share(&plain, "flow_zero") - share(&told, "flow_zero")).abs() < 1e-6, "{plain:?} {told:?}");
        assert!(share(&plain, "flow_zero") > 0.3, "{plain:?}");
    }

    #[test]
    fn many_traces_of_a_cylinder_count_as_one() {
        let mut rows = vec![row(0, &[("flow_gain_a", 1.0)]); 500];
        rows.extend((1..40).map(|cylinder| row(cylinder, &[("sound", 1.0)])));
        let odds = FleetOdds::learn(&rows);
        let gains: f64 =
            odds.shares.iter().filter(|one| one.id.starts_with("flow_gain_")).map(|one| one.cylinders).sum();
        assert!((gains - 1.0).abs() < 1e-9, "{odds:?}");
    }

    #[test]
    fn a_rig_file_takes_the_lines() {
        let mut rows: Vec<_> = (0..5000).map(|cylinder| row(cylinder, &[("sound", 1.0)])).collect();
        rows.push(row(5000, &[("flow_lag_a", 1.0)]));
        rows.push(row(5001, &[("exchanged_flows", 1.0)]));
        let lines = FleetOdds::learn(&rows).to_toml().unwrap();
        let rig = Rig::parse(&(Rig::paper().to_toml() + &lines), "learnt.toml").unwrap();
        assert!(rig.decision.odds.share("as_declared").unwrap() > 0.98, "{lines}");
        assert_eq!(rig.decision.odds.share("flow_lag_a"), rig.decision.odds.share("flow_lag_b"), "{lines}");
        assert!(FleetOdds::learn(&[]).to_toml().is_none());
    }

    #[test]
    fn a_dead_channel_teaches_nothing() {
        let reasons = vec!["channel_dead".to_owned()];
        let dead = FleetRow { status: Some(Status::Doubtful), reasons, ..row(0, &[("flow_gain_a", 1.0)]) };
        assert_eq!(FleetOdds::learn(&[dead]).cylinders, 0);
    }
}
