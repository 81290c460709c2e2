//! What is known of each cylinder, for whoever looks: the page, the metrics, and whether one has fallen silent.

use pitchleak::core::{Leak, PerLeak};
use pitchleak::live::EstimateEvent;
use pitchleak::report::Status;
use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeLabelSet, EncodeMetric};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::gauge::ConstGauge;
use serde::Serialize;
use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Minutes whose means are kept.
const MINUTES: usize = 60;
const MINUTE: Duration = Duration::from_secs(60);
/// Cylinders that health names.
const NAMED: usize = 20;

/// All cylinders.
#[derive(Debug)]
pub struct Board {
    silent_after: Duration,
    cards: Mutex<BTreeMap<String, Card>>,
}

#[derive(Debug)]
struct Card {
    estimate: Option<EstimateEvent>,
    /// Since when it is waited for, or of its last estimate.
    heard: Instant,
    /// Level at which each leak raises its alarm, L/min.
    alarm_lpm: PerLeak<f64>,
    minutes: VecDeque<Minute>,
    /// Begin of each day that is over, s, and its mean flows, L/min.
    days: Vec<(f64, PerLeak<f64>)>,
}

#[derive(Debug)]
struct Minute {
    begun: Instant,
    sums_lpm: PerLeak<f64>,
    count: u32,
}

/// A cylinder as the page shows it.
#[derive(Serialize)]
struct Line<'a> {
    name: &'a str,
    silent_s: Option<u64>,
    alarm_lpm: PerLeak<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    estimate: Option<&'a EstimateEvent>,
}

/// Its past, oldest first.
#[derive(Serialize)]
struct Past {
    /// Minutes ago, and the flows of each leak, L/min.
    hour: Vec<(u64, [f64; 3])>,
    /// Begin, s, and the same.
    days: Vec<(f64, [f64; 3])>,
}

impl Board {
    pub fn new(silent_after: Duration) -> Self {
        Self { silent_after, cards: Mutex::default() }
    }

    fn cards(&self) -> MutexGuard<'_, BTreeMap<String, Card>> {
        self.cards.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for these from now on, if it did not before, and forgets all others; gives the alarm levels of each, m³/s, and
    /// its days.
    pub fn expect<'a>(
        &self,
        watched: impl IntoIterator<Item = (&'a str, PerLeak<f64>, Vec<(f64, PerLeak<f64>)>)>,
    ) {
        let mut cards = self.cards();
        let mut before = std::mem::take(&mut *cards);
        for (name, alarm_lpm, days) in watched {
            let new = || Card {
                estimate: None,
                heard: Instant::now(),
                alarm_lpm,
                minutes: VecDeque::new(),
                days: Vec::new(),
            };
            let card = before.remove(name).unwrap_or_else(new);
            cards.insert(name.to_owned(), Card { alarm_lpm, days, ..card });
        }
    }

    /// Whether it waits for a cylinder.
    pub fn expects(&self, cylinder: &str) -> bool {
        self.cards().contains_key(cylinder)
    }

    /// Shows what is known now.
    pub fn show(&self, estimate: &EstimateEvent) {
        if let Some(card) = self.cards().get_mut(&estimate.cylinder) {
            card.show(estimate, Instant::now());
        }
    }

    /// Days that are over.
    pub fn show_days(&self, cylinder: &str, days: Vec<(f64, PerLeak<f64>)>) {
        if let Some(card) = self.cards().get_mut(cylinder) {
            card.days = days;
        }
    }

    /// Cylinders of which nothing comes; none where something comes of all.
    pub fn silent(&self) -> Option<String> {
        let cards = self.cards();
        let silent = cards.iter().filter(|(_, card)| self.is_silent(card));
        let count = silent.clone().count();
        let named =
            silent.take(NAMED).map(|(name, card)| format!("{name} for {} s", card.heard.elapsed().as_secs()));
        let more = if count > NAMED { format!(", and {} more", count - NAMED) } else { String::new() };
        (count > 0).then(|| format!("silent: {}{more}", named.collect::<Vec<_>>().join(", ")))
    }

    fn is_silent(&self, card: &Card) -> bool {
        card.heard.elapsed() >= self.silent_after
    }

    /// All cylinders as JSON, with what is wrong with the service itself.
    pub fn lines(&self, trouble: Option<&str>) -> String {
        let cards = self.cards();
        let mut cylinders = Vec::new();
        for (name, card) in cards.iter() {
            let silent_s = self.is_silent(card).then(|| card.heard.elapsed().as_secs());
            let (alarm_lpm, estimate) = (card.alarm_lpm, card.estimate.as_ref());
            cylinders.push(Line { name, silent_s, alarm_lpm, estimate });
        }
        serde_json::json!({ "trouble": trouble, "cylinders": cylinders }).to_string()
    }

    /// The last hour and the last days of each, as JSON.
    pub fn pasts(&self) -> String {
        let cards = self.cards();
        let pasts: BTreeMap<_, _> = cards.iter().map(|(name, card)| (name, card.past())).collect();
        serde_json::to_string(&pasts).unwrap_or_default()
    }
}

impl Card {
    fn show(&mut self, estimate: &EstimateEvent, now: Instant) {
        self.heard = now;
        self.estimate = Some(estimate.clone());
        if self.minutes.back().is_none_or(|minute| now.duration_since(minute.begun) >= MINUTE) {
            let oldest = self.minutes.len() == MINUTES;
            self.minutes.drain(..usize::from(oldest));
            self.minutes.push_back(Minute { begun: now, sums_lpm: PerLeak::default(), count: 0 });
        }
        if let Some(minute) = self.minutes.back_mut() {
            minute.count += 1;
            Leak::ALL.into_iter().for_each(|leak| minute.sums_lpm[leak] += estimate.leakage[leak].mean_lpm);
        }
    }

    fn past(&self) -> Past {
        let each =
            |flows: &PerLeak<f64>, of: f64| Leak::ALL.map(|leak| (1e4 * flows[leak] / of).round() / 1e4);
        let ago = |minute: &Minute| minute.begun.elapsed().as_secs() / 60;
        let hour =
            self.minutes.iter().map(|minute| (ago(minute), each(&minute.sums_lpm, minute.count.into())));
        let days = self.days.iter().map(|(begin_s, flows)| (*begin_s, each(flows, 1.0)));
        Past { hour: hour.filter(|(ago, _)| *ago < MINUTES as u64).collect(), days: days.collect() }
    }
}

/// As Prometheus scrapes it.
impl Collector for Board {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let cards = self.cards();
        let told = || cards.iter().filter_map(|(name, card)| Some((name.as_str(), card.estimate.as_ref()?)));
        let leaks = || told().flat_map(|(name, told)| Leak::ALL.map(|leak| (name, leak, told)));

        let of_leaks = |value: fn(&EstimateEvent, Leak) -> f64| {
            leaks()
                .map(move |(name, leak, told)| ([("cylinder", name), ("leak", leak.id())], value(told, leak)))
        };
        let mean = of_leaks(|told, leak| told.leakage[leak].mean_lpm);
        gauges(&mut encoder, "leak_lpm", "Mean flow of a leak, L/min", mean)?;
        let std = of_leaks(|told, leak| told.leakage[leak].std_lpm.unwrap_or(f64::NAN));
        gauges(&mut encoder, "leak_std_lpm", "Standard deviation of its error, L/min", std)?;
        let stands = leaks().map(|(name, leak, told)| {
            ([("cylinder", name), ("leak", leak.id())], i64::from(told.faults.contains(&leak)))
        });
        gauges(&mut encoder, "alarm", "1 while the alarm of a leak stands", stands)?;
        let each = told().flat_map(|(name, told)| {
            [Status::Leak, Status::Sound, Status::Doubtful, Status::NotSure].map(|status| {
                ([("cylinder", name), ("status", status.id())], i64::from(told.status == status))
            })
        });
        gauges(&mut encoder, "status", "1 for the status that a cylinder has", each)?;
        let help = "Time since the last estimate of a cylinder, or since the service waits for one, s";
        let silent = cards
            .iter()
            .map(|(name, card)| ([("cylinder", name.as_str())], card.heard.elapsed().as_secs_f64()));
        gauges(&mut encoder, "silent_seconds", help, silent)
    }
}

/// A family of gauges: each with its labels.
fn gauges<L: EncodeLabelSet, V>(
    encoder: &mut DescriptorEncoder<'_>,
    name: &str,
    help: &str,
    values: impl Iterator<Item = (L, V)>,
) -> fmt::Result
where
    ConstGauge<V>: EncodeMetric,
{
    let mut family = encoder.encode_descriptor(name, help, None, MetricType::Gauge)?;
    for (labels, value) in values {
        ConstGauge::new(value).encode(family.encode_family(&labels)?)?;
    }
    Ok(())
}
