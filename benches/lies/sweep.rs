//! All lies on all cylinders.

use crate::judge::{Door, Judgement, ask};
use crate::lie::{LIES, Lie};
use crate::plant::{LEAKING, Leaking, truths};
use pitchleak::wind::WindCase;
use rayon::prelude::*;

/// One row of the bench, over its seeds.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    pub door: Door,
    pub lie: &'static Lie,
    pub leaking: Leaking,
    pub accuracy: f64,
    pub wind: WindCase,
    pub right: usize,
    pub in_doubt: usize,
    pub confidently_wrong: usize,
    /// Those in doubt with the lie among the reasons.
    pub named: usize,
    /// Those with another mistake of wiring among them.
    pub misnamed: usize,
}

impl Outcome {
    pub fn runs(&self) -> usize {
        self.right + self.in_doubt + self.confidently_wrong
    }
}

/// Every lie × leak × accuracy × wind at each door, `seeds` times each; the order and the seeds don't depend on the cores.
pub fn sweep(accuracies: &[f64], winds: &[WindCase], seeds: u64) -> Vec<Outcome> {
    let cylinders: Vec<_> = winds.iter().flat_map(|wind| LEAKING.map(|leaking| (*wind, leaking))).collect();
    let of_cylinder = |(wind, leaking): &(WindCase, Leaking)| {
        let truths = truths(*wind, *leaking);
        let cases: Vec<_> = accuracies.iter().flat_map(|a| LIES.iter().map(move |lie| (*a, lie))).collect();
        let outcomes = |(accuracy, lie): &(f64, &'static Lie)| {
            let asked: Vec<_> =
                (1..=seeds).map(|seed| ask(&truths, *leaking, lie, *accuracy, seed)).collect();
            Door::ALL.map(|door| {
                let judged = || asked.iter().map(|doors| doors[door as usize]);
                let count = |which| judged().filter(|one| one.judgement == which).count();
                Outcome {
                    door,
                    lie,
                    leaking: *leaking,
                    accuracy: *accuracy,
                    wind: *wind,
                    right: count(Judgement::Right),
                    in_doubt: count(Judgement::InDoubt),
                    confidently_wrong: count(Judgement::ConfidentlyWrong),
                    named: judged().filter(|one| one.named).count(),
                    misnamed: judged().filter(|one| one.misnamed).count(),
                }
            })
        };
        cases.par_iter().flat_map_iter(outcomes).collect::<Vec<_>>()
    };
    cylinders.par_iter().map(of_cylinder).collect::<Vec<_>>().concat()
}
