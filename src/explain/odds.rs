//! Prior odds that a rig file gives in place of the table's: what is given is as given, the others of its kind keep their
//! proportions in what is left.

use super::table::{Entry, Kind, explanations};
use crate::rig::Odds;

/// Factors on the table's shares.
pub(crate) struct Prior<'o> {
    odds: &'o Odds,
    /// Shares of the table, each kind's of 1.
    usual: Vec<Entry>,
}

impl<'o> Prior<'o> {
    pub fn new(odds: &'o Odds) -> Self {
        Self { odds, usual: if odds.is_empty() { Vec::new() } else { explanations() } }
    }

    /// These entries, with their shares as the odds have them.
    pub fn of(&self, mut entries: Vec<Entry>) -> Vec<Entry> {
        for entry in &mut entries {
            entry.share *= self.factor(entry.kind, entry.id);
        }
        entries
    }

    /// By how much an explanation is more frequent than the table says.
    pub fn factor(&self, kind: Kind, id: &str) -> f64 {
        let of_kind = || self.usual.iter().filter(|entry| entry.kind == kind);
        let given = |entry: &Entry| self.odds.share(entry.id);
        match of_kind().find(|entry| entry.id == id).and_then(|entry| Some((given(entry)?, entry.share))) {
            Some((share, usual)) => share / usual,
            None => {
                let left = |share: &dyn Fn(&Entry, f64) -> f64| {
                    1.0 - of_kind().filter_map(|entry| Some(share(entry, given(entry)?))).sum::<f64>()
                };
                left(&|_, given| given) / left(&|entry, _| entry.share)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::mistakes::{ln_wired, mistakes};
    use super::super::table::{departures, wanders};
    use super::*;

    fn share(entries: &[Entry], id: &str) -> f64 {
        entries.iter().filter(|entry| entry.id == id).map(|entry| entry.share).sum()
    }

    #[test]
    fn rig_files_know_every_explanation_by_its_kind() {
        let of_rig: Vec<(&str, &str)> = crate::rig::explanations().collect();
        let weighed: Vec<(&str, &str)> =
            explanations().iter().map(|entry| (entry.kind.name(), entry.id)).collect();
        assert_eq!(of_rig.len(), weighed.len());
        assert!(weighed.iter().all(|one| of_rig.contains(one)), "{weighed:?}");
    }

    #[test]
    fn what_is_given_is_so_and_the_others_share_the_rest() {
        let odds = Odds::new([("flow_lag", 0.5), ("sign_qa", 0.2), ("wandering_zeros", 0.3)]);
        let prior = Prior::new(&odds);
        let (before, after) = (departures(), prior.of(departures()));
        let ratio = |entries: &[Entry]| share(entries, "area_a") / share(entries, "as_declared");
        assert!((ratio(&before) - ratio(&after)).abs() < 1e-12);
        let whole: f64 = explanations()
            .iter()
            .filter(|entry| entry.kind == Kind::Departure)
            .map(|entry| entry.share * prior.factor(entry.kind, entry.id))
            .sum();
        assert!((whole - 1.0).abs() < 1e-12, "{whole}");
        let wired = prior.of(mistakes());
        assert!((share(&wired, "sign_qa") - 0.2).abs() < 1e-12);
        assert!(ln_wired(&wired) < 0.8_f64.ln() && ln_wired(&wired) > 0.78_f64.ln());
        let steady: f64 = wanders(&prior).iter().filter(|one| one.0 <= 0.0).map(|one| one.1).sum();
        assert!((steady - 0.7).abs() < 1e-12);
    }

    #[test]
    fn without_odds_nothing_moves() {
        let odds = Odds::default();
        assert_eq!(Prior::new(&odds).of(departures()), departures());
    }
}
