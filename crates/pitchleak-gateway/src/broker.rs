//! What the service needs of a message broker, whichever program or crate stands behind it.

use std::time::{Duration, Instant};

/// A way to a broker. Nothing here waits.
pub trait Broker {
    /// Hands over a message, to be sent once the connection allows, with the next [`send`](Self::send) at the latest.
    fn publish(&self, message: Message);

    /// Has sent what was handed over: many messages at once cost less than each by itself.
    fn send(&self);

    /// Acknowledges deliveries in the order in which they came. Those of a connection that is gone are passed over: they
    /// will come again.
    fn acknowledge(&self, tickets: Vec<Ticket>);

    /// Sends what it can within `wait`, and says goodbye.
    fn close(self, wait: Duration);
}

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
