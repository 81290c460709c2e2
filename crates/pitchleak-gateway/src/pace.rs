//! When to write a checkpoint: often enough for the broker, seldom enough for the disk.

use std::time::{Duration, Instant};

/// Fewer deliveries than this are no sign of a broker that waits.
const LEAST_IN_FLIGHT: usize = 10;
/// A broker that has more to say does so sooner.
const SILENCE: Duration = Duration::from_millis(300);
/// So often in a row it stopped at the same number.
const STALLS: u32 = 3;

pub struct Pace {
    every: Duration,
    /// Deliveries after which the broker waits for us.
    in_flight: usize,
    asked: Instant,
    delivered: Instant,
    /// Where it stopped, and how often in a row.
    stalls: (usize, u32),
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
    pub fn new(every: Duration, in_flight: usize, now: Instant) -> Self {
        Self { every, in_flight, asked: now, delivered: now, stalls: (0, 0) }
    }

    pub fn delivered(&mut self, now: Instant) {
        self.delivered = now;
    }

    /// Whether a checkpoint is due while so many deliveries wait to be acknowledged; if so, it is taken to be written.
    pub fn due(&mut self, now: Instant, unacknowledged: usize) -> Due {
        let silent = now.duration_since(self.delivered) >= SILENCE;
        let due = if unacknowledged >= self.in_flight || now.duration_since(self.asked) >= self.every {
            Due::Now
        } else if silent && unacknowledged >= LEAST_IN_FLIGHT {
            self.stalled_at(unacknowledged)
        } else {
            return Due::NotYet;
        };
        self.asked = now;
        due
    }

    fn stalled_at(&mut self, count: usize) -> Due {
        let (where_before, times) = self.stalls;
        self.stalls = (count, if where_before == count { times + 1 } else { 1 });
        if self.stalls.1 < STALLS {
            return Due::Now;
        }
        self.in_flight = count;
        Due::NowThatBrokerWaits(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broker_that_waits_is_found_out() {
        let begin = Instant::now();
        let mut pace = Pace::new(Duration::from_secs(10), 1000, begin);
        let mut now = begin;
        for expected in [Due::Now, Due::Now, Due::NowThatBrokerWaits(20)] {
            pace.delivered(now);
            assert_eq!(pace.due(now + Duration::from_millis(100), 20), Due::NotYet);
            now += Duration::from_millis(400);
            assert_eq!(pace.due(now, 20), expected);
        }
        pace.delivered(now);
        assert_eq!(pace.due(now, 20), Due::Now);
        assert_eq!(pace.due(now, 3), Due::NotYet);
        assert_eq!(pace.due(now + Duration::from_secs(10), 0), Due::Now);
    }
}
