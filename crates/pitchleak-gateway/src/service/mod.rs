//! The service: samples in, estimates and alarms out, acknowledged once they are on the disk.

use crate::broker::{Broker, Delivery, Inbound, Keeping, Message, Ticket};
use crate::config::Samples;
use crate::input::Input;
use crate::log::{Level, Log};
use crate::metrics::Metrics;
use crate::pace::{Due, Pace};
use crate::probe::Limits;
use crate::saver::{Job, Saved};
use crate::topics;
use pitchleak::live::{Batch, Event, OutputFormat, Snapshot, SummaryEvent, Watch};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

/// Alarms that the broker does not have, at most.
const MOST_UNSENT: usize = 10_000;
/// Hours and days that could not be written, at most.
const MOST_UNWRITTEN: usize = 10_000;
/// Between two accounts of what belongs to no cylinder.
const ACCOUNT: Duration = Duration::from_secs(60);

pub struct Service<B> {
    pub watch: Watch,
    pub broker: B,
    pub jobs: SyncSender<Job>,
    pub samples: Vec<Samples>,
    pub base: String,
    pub pace: Pace,
    pub metrics: Arc<Metrics>,
    pub log: Arc<Log>,
    pub waiting: Waiting,
}

/// What waits for something.
#[derive(Default)]
pub struct Waiting {
    /// Deliveries, for a checkpoint.
    tickets: Vec<Ticket>,
    /// Alarms, for the broker's word that it has them.
    alarms: BTreeMap<u64, Message>,
    /// Number of the next alarm.
    next: u64,
    /// Hours and days, for the disk.
    summaries: Vec<SummaryEvent>,
    /// A checkpoint is being written.
    saving: bool,
    /// Something came since the last one.
    changed: bool,
    accounted: Option<Instant>,
}

impl<B: Broker> Service<B> {
    /// Sends what a run before could not.
    pub fn resend(&mut self, unsent: Vec<String>) {
        for line in unsent {
            if let Some((topic, payload)) = line.split_once('\n') {
                self.publish_each(topic.to_owned(), payload.to_owned());
            }
        }
    }

    /// Takes in what came; says whether it goes on.
    pub fn take(&mut self, input: Input) -> bool {
        match input {
            Input::Broker(Inbound::Up { session_kept }) => self.up(session_kept),
            Input::Broker(Inbound::Down(why)) => self.down(&why),
            Input::Broker(Inbound::Delivery(delivery)) => self.deliver(&delivery),
            Input::Broker(Inbound::Confirmed(number)) => {
                self.waiting.alarms.remove(&number);
            }
            Input::Broker(Inbound::Limits(limits)) => self.limits(limits),
            Input::Saved(saved) => self.saved(saved),
            Input::Stop => return false,
        }
        true
    }

    fn up(&mut self, session_kept: bool) {
        self.metrics.connected.store(true, Relaxed);
        let session = if session_kept { "goes on" } else { "is new" };
        self.log.say(Level::Info, "broker", &format!("connected; the session {session}"));
        self.broker.publish(status(&self.base, "online"));
    }

    fn down(&mut self, why: &str) {
        self.metrics.connected.store(false, Relaxed);
        self.log.say(Level::Warning, "no_broker", why);
        // They will come again.
        self.waiting.tickets.clear();
    }

    fn limits(&mut self, limits: Result<Limits, String>) {
        let Limits { given, kept, in_flight } = match limits {
            Ok(limits) => limits,
            Err(why) => {
                self.log.say(Level::Warning, "broker_limits", &format!("cannot be found out: {why}"));
                return;
            }
        };
        self.metrics.broker_keeps.store(kept as u64, Relaxed);
        self.metrics.broker_sends.store(in_flight as u64, Relaxed);
        if kept < given {
            let text = format!(
                "the broker keeps {kept} messages while nobody takes them, and not {given} (broker.queued): what is beyond is \
                 lost: raise its limit (Mosquitto: max_queued_messages)"
            );
            self.log.say(Level::Warning, "broker_limits", &text);
        } else {
            let text =
                format!("the broker keeps {kept} messages or more, and sends {in_flight} before it waits");
            self.log.say(Level::Info, "broker_limits", &text);
        }
        if in_flight < given && self.pace.learn(in_flight) {
            self.broker_waits_after(in_flight);
        }
    }

    fn broker_waits_after(&self, count: usize) {
        let text = format!(
            "the broker waits after {count} unacknowledged messages, so that each so many cost a checkpoint: raise its \
             limit (Mosquitto: max_inflight_messages) and broker.in_flight"
        );
        self.log.say(Level::Warning, "in_flight", &text);
    }

    fn deliver(&mut self, delivery: &Delivery) {
        self.metrics.messages.fetch_add(1, Relaxed);
        self.pace.delivered(Instant::now());
        self.waiting.tickets.extend(delivery.ticket);
        self.waiting.changed = true;
        let mut events = Vec::new();
        let found = self.samples.iter().find_map(|samples| {
            Some((topics::cylinder_of(&samples.topic, &delivery.topic)?, samples.format))
        });
        match (&delivery.payload, found) {
            (Ok(payload), Some((cylinder, format))) => {
                self.metrics.bytes.fetch_add(payload.len() as u64, Relaxed);
                let batch = Batch { cylinder: &cylinder, format, payload, resent: delivery.resent };
                self.watch.take_batch(&batch, &mut events);
            }
            (Ok(_), None) => self.watch.notice("unknown_topic", shown(&delivery.topic), &mut events),
            (Err(size), _) => {
                let text = format!("{size} bytes from {}", shown(&delivery.topic));
                self.watch.notice("too_large", text, &mut events);
            }
        }
        let told = events.iter().any(|event| matches!(event, Event::Estimate(_)));
        self.tell(events);
        if told {
            self.metrics.latency(delivery.received.elapsed());
        }
    }

    /// What is to be done once in a while.
    pub fn tick(&mut self, now: Instant) {
        self.metrics.turn();
        self.metrics.cylinders.store(self.watch.cylinders() as u64, Relaxed);
        self.metrics.unacknowledged.store(self.waiting.tickets.len() as u64, Relaxed);
        self.metrics.unsent_alarms.store(self.waiting.alarms.len() as u64, Relaxed);
        let accounted = *self.waiting.accounted.get_or_insert(now);
        if now.duration_since(accounted) >= ACCOUNT {
            self.waiting.accounted = Some(now);
            let mut events = Vec::new();
            self.watch.tell_counted(&mut events);
            self.tell(events);
        }
        if self.waiting.saving {
            return;
        }
        match self.pace.due(now, self.waiting.tickets.len()) {
            Due::NotYet => return,
            Due::Now => {}
            Due::NowThatBrokerWaits(count) => self.broker_waits_after(count),
        }
        self.save();
    }

    /// Has a checkpoint written; without anything new, too: that the disk takes one is a sign of health.
    pub fn save(&mut self) {
        let unsent = self.waiting.alarms.values().map(|alarm| format!("{}\n{}", alarm.topic, alarm.payload));
        let job = Job {
            snapshot: Snapshot::of(&self.watch).with_unsent(unsent.collect()),
            summaries: std::mem::take(&mut self.waiting.summaries),
            tickets: std::mem::take(&mut self.waiting.tickets),
        };
        self.waiting.saving = true;
        self.waiting.changed = false;
        // The saver is idle: it has room for one.
        let _ = self.jobs.send(job);
    }

    /// Whether a checkpoint is being written.
    pub fn is_saving(&self) -> bool {
        self.waiting.saving
    }

    fn saved(&mut self, saved: Saved) {
        self.waiting.saving = false;
        match saved.result {
            Ok(bytes) => {
                self.metrics.saved(bytes, saved.took);
                self.broker.acknowledge(saved.tickets);
                self.pace.acknowledged(Instant::now());
            }
            Err(why) => {
                self.metrics.not_saved();
                self.pace.failed();
                self.log.say(Level::Warning, "checkpoint", &why);
                // In the order in which they came.
                let later = std::mem::replace(&mut self.waiting.tickets, saved.tickets);
                self.waiting.tickets.extend(later);
                let later = std::mem::replace(&mut self.waiting.summaries, saved.summaries);
                self.waiting.summaries.extend(later);
                self.waiting.summaries.truncate(MOST_UNWRITTEN);
            }
        }
    }

    fn tell(&mut self, events: Vec<Event>) {
        for event in events {
            let Ok(payload) = event.line(OutputFormat::Ndjson) else { continue };
            let topic = |cylinder: &str, kind: &str| topics::of_cylinder(&self.base, cylinder, kind);
            let (topic, keeping) = match event {
                Event::Alarm(alarm) => {
                    self.metrics.alarms.fetch_add(1, Relaxed);
                    self.log.say(Level::Info, "alarm", &alarm.id);
                    let topic = topic(&alarm.cylinder, "alarm");
                    self.publish_each(topic, payload);
                    continue;
                }
                Event::Estimate(estimate) => {
                    self.metrics.estimates.fetch_add(1, Relaxed);
                    (topic(&estimate.cylinder, "estimate"), Keeping::Latest)
                }
                Event::Notice(notice) => {
                    self.metrics.left_out(&notice.kind, notice.count);
                    let cylinder = &notice.cylinder;
                    let text = format!("{cylinder} {} times, the first: {}", notice.count, notice.text);
                    self.log.say(Level::Warning, &notice.kind, text.trim_start());
                    (topic(cylinder, &format!("notice/{}", notice.kind)), Keeping::Latest)
                }
                Event::Summary(summary) => {
                    let topic = topic(&summary.cylinder, summary.span.id());
                    if self.waiting.summaries.len() < MOST_UNWRITTEN {
                        self.waiting.summaries.push(summary);
                    }
                    (topic, Keeping::Latest)
                }
            };
            self.broker.publish(Message { topic, payload, keeping });
        }
    }

    fn publish_each(&mut self, topic: String, payload: String) {
        let number = self.waiting.next;
        self.waiting.next += 1;
        let alarm = Message { topic, payload, keeping: Keeping::Each(number) };
        self.broker.publish(alarm.clone());
        self.waiting.alarms.insert(number, alarm);
        if self.waiting.alarms.len() > MOST_UNSENT {
            self.waiting.alarms.pop_first();
            self.metrics.left_out("alarm", 1);
        }
    }

    /// Whether samples came since the last checkpoint was asked for.
    pub fn has_changed(&self) -> bool {
        self.waiting.changed
    }
}

/// What the broker keeps for whoever asks whether the service runs.
pub fn status(base: &str, word: &str) -> Message {
    let payload = format!("{{\"type\":\"status\",\"state\":\"{word}\"}}");
    Message { topic: topics::of_cylinder(base, "", "status"), payload, keeping: Keeping::Latest }
}

/// Its begin, in signs that a terminal shows and does not obey.
fn shown(topic: &str) -> String {
    topic.chars().take(80).flat_map(char::escape_debug).collect()
}

#[cfg(test)]
mod tests;
