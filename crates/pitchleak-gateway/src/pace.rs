//! When to write a checkpoint: often enough for the broker, seldom enough for the disk.

use std::time::{Duration, Instant};

/// Fewer deliveries than this are no sign of a broker that waits.
const LEAST_IN_FLIGHT: usize = 10;
/// A broker that has more to say does so sooner.
const SILENCE: Duration = Duration::from_millis(300);
/// One that waited for us goes on as soon as it has its acknowledgements.
const AT_ONCE: Duration = Duration::from_millis(150);
/// So often in a row it stopped at the same number.
const STALLS: u32 = 3;

pub struct Pace {
    every: Duration,
    /// Deliveries after which the broker waits for us.
    in_flight: usize,
    asked: Instant,
    delivered: Instant,
    stall: Stall,
}

/// Where the broker fell silent.
#[derive(Default)]
struct Stall {
    count: usize,
    /// How often in a row it went on at once when it had its acknowledgements.
    times: u32,
    /// When it had them; none where it had them for another reason.
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
    pub fn new(every: Duration, in_flight: usize, now: Instant) -> Self {
        Self { every, in_flight, asked: now, delivered: now, stall: Stall::default() }
    }

    pub fn delivered(&mut self, now: Instant) {
        self.delivered = now;
        if let Some(released) = self.stall.released.take() {
            self.stall.times = if now.duration_since(released) < AT_ONCE { self.stall.times + 1 } else { 0 };
        }
    }

    /// The broker has its acknowledgements.
    pub fn acknowledged(&mut self, now: Instant) {
        if self.stall.released.is_some() {
            self.stall.released = Some(now);
        }
    }

    /// Whether a checkpoint is due while so many deliveries wait to be acknowledged; if so, it is taken to be written.
    pub fn due(&mut self, now: Instant, unacknowledged: usize) -> Due {
        let silent = now.duration_since(self.delivered) >= SILENCE;
        let due = if unacknowledged >= self.in_flight || now.duration_since(self.asked) >= self.every {
            self.stall.released = None;
            Due::Now
        } else if silent && unacknowledged >= LEAST_IN_FLIGHT {
            self.stalled_at(unacknowledged, now)
        } else {
            return Due::NotYet;
        };
        self.asked = now;
        due
    }

    fn stalled_at(&mut self, count: usize, now: Instant) -> Due {
        if self.stall.count != count {
            self.stall = Stall { count, times: 0, released: None };
        }
        if self.stall.times >= STALLS {
            self.in_flight = count;
            return Due::NowThatBrokerWaits(count);
        }
        self.stall.released = Some(now);
        Due::Now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twenty deliveries, silence, a checkpoint, and the next delivery so long after it.
    fn four_rounds(pause: Duration) -> Vec<Due> {
        let mut now = Instant::now();
        let mut pace = Pace::new(Duration::from_secs(10), 1000, now);
        let mut round = |_| {
            pace.delivered(now);
            assert_eq!(pace.due(now + Duration::from_millis(100), 20), Due::NotYet);
            now += Duration::from_millis(400);
            let due = pace.due(now, 20);
            now += Duration::from_millis(30);
            pace.acknowledged(now);
            now += pause;
            due
        };
        (0..4).map(&mut round).collect()
    }

    #[test]
    fn a_broker_that_waits_is_found_out() {
        let dues = four_rounds(Duration::from_millis(5));
        assert_eq!(dues, [Due::Now, Due::Now, Due::Now, Due::NowThatBrokerWaits(20)]);
    }

    #[test]
    fn a_feed_that_comes_in_bursts_is_none() {
        assert_eq!(four_rounds(Duration::from_millis(600)), [Due::Now; 4]);
    }

    #[test]
    fn a_checkpoint_comes_in_time_and_when_the_window_is_full() {
        let begin = Instant::now();
        let mut pace = Pace::new(Duration::from_secs(10), 20, begin);
        pace.delivered(begin);
        assert_eq!(pace.due(begin, 19), Due::NotYet);
        assert_eq!(pace.due(begin, 20), Due::Now);
        assert_eq!(pace.due(begin + Duration::from_secs(10), 0), Due::Now);
    }
}
