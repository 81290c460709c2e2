//! What goes to a message broker and comes from it, whichever program or crate stands behind it: messages, those that wait to be
//! sent, in bounded memory, and letters about what can't be read.

use crate::topics;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// What goes out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    pub topic: String,
    pub payload: String,
    pub keeping: Keeping,
}

/// What becomes of a message that cannot be sent yet, and at the broker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeping {
    /// A later one of the same topic takes its place; the broker keeps the last.
    Latest,
    /// A later one of the same topic takes its place; whoever listens hears it, and nobody else.
    Passing,
    /// Each is sent until the broker has it, which comes back as [`Inbound::Confirmed`].
    Each(u64),
}

/// What comes in.
#[derive(Debug)]
pub enum Inbound {
    /// Connected, and samples can come; says whether the broker knew the session.
    Up { session_kept: bool },
    /// No connection, and why.
    Down(String),
    /// Samples.
    Delivery(Delivery),
    /// The broker has a message of ours.
    Confirmed(u64),
}

/// A message for us.
#[derive(Debug)]
pub struct Delivery {
    pub topic: String,
    /// Its size alone, where it is too large to be looked at.
    pub payload: Result<Vec<u8>, usize>,
    /// Whether it may have come before.
    pub resent: bool,
    /// None where the broker wants none back.
    pub ticket: Option<Ticket>,
    pub received: Instant,
}

/// By which a delivery is acknowledged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket {
    /// Counts connections.
    pub connection: u64,
    pub id: u16,
}

/// In a minute, at most.
const MOST: u32 = 20;
const MINUTE: Duration = Duration::from_secs(60);
/// Bytes of a payload that are told.
const LONGEST: usize = 16 * 1024;

/// Messages that could not be read, for whoever looks for the sender's mistake, bounded in number and size: how many there were
/// lately.
#[derive(Default)]
pub struct DeadLetters {
    minute: Option<Instant>,
    count: u32,
}

impl DeadLetters {
    /// The letter that tells of a delivery; none where there were too many lately.
    pub fn letter(
        &mut self,
        base: &str,
        delivery: &Delivery,
        kind: &str,
        why: &str,
        now: Instant,
    ) -> Option<Message> {
        if self.minute.is_none_or(|minute| now.duration_since(minute) >= MINUTE) {
            (self.minute, self.count) = (Some(now), 0);
        }
        self.count += 1;
        if self.count > MOST {
            return None;
        }
        let payload = delivery.payload.as_deref().unwrap_or_default();
        let (begin, bytes) = (payload.get(..LONGEST).unwrap_or(payload), payload.len());
        let mut letter = json!({
            "type": "dead_letter", "kind": kind, "text": why, "topic": delivery.topic, "bytes": bytes,
        });
        let (name, value) = match std::str::from_utf8(begin) {
            Ok(text) => ("payload", Value::from(text)),
            Err(_) => ("payload_base64", Value::from(STANDARD.encode(begin))),
        };
        letter[name] = value;
        let topic = topics::of_cylinder(base, "dead_letter", kind);
        Some(Message { topic, payload: letter.to_string(), keeping: Keeping::Passing })
    }
}

/// Messages at most of which each counts.
const MOST_EACH: usize = 10_000;
/// Topics at most of which the last message counts.
const MOST_TOPICS: usize = 50_000;

/// Filled by the service, emptied by the network thread. To fill it takes no time.
#[derive(Default)]
pub struct Outbox {
    waiting: Mutex<Waiting>,
    filled: Notify,
}

#[derive(Default)]
struct Waiting {
    tickets: VecDeque<Ticket>,
    each: VecDeque<Message>,
    /// Topics in the order of their first message.
    topics: VecDeque<String>,
    latest: BTreeMap<String, Message>,
    /// Something was put that the network thread was not woken for.
    unsaid: bool,
    closing: bool,
}

/// What is to be sent next.
#[derive(Debug, PartialEq, Eq)]
pub enum Next {
    Acknowledge(Ticket),
    Publish(Message),
    /// Nothing is left, and nothing will come.
    Close,
}

impl Outbox {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Hands over a message, to be sent with the next [`send`](Self::send) at the latest.
    pub fn put(&self, message: Message) {
        let mut waiting = self.waiting();
        waiting.unsaid = true;
        match message.keeping {
            Keeping::Each(_) if waiting.each.len() < MOST_EACH => waiting.each.push_back(message),
            // The service still has it, and hands it over again after a restart.
            Keeping::Each(_) => {}
            Keeping::Latest | Keeping::Passing => {
                let topic = message.topic.clone();
                let there_are = waiting.latest.len();
                if let Some(older) = waiting.latest.get_mut(&topic) {
                    *older = message;
                } else if there_are < MOST_TOPICS {
                    waiting.topics.push_back(topic.clone());
                    waiting.latest.insert(topic, message);
                }
            }
        }
    }

    /// Wakes the network thread if something was put since: many messages at once cost less than each by itself.
    pub fn send(&self) {
        if std::mem::take(&mut self.waiting().unsaid) {
            self.filled.notify_one();
        }
    }

    /// Acknowledges deliveries in the order in which they came. Those of a connection that is gone are passed over: they will
    /// come again.
    pub fn acknowledge(&self, tickets: Vec<Ticket>) {
        self.waiting().tickets.extend(tickets);
        self.filled.notify_one();
    }

    /// Puts back what could not be handed over.
    pub fn put_back(&self, next: Next) {
        let mut waiting = self.waiting();
        match next {
            Next::Acknowledge(ticket) => waiting.tickets.push_front(ticket),
            Next::Publish(message) if matches!(message.keeping, Keeping::Each(_)) => {
                waiting.each.push_front(message);
            }
            Next::Publish(_) | Next::Close => {}
        }
        drop(waiting);
        self.filled.notify_one();
    }

    /// After this, [`next`](Self::next) gives [`Next::Close`] once nothing else is left.
    pub fn close(&self) {
        self.waiting().closing = true;
        self.filled.notify_one();
    }

    /// The next thing to send; waits until there is one.
    pub async fn next(&self) -> Next {
        loop {
            if let Some(next) = self.waiting().next() {
                return next;
            }
            self.filled.notified().await;
        }
    }
}

impl Waiting {
    fn next(&mut self) -> Option<Next> {
        if let Some(ticket) = self.tickets.pop_front() {
            return Some(Next::Acknowledge(ticket));
        }
        if let Some(message) = self.each.pop_front() {
            return Some(Next::Publish(message));
        }
        while let Some(topic) = self.topics.pop_front() {
            if let Some(message) = self.latest.remove(&topic) {
                return Some(Next::Publish(message));
            }
        }
        self.closing.then_some(Next::Close)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_letters_is_bounded() {
        let (mut letters, begin) = (DeadLetters::default(), Instant::now());
        let delivery = Delivery {
            topic: "pitch/B1/samples".to_owned(),
            payload: Ok([b"{".as_slice(), &[0xff; 100_000]].concat()),
            resent: false,
            ticket: None,
            received: begin,
        };
        let told: Vec<_> = (0..1000)
            .filter_map(|k| {
                letters.letter("base", &delivery, "unreadable", "why", begin + Duration::from_millis(100 * k))
            })
            .collect();
        assert_eq!(told.len(), 40);
        assert_eq!(told[0].topic, "base/dead_letter/unreadable");
        let letter: Value = serde_json::from_str(&told[0].payload).expect("JSON");
        assert_eq!((&letter["topic"], &letter["bytes"]), (&json!("pitch/B1/samples"), &json!(100_001)));
        assert!(told[0].payload.len() < 2 * LONGEST && letter["payload_base64"].is_string());
    }

    fn message(topic: &str, payload: &str, keeping: Keeping) -> Message {
        Message { topic: topic.to_owned(), payload: payload.to_owned(), keeping }
    }

    #[test]
    fn of_estimates_the_last_counts_and_of_alarms_each() {
        let outbox = Outbox::default();
        outbox.put(message("a/estimate", "1", Keeping::Latest));
        outbox.put(message("b/estimate", "1", Keeping::Latest));
        outbox.put(message("a/estimate", "2", Keeping::Latest));
        outbox.put(message("a/alarm", "1", Keeping::Each(0)));
        outbox.put(message("a/alarm", "2", Keeping::Each(1)));
        outbox.close();
        let mut payloads = Vec::new();
        while let Some(Next::Publish(message)) = outbox.waiting().next() {
            payloads.push(message.topic + message.payload.as_str());
        }
        assert_eq!(payloads, ["a/alarm1", "a/alarm2", "a/estimate2", "b/estimate1"]);
        assert_eq!(outbox.waiting().next(), Some(Next::Close));
    }

    #[test]
    fn a_broker_that_is_away_for_long_costs_no_more_memory() {
        let outbox = Outbox::default();
        for k in 0..100_000 {
            outbox.put(message("a/estimate", "1", Keeping::Latest));
            outbox.put(message("a/alarm", "1", Keeping::Each(k)));
        }
        let waiting = outbox.waiting();
        assert_eq!((waiting.each.len(), waiting.topics.len()), (MOST_EACH, 1));
    }
}
