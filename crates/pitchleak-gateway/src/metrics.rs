//! What the service counts, as Prometheus reads it, and whether it is well.

use crate::board::Board;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Metric, Registry};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Upper bounds of the time from a message to the estimates that follow from it, s.
const LATENCIES_S: [f64; 10] = [0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5, 2.0];
/// A service that did not turn around for so long hangs.
const HANGS: Duration = Duration::from_secs(10);
/// Checkpoints that fail one after the other before the service is not well.
const FAILURES: u32 = 3;

/// Counters and what there is of each.
pub struct Metrics {
    registry: Registry,
    begun: Instant,
    /// Of each cylinder.
    pub board: Arc<Board>,
    pub connected: Gauge,
    pub messages: Counter,
    pub bytes: Counter,
    pub estimates: Counter,
    pub alarms: Counter,
    pub cylinders: Gauge,
    pub unacknowledged: Gauge,
    pub unsent_alarms: Gauge,
    pub reload_failures: Counter,
    checkpoints: Counter,
    checkpoint_failures: Counter,
    checkpoint_bytes: Gauge,
    checkpoint_seconds: Gauge<f64, AtomicU64>,
    checkpoint_age_seconds: Gauge<f64, AtomicU64>,
    written_bytes: Counter,
    pub latency: Histogram,
    left_out: Family<[(&'static str, String); 1], Counter>,
    /// Checkpoints in a row that could not be written.
    failures_in_a_row: AtomicU64,
    /// ms since the begin.
    turned: AtomicU64,
    saved: AtomicU64,
}

impl Metrics {
    pub fn new(board: Arc<Board>) -> Self {
        let mut registry = Registry::with_prefix("pitchleak");
        let all = &mut registry;
        all.register_collector(Box::new(Arc::clone(&board)));
        Self {
            begun: Instant::now(),
            board,
            connected: registered(all, "connected", "1 while there is a connection to the broker"),
            cylinders: registered(all, "cylinders", "Cylinders of which samples came"),
            messages: registered(all, "messages", "Messages of samples"),
            bytes: registered(all, "bytes", "Bytes in them"),
            estimates: registered(all, "estimates", "Estimates made"),
            alarms: registered(all, "alarms", "Alarms raised and cleared"),
            unacknowledged: registered(all, "unacknowledged", "Messages that wait for a checkpoint"),
            unsent_alarms: registered(all, "unsent_alarms", "Alarms that the broker does not have yet"),
            reload_failures: registered(all, "reload_failures", "Configurations that could not be used"),
            checkpoints: registered(all, "checkpoints", "Checkpoints written"),
            checkpoint_failures: registered(
                all,
                "checkpoint_failures",
                "Checkpoints that could not be written",
            ),
            checkpoint_bytes: registered(all, "checkpoint_bytes", "Size of the last checkpoint"),
            checkpoint_seconds: registered(all, "checkpoint_seconds", "Time that it took, s"),
            checkpoint_age_seconds: registered(all, "checkpoint_age_seconds", "Time since it was written, s"),
            written_bytes: registered(all, "written_bytes", "Bytes of all checkpoints"),
            left_out: registered(all, "left_out", "Samples and messages that were left out"),
            latency: {
                let latency = Histogram::new(LATENCIES_S);
                all.register("latency_seconds", "Time from a message to its estimates, s", latency.clone());
                latency
            },
            failures_in_a_row: AtomicU64::default(),
            turned: AtomicU64::default(),
            saved: AtomicU64::default(),
            registry,
        }
    }

    fn now_ms(&self) -> u64 {
        self.begun.elapsed().as_millis().try_into().unwrap_or(u64::MAX)
    }

    fn since(&self, moment: &AtomicU64) -> Duration {
        Duration::from_millis(self.now_ms().saturating_sub(moment.load(Ordering::Relaxed)))
    }

    /// The service turned around.
    pub fn turn(&self) {
        self.turned.store(self.now_ms(), Ordering::Relaxed);
    }

    /// All that changed is on the disk, in so many bytes.
    pub fn saved(&self, bytes: usize, took: Duration) {
        if bytes > 0 {
            self.checkpoints.inc();
            self.checkpoint_bytes.set(bytes.try_into().unwrap_or(i64::MAX));
            self.written_bytes.inc_by(bytes as u64);
            self.checkpoint_seconds.set(took.as_secs_f64());
        }
        self.saved.store(self.now_ms(), Ordering::Relaxed);
        self.failures_in_a_row.store(0, Ordering::Relaxed);
    }

    /// The disk took none.
    pub fn not_saved(&self) {
        self.checkpoint_failures.inc();
        self.failures_in_a_row.fetch_add(1, Ordering::Relaxed);
    }

    /// Samples or messages that were left out; kinds are few.
    pub fn left_out(&self, kind: &str, count: u64) {
        self.left_out.get_or_create(&[("kind", kind.to_owned())]).inc_by(count);
    }

    /// All that a watch left out since the begin.
    pub fn left_out_in_all(&self, counts: BTreeMap<String, u64>) {
        for (kind, count) in counts {
            let counter = self.left_out.get_or_create_owned(&[("kind", kind)]);
            counter.inc_by(count.saturating_sub(counter.get()));
        }
    }

    /// What is wrong, if something is; checkpoints come `every` so often.
    pub fn trouble(&self, every: Duration) -> Option<String> {
        let turned = self.since(&self.turned);
        if turned > HANGS {
            return Some(format!("hangs for {} s", turned.as_secs()));
        }
        if self.connected.get() == 0 {
            return Some("no connection to the broker".to_owned());
        }
        let without = self.since(&self.saved);
        let failed = self.failures_in_a_row.load(Ordering::Relaxed) >= u64::from(FAILURES);
        (failed || without > FAILURES * every + HANGS)
            .then(|| format!("no checkpoint for {} s", without.as_secs()))
    }

    /// In the text format of OpenMetrics.
    pub fn text(&self) -> String {
        self.checkpoint_age_seconds.set(self.since(&self.saved).as_secs_f64());
        let mut text = String::new();
        // Writing to a string does not fail.
        let _ = encode(&mut text, &self.registry);
        text
    }
}

fn registered<M: Metric + Clone + Default>(registry: &mut Registry, name: &str, help: &str) -> M {
    let metric = M::default();
    registry.register(name, help, metric.clone());
    metric
}

#[cfg(test)]
mod tests {
    use super::*;

    fn metrics() -> Metrics {
        Metrics::new(Arc::new(Board::new(Duration::from_secs(60))))
    }

    #[test]
    fn counts_are_told_as_prometheus_reads_them() {
        let metrics = metrics();
        metrics.left_out_in_all(BTreeMap::from([("late".to_owned(), 3)]));
        metrics.left_out_in_all(BTreeMap::from([("late".to_owned(), 2000)]));
        metrics.latency.observe(0.003);
        metrics.latency.observe(30.0);
        let text = metrics.text();
        for line in [
            "pitchleak_left_out_total{kind=\"late\"} 2000",
            "pitchleak_latency_seconds_bucket{le=\"0.002\"} 0",
            "pitchleak_latency_seconds_bucket{le=\"0.005\"} 1",
            "pitchleak_latency_seconds_bucket{le=\"+Inf\"} 2",
            "pitchleak_latency_seconds_count 2",
            "# EOF",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} in {text}");
        }
    }

    /// What a dashboard asks for and nobody tells stays empty without a word.
    #[test]
    fn rules_and_dashboard_ask_for_what_is_told() {
        let metrics = metrics();
        metrics.left_out("late", 1);
        let text = metrics.text();
        let types = text.lines().filter_map(|line| line.strip_prefix("# TYPE ")?.split_once(' '));
        let told: Vec<_> = types
            .flat_map(|(name, kind)| match kind {
                "counter" => vec![format!("{name}_total")],
                "histogram" => ["bucket", "sum", "count"].map(|part| format!("{name}_{part}")).to_vec(),
                _ => vec![name.to_owned()],
            })
            .collect();
        for file in [
            include_str!("../../../packaging/prometheus/pitchleak.rules.yml"),
            include_str!("../../../packaging/grafana/pitchleak.json"),
        ] {
            let asked = file.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
            let asked: Vec<_> = asked.filter(|word| word.starts_with("pitchleak_")).collect();
            assert!(asked.len() > 5);
            for name in asked {
                assert!(told.iter().any(|told| told == name), "{name} is not told: {told:?}");
            }
        }
    }

    #[test]
    fn a_service_without_a_broker_is_not_well() {
        let metrics = metrics();
        let every = Duration::from_secs(10);
        assert!(metrics.trouble(every).is_some());
        metrics.connected.set(1);
        assert_eq!(metrics.trouble(every), None);
    }

    #[test]
    fn nor_is_one_whose_disk_takes_no_checkpoint() {
        let metrics = metrics();
        let every = Duration::from_secs(10);
        metrics.connected.set(1);
        (0..2).for_each(|_| metrics.not_saved());
        assert_eq!(metrics.trouble(every), None);
        metrics.not_saved();
        assert!(metrics.trouble(every).is_some_and(|trouble| trouble.contains("no checkpoint")));
        metrics.saved(1000, Duration::ZERO);
        assert_eq!(metrics.trouble(every), None);
    }
}
