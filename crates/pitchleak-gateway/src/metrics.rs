//! What the service counts, as Prometheus reads it, and whether it is well.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Upper bounds of the time from a message to the estimates that follow from it, s.
const LATENCIES_S: [f64; 10] = [0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5, 2.0];
/// A service that did not turn around for so long hangs.
const HANGS: Duration = Duration::from_secs(10);
/// Checkpoints that fail one after the other before the service is not well.
const FAILURES: u32 = 3;

/// Counters and what there is of each.
pub struct Metrics {
    begun: Instant,
    pub connected: AtomicBool,
    pub messages: AtomicU64,
    pub bytes: AtomicU64,
    pub estimates: AtomicU64,
    pub alarms: AtomicU64,
    pub cylinders: AtomicU64,
    pub unacknowledged: AtomicU64,
    pub unsent_alarms: AtomicU64,
    pub broker_keeps: AtomicU64,
    pub broker_sends: AtomicU64,
    pub checkpoints: AtomicU64,
    checkpoint_failures: AtomicU64,
    pub checkpoint_bytes: AtomicU64,
    pub checkpoint_us: AtomicU64,
    latencies: [AtomicU64; LATENCIES_S.len() + 1],
    latency_us: AtomicU64,
    left_out: Mutex<BTreeMap<String, u64>>,
    /// Checkpoints in a row that could not be written.
    failures_in_a_row: AtomicU64,
    /// ms since the begin.
    turned: AtomicU64,
    saved: AtomicU64,
}

impl Metrics {
    pub fn new() -> Self {
        let zero = AtomicU64::default;
        Self {
            begun: Instant::now(),
            connected: AtomicBool::default(),
            messages: zero(),
            bytes: zero(),
            estimates: zero(),
            alarms: zero(),
            cylinders: zero(),
            unacknowledged: zero(),
            unsent_alarms: zero(),
            broker_keeps: zero(),
            broker_sends: zero(),
            checkpoints: zero(),
            checkpoint_failures: zero(),
            checkpoint_bytes: zero(),
            checkpoint_us: zero(),
            latencies: Default::default(),
            latency_us: zero(),
            left_out: Mutex::default(),
            failures_in_a_row: zero(),
            turned: zero(),
            saved: zero(),
        }
    }

    fn now_ms(&self) -> u64 {
        self.begun.elapsed().as_millis().try_into().unwrap_or(u64::MAX)
    }

    /// The service turned around.
    pub fn turn(&self) {
        self.turned.store(self.now_ms(), Ordering::Relaxed);
    }

    /// A checkpoint is on the disk.
    pub fn saved(&self, bytes: usize, took: Duration) {
        self.checkpoints.fetch_add(1, Ordering::Relaxed);
        self.checkpoint_bytes.store(bytes as u64, Ordering::Relaxed);
        self.checkpoint_us.store(took.as_micros().try_into().unwrap_or(u64::MAX), Ordering::Relaxed);
        self.saved.store(self.now_ms(), Ordering::Relaxed);
        self.failures_in_a_row.store(0, Ordering::Relaxed);
    }

    /// The disk took none.
    pub fn not_saved(&self) {
        self.checkpoint_failures.fetch_add(1, Ordering::Relaxed);
        self.failures_in_a_row.fetch_add(1, Ordering::Relaxed);
    }

    /// Time from a message to what follows from it.
    pub fn latency(&self, time: Duration) {
        let at =
            LATENCIES_S.iter().position(|bound| time.as_secs_f64() <= *bound).unwrap_or(LATENCIES_S.len());
        if let Some(count) = self.latencies.get(at) {
            count.fetch_add(1, Ordering::Relaxed);
        }
        self.latency_us.fetch_add(time.as_micros().try_into().unwrap_or(0), Ordering::Relaxed);
    }

    /// Samples or messages that were left out, by kind; kinds are few.
    pub fn left_out(&self, kind: &str, count: u64) {
        let mut left_out = self.left_out.lock().unwrap_or_else(PoisonError::into_inner);
        *left_out.entry(kind.to_owned()).or_default() += count;
    }

    /// What is wrong, if something is; checkpoints come `every` so often.
    pub fn trouble(&self, every: Duration) -> Option<String> {
        let since = |moment: &AtomicU64| {
            Duration::from_millis(self.now_ms().saturating_sub(moment.load(Ordering::Relaxed)))
        };
        if since(&self.turned) > HANGS {
            return Some(format!("hangs for {} s", since(&self.turned).as_secs()));
        }
        if !self.connected.load(Ordering::Relaxed) {
            return Some("no connection to the broker".to_owned());
        }
        let without = since(&self.saved);
        let failed = self.failures_in_a_row.load(Ordering::Relaxed) >= u64::from(FAILURES);
        (failed || without > FAILURES * every + HANGS)
            .then(|| format!("no checkpoint for {} s", without.as_secs()))
    }

    /// In Prometheus' text format.
    pub fn text(&self) -> String {
        let of = |value: &AtomicU64| value.load(Ordering::Relaxed) as f64;
        let age_s = self.now_ms().saturating_sub(self.saved.load(Ordering::Relaxed)) as f64 / 1e3;
        let connected = f64::from(u8::from(self.connected.load(Ordering::Relaxed)));
        let rows = [
            ("connected", "gauge", "1 while there is a connection to the broker", connected),
            ("cylinders", "gauge", "cylinders that are watched", of(&self.cylinders)),
            ("messages_total", "counter", "messages of samples", of(&self.messages)),
            ("bytes_total", "counter", "bytes in them", of(&self.bytes)),
            ("estimates_total", "counter", "estimates made", of(&self.estimates)),
            ("alarms_total", "counter", "alarms raised and cleared", of(&self.alarms)),
            ("unacknowledged", "gauge", "messages that wait for a checkpoint", of(&self.unacknowledged)),
            ("unsent_alarms", "gauge", "alarms that the broker does not have yet", of(&self.unsent_alarms)),
            (
                "broker_keeps",
                "gauge",
                "messages that the broker keeps while nobody takes them, at least; 0: not known",
                of(&self.broker_keeps),
            ),
            (
                "broker_sends",
                "gauge",
                "messages that the broker sends before it waits, at least; 0: not known",
                of(&self.broker_sends),
            ),
            ("checkpoints_total", "counter", "checkpoints written", of(&self.checkpoints)),
            (
                "checkpoint_failures_total",
                "counter",
                "checkpoints that could not be written",
                of(&self.checkpoint_failures),
            ),
            ("checkpoint_bytes", "gauge", "size of the last checkpoint", of(&self.checkpoint_bytes)),
            ("checkpoint_seconds", "gauge", "time that it took", of(&self.checkpoint_us) / 1e6),
            ("checkpoint_age_seconds", "gauge", "time since it was written", age_s),
        ];
        let mut text = String::new();
        for (name, kind, help, value) in rows {
            let _ = write!(
                text,
                "# HELP pitchleak_{name} {help}\n# TYPE pitchleak_{name} {kind}\npitchleak_{name} {value}\n"
            );
        }
        self.write_left_out(&mut text);
        self.write_latencies(&mut text);
        text
    }

    fn write_left_out(&self, text: &mut String) {
        let name = "pitchleak_left_out_total";
        let _ =
            write!(text, "# HELP {name} samples and messages that were left out\n# TYPE {name} counter\n");
        for (kind, count) in &*self.left_out.lock().unwrap_or_else(PoisonError::into_inner) {
            let _ = writeln!(text, "{name}{{kind=\"{kind}\"}} {count}");
        }
    }

    fn write_latencies(&self, text: &mut String) {
        let name = "pitchleak_latency_seconds";
        let _ = write!(text, "# HELP {name} from a message to its estimates\n# TYPE {name} histogram\n");
        let mut count = 0;
        let bounds = LATENCIES_S.iter().map(f64::to_string).chain(["+Inf".to_owned()]);
        for (bound, more) in bounds.zip(&self.latencies) {
            count += more.load(Ordering::Relaxed);
            let _ = writeln!(text, "{name}_bucket{{le=\"{bound}\"}} {count}");
        }
        let sum_s = self.latency_us.load(Ordering::Relaxed) as f64 / 1e6;
        let _ = write!(text, "{name}_sum {sum_s}\n{name}_count {count}\n");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_told_as_prometheus_reads_them() {
        let metrics = Metrics::new();
        metrics.left_out("late", 3);
        metrics.latency(Duration::from_millis(3));
        metrics.latency(Duration::from_secs(30));
        let text = metrics.text();
        for line in [
            "pitchleak_left_out_total{kind=\"late\"} 3",
            "pitchleak_latency_seconds_bucket{le=\"0.002\"} 0",
            "pitchleak_latency_seconds_bucket{le=\"0.005\"} 1",
            "pitchleak_latency_seconds_bucket{le=\"+Inf\"} 2",
            "pitchleak_latency_seconds_count 2",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} in {text}");
        }
    }

    #[test]
    fn a_service_without_a_broker_is_not_well() {
        let metrics = Metrics::new();
        let every = Duration::from_secs(10);
        assert!(metrics.trouble(every).is_some());
        metrics.connected.store(true, Ordering::Relaxed);
        assert_eq!(metrics.trouble(every), None);
    }

    #[test]
    fn nor_is_one_whose_disk_takes_no_checkpoint() {
        let metrics = Metrics::new();
        let every = Duration::from_secs(10);
        metrics.connected.store(true, Ordering::Relaxed);
        (0..2).for_each(|_| metrics.not_saved());
        assert_eq!(metrics.trouble(every), None);
        metrics.not_saved();
        assert!(metrics.trouble(every).is_some_and(|trouble| trouble.contains("no checkpoint")));
        metrics.saved(1000, Duration::ZERO);
        assert_eq!(metrics.trouble(every), None);
    }
}
