//! Notices, not more than one of each kind and minute.

use super::event::NoticeEvent;
use std::collections::BTreeMap;

/// Time of the samples between two notices of a kind, s.
const EVERY_S: f64 = 60.0;

/// What was wrong since the last notice of each kind.
#[derive(Clone, Default)]
pub(super) struct Notices(BTreeMap<String, Kind>);

#[derive(Clone)]
struct Kind {
    told_s: Option<f64>,
    count: u64,
    /// Also those that were told.
    total: u64,
    text: String,
}

impl Notices {
    /// Counts a line that was left out; says so at once where nothing was said for a minute. `seen_s` is the time of the last
    /// line, `t_s` of the last good one.
    pub(super) fn add(
        &mut self,
        cylinder: &str,
        [seen_s, t_s]: [Option<f64>; 2],
        kind: &str,
        text: String,
    ) -> Option<NoticeEvent> {
        let Some(entry) = self.0.get_mut(kind) else {
            self.0.insert(kind.to_owned(), Kind { told_s: seen_s, count: 0, total: 1, text: String::new() });
            return Some(NoticeEvent {
                cylinder: cylinder.to_owned(),
                t_s,
                kind: kind.to_owned(),
                count: 1,
                text,
            });
        };
        if entry.count == 0 {
            entry.text = text;
        }
        entry.count += 1;
        entry.total += 1;
        entry.due(seen_s).then(|| entry.tell(cylinder, [seen_s, t_s], kind))
    }

    /// How many of each kind there were, told or not.
    pub(super) fn totals(&self) -> impl Iterator<Item = (&str, u64)> {
        self.0.iter().map(|(kind, entry)| (kind.as_str(), entry.total))
    }

    /// What was counted and not said.
    pub(super) fn rest(&mut self, cylinder: &str, times_s: [Option<f64>; 2]) -> Vec<NoticeEvent> {
        let counted = self.0.iter_mut().filter(|(_, entry)| entry.count > 0);
        counted.map(|(kind, entry)| entry.tell(cylinder, times_s, kind)).collect()
    }
}

impl Kind {
    /// Also where the clock was set back.
    fn due(&self, t_s: Option<f64>) -> bool {
        match (self.told_s, t_s) {
            (Some(told_s), Some(t_s)) => t_s < told_s || t_s - told_s >= EVERY_S,
            (None, Some(_)) => true,
            (_, None) => false,
        }
    }

    fn tell(&mut self, cylinder: &str, [seen_s, t_s]: [Option<f64>; 2], kind: &str) -> NoticeEvent {
        self.told_s = seen_s;
        let (count, text) = (std::mem::take(&mut self.count), std::mem::take(&mut self.text));
        NoticeEvent { cylinder: cylinder.to_owned(), t_s, kind: kind.to_owned(), count, text }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_one_notice_a_minute() {
        let mut notices = Notices::default();
        let told: Vec<_> = (0..13_000)
            .filter_map(|k| notices.add("a", [Some(f64::from(k) * 0.01); 2], "missing", format!("line {k}")))
            .collect();
        assert_eq!(told.iter().map(|notice| notice.count).collect::<Vec<_>>(), [1, 6000, 6000]);
        assert_eq!(told[1].text, "line 1");
        assert_eq!(notices.rest("a", [Some(130.0); 2]).first().map(|notice| notice.count), Some(999));
        assert!(notices.rest("a", [Some(130.0); 2]).is_empty());
    }
}
