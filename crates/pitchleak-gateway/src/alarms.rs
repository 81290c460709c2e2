//! Alarms on their way to the broker, by their ids, and on the disk: each is sent until the broker has it, and one that it has
//! is not sent again, also where the samples that raised it come again after a kill.

use crate::broker::{Keeping, Message};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Alarms that the broker does not have, at most.
const MOST_WAITING: usize = 10_000;
/// Of those that it has, at most.
const MOST_SENT: usize = 1_000;

/// All that are kept.
#[derive(Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Alarms {
    by_id: BTreeMap<String, Alarm>,
    /// Number of the next one.
    #[serde(skip)]
    next: u64,
    /// There is something that the disk does not know.
    #[serde(skip)]
    changed: bool,
}

#[derive(Default, Serialize, Deserialize)]
struct Alarm {
    cylinder: String,
    topic: String,
    payload: String,
    /// The broker has it.
    sent: bool,
    /// A checkpoint holds the samples that raised it: it is raised no more.
    settled: bool,
    /// In the order in which they were raised.
    #[serde(skip)]
    number: u64,
    /// By samples that came since the start.
    #[serde(skip)]
    raised: bool,
}

impl Alarms {
    /// As the disk has them.
    pub fn parse(text: &str) -> Result<Self, serde_json::Error> {
        let mut alarms: Self = serde_json::from_str(text)?;
        for alarm in alarms.by_id.values_mut() {
            alarm.number = alarms.next;
            alarms.next += 1;
        }
        Ok(alarms)
    }

    /// For the disk, if it doesn't know all of it.
    pub fn unwritten(&mut self) -> Option<String> {
        std::mem::take(&mut self.changed).then(|| serde_json::to_string(self).ok()).flatten()
    }

    /// The disk took it not.
    pub fn not_written(&mut self) {
        self.changed = true;
    }

    /// What is to be sent for an alarm that was raised or cleared; nothing where it was before. Says also whether one has to
    /// make room for it.
    pub fn raise(
        &mut self,
        id: &str,
        cylinder: &str,
        topic: String,
        payload: String,
    ) -> (Option<Message>, bool) {
        if let Some(known) = self.by_id.get_mut(id) {
            known.raised = true;
            return (None, false);
        }
        self.changed = true;
        let number = self.next;
        self.next += 1;
        let cylinder = cylinder.to_owned();
        let alarm = Alarm { cylinder, topic, payload, number, raised: true, ..Alarm::default() };
        let message = alarm.message();
        self.by_id.insert(id.to_owned(), alarm);
        self.make_room(true, MOST_SENT);
        (Some(message), self.make_room(false, MOST_WAITING))
    }

    /// Forgets the oldest of those that the broker has, or has not, where there are more than `most`.
    fn make_room(&mut self, sent: bool, most: usize) -> bool {
        let of_kind = self.by_id.iter().filter(|(_, alarm)| alarm.sent == sent);
        if of_kind.clone().count() <= most {
            return false;
        }
        let oldest = of_kind.min_by_key(|(_, alarm)| alarm.number).map(|(id, _)| id.clone());
        oldest.is_some_and(|id| self.by_id.remove(&id).is_some())
    }

    /// All that the broker does not have.
    pub fn unsent(&self) -> Vec<Message> {
        let mut unsent: Vec<_> = self.by_id.values().filter(|alarm| !alarm.sent).collect();
        unsent.sort_by_key(|alarm| alarm.number);
        unsent.into_iter().map(Alarm::message).collect()
    }

    /// How many those are.
    pub fn waiting(&self) -> usize {
        self.by_id.values().filter(|alarm| !alarm.sent).count()
    }

    /// The broker has it.
    pub fn sent(&mut self, number: u64) {
        self.mark(|alarm| alarm.sent |= alarm.number == number);
    }

    /// Forgets those that are both sent and settled by then.
    fn mark(&mut self, mark: impl Fn(&mut Alarm)) {
        self.changed = true;
        self.by_id.retain(|_, alarm| {
            mark(alarm);
            !(alarm.sent && alarm.settled)
        });
    }

    /// Those that are raised by now: once their cylinders' states are on the disk, samples raise them no more.
    pub fn raised(&self) -> Vec<u64> {
        self.by_id.values().filter(|alarm| alarm.raised && !alarm.settled).map(|alarm| alarm.number).collect()
    }

    /// The states with these are on the disk.
    pub fn settle(&mut self, numbers: &[u64]) {
        if !numbers.is_empty() {
            self.mark(|alarm| alarm.settled |= numbers.contains(&alarm.number));
        }
    }

    /// A clock that was set back may raise the same again, and mean it.
    pub fn forget_sent(&mut self, cylinder: &str) {
        self.changed = true;
        self.by_id.retain(|_, alarm| !(alarm.sent && alarm.cylinder == cylinder));
    }
}

impl Alarm {
    fn message(&self) -> Message {
        let Self { topic, payload, number, .. } = self;
        Message { topic: topic.clone(), payload: payload.clone(), keeping: Keeping::Each(*number) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raise(alarms: &mut Alarms, id: &str) -> Option<Message> {
        alarms.raise(id, "B1", "pitchleak/B1/alarm".to_owned(), id.to_owned()).0
    }

    /// As after a kill.
    fn restarted(alarms: &mut Alarms) -> Alarms {
        Alarms::parse(&alarms.unwritten().expect("something new")).expect("what was written")
    }

    #[test]
    fn one_that_the_broker_has_is_not_sent_again_until_its_samples_are_on_the_disk() {
        let mut alarms = Alarms::default();
        assert!(raise(&mut alarms, "a").is_some());
        alarms.sent(0);
        let mut next = restarted(&mut alarms);
        assert_eq!((next.unsent(), raise(&mut next, "a")), (Vec::new(), None));
        let raised = next.raised();
        next.settle(&raised);
        assert!(next.by_id.is_empty());
    }

    #[test]
    fn one_that_it_does_not_have_is_sent_after_a_restart_and_raised_by_nothing_else() {
        let mut alarms = Alarms::default();
        raise(&mut alarms, "b");
        raise(&mut alarms, "a");
        let raised = alarms.raised();
        alarms.settle(&raised);
        let mut next = restarted(&mut alarms);
        assert_eq!(next.waiting(), 2);
        next.unsent().iter().for_each(|message| match message.keeping {
            Keeping::Each(number) => next.sent(number),
            other => panic!("{other:?}"),
        });
        assert!(next.by_id.is_empty());
    }

    #[test]
    fn they_are_bounded() {
        let mut alarms = Alarms::default();
        let fell = (0..MOST_WAITING + 5)
            .filter(|k| alarms.raise(&k.to_string(), "B1", String::new(), String::new()).1);
        assert_eq!(fell.count(), 5);
        assert_eq!(alarms.waiting(), MOST_WAITING);
    }
}
