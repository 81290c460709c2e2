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
/// At most, until a disk that took no checkpoint is tried again: a broker that waits makes it no emptier.
const TRY_AGAIN: Duration = Duration::from_secs(10);

pub struct Pace {
    every: Duration,
    /// Deliveries after which the broker waits for us.
    in_flight: usize,
    asked: Instant,
    delivered: Instant,
    stall: Stall,
    /// The last checkpoint could not be written.
    failed: bool,
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
        Self { every, in_flight, asked: now, delivered: now, stall: Stall::default(), failed: false }
    }

    pub fn delivered(&mut self, now: Instant) {
        self.delivered = now;
        if let Some(released) = self.stall.released.take() {
            self.stall.times = if now.duration_since(released) < AT_ONCE { self.stall.times + 1 } else { 0 };
        }
    }

    /// The broker waits after so many deliveries; says whether that is sooner than was thought.
    pub fn learn(&mut self, in_flight: usize) -> bool {
        let sooner = in_flight < self.in_flight;
        self.in_flight = self.in_flight.min(in_flight.max(1));
        sooner
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
        let since_asked = now.duration_since(self.asked);
        if self.failed && since_asked < self.every.min(TRY_AGAIN) {
            return Due::NotYet;
        }
        let silent = now.duration_since(self.delivered) >= SILENCE;
        let due = if unacknowledged >= self.in_flight || since_asked >= self.every || self.failed {
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
    fn a_full_disk_is_tried_once_in_a_while_however_much_waits() {
        let begin = Instant::now();
        let at = |ms| begin + Duration::from_millis(ms);
        let mut pace = Pace::new(Duration::from_secs(10), 20, begin);
        let mut fails = |ms| {
            let due = pace.due(at(ms), 500) != Due::NotYet;
            if due {
                pace.failed();
            }
            due
        };
        assert_eq!((0..60_000).step_by(100).filter(|ms| fails(*ms)).count(), 6);
        let mut pace = Pace::new(Duration::from_secs(3600), 20, begin);
        pace.failed();
        assert_eq!(pace.due(at(9_900), 0), Due::NotYet);
        assert_eq!(pace.due(at(10_000), 0), Due::Now);
        pace.acknowledged(at(10_100));
        assert_eq!(pace.due(at(10_200), 20), Due::Now);
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
