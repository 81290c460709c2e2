//! What goes to a message broker and comes from it, whichever program or crate stands behind it, and letters about what could
//! not be read.

use crate::topics;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

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
}
