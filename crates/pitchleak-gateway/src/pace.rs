//! When to write a checkpoint: seldom, as a disk wears out, and often enough for a broker that waits for us.

use std::time::{Duration, Instant};

/// Fewer deliveries than this are no sign of a broker that waits.
const LEAST_IN_FLIGHT: usize = 10;
/// A broker that has more to say does so sooner.
const SILENCE: Duration = Duration::from_millis(300);
/// One that waited for us goes on as soon as it has its acknowledgements.
const AT_ONCE: Duration = Duration::from_millis(150);
/// So often in a row it stopped at the same number.
const STALLS: u32 = 3;
/// Between two checkpoints for a broker that waits, at least.
const FOR_BROKER: Duration = Duration::from_secs(1);
/// At most, until a disk that took no checkpoint is tried again: a broker that waits makes it no emptier.
const TRY_AGAIN: Duration = Duration::from_secs(10);

/// One checkpoint `every` so often, whatever the senders do. Sooner only where the broker waits for us after fewer deliveries
/// than MQTT 5's Receive Maximum allows it, which is its own limit: it is in the configuration, or is found out.
pub struct Pace {
    every: Duration,
    /// Deliveries after which the broker waits for us; none where that is not known.
    in_flight: Option<usize>,
    asked: Instant,
    delivered: Instant,
    stall: Stall,
    /// The last checkpoint could not be written.
    failed: bool,
}

/// Where the broker had fallen silent when a checkpoint was due.
#[derive(Default)]
struct Stall {
    count: usize,
    /// How often in a row it went on at once when it had its acknowledgements.
    times: u32,
    /// When it had them; none where it had not been silent.
    released: Option<Instant>,
}

/// Whether a checkpoint is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    NotYet,
    Now,
    /// Also, it is known now that the broker waits after so many deliveries.
    NowThatBrokerWaits(usize),
}

impl Pace {
    pub fn new(every: Duration, in_flight: Option<u16>, now: Instant) -> Self {
        let in_flight = in_flight.map(usize::from);
        Self { every, in_flight, asked: now, delivered: now, stall: Stall::default(), failed: false }
    }

    /// By another configuration.
    pub fn set_every(&mut self, every: Duration) {
        self.every = every;
    }

    pub fn delivered(&mut self, now: Instant) {
        self.delivered = now;
        if let Some(released) = self.stall.released.take() {
            self.stall.times = if now.duration_since(released) < AT_ONCE { self.stall.times + 1 } else { 0 };
        }
    }

    /// The disk took no checkpoint.
    pub fn failed(&mut self) {
        self.failed = true;
    }

    /// It took one, and the broker has its acknowledgements.
    pub fn acknowledged(&mut self, now: Instant) {
        self.failed = false;
        if self.stall.released.is_some() {
            self.stall.released = Some(now);
        }
    }

    /// Whether a checkpoint is due while so many deliveries wait to be acknowledged; if so, it is taken to be written.
    pub fn due(&mut self, now: Instant, unacknowledged: usize) -> Due {
        let broker_waits = self.in_flight.is_some_and(|in_flight| unacknowledged >= in_flight);
        let pause = match (self.failed, broker_waits) {
            (true, _) => self.every.min(TRY_AGAIN),
            (false, true) => self.every.min(FOR_BROKER),
            (false, false) => self.every,
        };
        if now.duration_since(self.asked) < pause {
            return Due::NotYet;
        }
        self.asked = now;
        let silent = now.duration_since(self.delivered) >= SILENCE;
        if broker_waits || !silent || unacknowledged < LEAST_IN_FLIGHT {
            self.stall.released = None;
            return Due::Now;
        }
        if self.stall.count != unacknowledged {
            self.stall = Stall { count: unacknowledged, times: 0, released: None };
        }
        self.stall.released = Some(now);
        if self.stall.times >= STALLS {
            self.in_flight = Some(unacknowledged);
            return Due::NowThatBrokerWaits(unacknowledged);
        }
        Due::Now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is due in so many seconds, where so many deliveries come together at the begin of each, unless the broker waits
    /// after `most`.
    fn dues(seconds: u32, burst: usize, most: usize) -> Vec<Due> {
        let begin = Instant::now();
        let mut pace = Pace::new(Duration::from_secs(10), None, begin);
        let (mut unacknowledged, mut queued) = (0, 0);
        let mut dues = Vec::new();
        for ms in (0..1000 * seconds).step_by(10) {
            let now = begin + Duration::from_millis(ms.into());
            queued += if ms % 1000 == 0 { burst } else { 0 };
            while queued > 0 && unacknowledged < most {
                (queued, unacknowledged) = (queued - 1, unacknowledged + 1);
                pace.delivered(now);
            }
            let due = pace.due(now, unacknowledged);
            if due != Due::NotYet {
                dues.push(due);
                unacknowledged = 0;
                pace.acknowledged(now);
            }
        }
        dues
    }

    #[test]
    fn senders_that_burst_cost_no_checkpoint_more() {
        assert_eq!(dues(100, 200, 65_535), [Due::Now; 9]);
    }

    #[test]
    fn a_broker_that_waits_is_found_out_and_costs_one_a_second_at_most() {
        let dues = dues(100, 200, 20);
        assert_eq!(dues[..4], [Due::Now, Due::Now, Due::Now, Due::NowThatBrokerWaits(20)]);
        assert!((50..=64).contains(&dues.len()), "{}", dues.len());
    }

    #[test]
    fn a_full_disk_is_tried_once_in_a_while_however_much_waits() {
        let begin = Instant::now();
        let at = |ms| begin + Duration::from_millis(ms);
        let mut pace = Pace::new(Duration::from_secs(10), Some(20), begin);
        let mut fails = |ms| {
            let due = pace.due(at(ms), 500) != Due::NotYet;
            if due {
                pace.failed();
            }
            due
        };
        assert_eq!((0..60_000).step_by(100).filter(|ms| fails(*ms)).count(), 6);
        let mut pace = Pace::new(Duration::from_secs(3600), Some(20), begin);
        pace.failed();
        assert_eq!(pace.due(at(9_900), 0), Due::NotYet);
        assert_eq!(pace.due(at(10_000), 0), Due::Now);
        pace.acknowledged(at(10_100));
        assert_eq!(pace.due(at(11_000), 20), Due::Now);
    }
}
