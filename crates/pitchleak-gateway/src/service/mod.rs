//! The service: samples in, estimates and alarms out, acknowledged once they are on the disk.

use crate::alarms::Alarms;
use crate::broker::{DeadLetters, Delivery, Inbound, Keeping, Message, Outbox, Ticket};
use crate::config::{Config, Samples};
use crate::log::{Level, Log};
use crate::metrics::Metrics;
use crate::run::Input;
use crate::saver::{Due, Job, Pace, Saved};
use crate::topics;
use pitchleak::Rig;
use pitchleak::live::{
    Batch, Checkpoint, CheckpointError, Event, OutputFormat, Snapshot, Span, SummaryEvent, Watch,
};
use pitchleak::units::LPM_PER_M3S;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

/// Hours and days that could not be written, at most.
const MOST_UNWRITTEN: usize = 10_000;
/// Between two counts for the metrics.
const COUNT: Duration = Duration::from_millis(200);
/// Between two accounts of what was left out and not said.
const ACCOUNT: Duration = Duration::from_secs(60);

pub struct Service {
    pub watch: Watch,
    /// What goes to the broker.
    pub outbox: Arc<Outbox>,
    pub jobs: SyncSender<Job>,
    /// From which a cylinder that is watched again goes on.
    pub checkpoint: Arc<Checkpoint>,
    pub alarms: Alarms,
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
    /// Hours and days, for the disk.
    summaries: Vec<SummaryEvent>,
    /// A checkpoint is being written.
    pub saving: bool,
    /// Something came since the last one was asked for.
    pub changed: bool,
    /// A configuration, for the checkpoint that is being written.
    config: Option<Box<Config>>,
    counted: Option<Instant>,
    accounted: Option<Instant>,
    dead_letters: DeadLetters,
}

impl Service {
    /// Goes on from the checkpoint, says what is wrong with it, and sends what a run before could not.
    pub fn begin(&mut self) -> Result<(), CheckpointError> {
        self.restore()?;
        self.alarms.unsent().into_iter().for_each(|alarm| self.outbox.put(alarm));
        Ok(())
    }

    /// Each cylinder that is watched and not known yet goes on from its state.
    fn restore(&mut self) -> Result<(), CheckpointError> {
        let notices = self.checkpoint.restore(&mut self.watch)?;
        self.tell(notices.into_iter().map(Event::Notice).collect());
        self.expect();
        Ok(())
    }

    /// Who looks is told of all cylinders that there are or ought to be.
    fn expect(&self) {
        let config = self.watch.config();
        let names = config.cylinders.keys().map(String::as_str).chain(self.watch.names());
        let level = |name: &str| {
            let level = |rig: &Rig| rig.alarms.threshold_m3s.map(|level_m3s| level_m3s * LPM_PER_M3S);
            config.rig_of(name).map(level).unwrap_or_default()
        };
        self.metrics.board.expect(names.map(|name| (name, level(name), self.watch.days(name))));
    }

    /// Goes on by another configuration, as far as that can be done without a start, once no checkpoint is being written.
    pub fn reload(&mut self, config: Box<Config>) {
        if self.waiting.saving {
            self.waiting.config = Some(config);
            return;
        }
        let mut events = Vec::new();
        self.pace.set_every(config.checkpoint);
        self.watch.reload(config.watch, &mut events);
        self.tell(events);
        if let Err(error) = self.restore() {
            self.log.say(Level::Warning, "checkpoint", &error.to_string());
        }
        self.waiting.changed = true;
        self.log.say(Level::Info, "reload", "goes on by the new configuration");
    }

    /// Takes in what came; says whether it goes on.
    pub fn take(&mut self, input: Input) -> bool {
        match input {
            Input::Broker(Inbound::Up { session_kept }) => self.up(session_kept),
            Input::Broker(Inbound::Down(why)) => self.down(&why),
            Input::Broker(Inbound::Delivery(delivery)) => self.deliver(&delivery),
            Input::Broker(Inbound::Confirmed(number)) => {
                self.alarms.sent(number);
                self.write_alarms();
            }
            Input::Saved(saved) => self.saved(*saved),
            Input::Stop | Input::Reload => return false,
        }
        true
    }

    fn up(&mut self, session_kept: bool) {
        self.metrics.connected.set(1);
        let session = if session_kept { "goes on" } else { "is new" };
        self.log.say(Level::Info, "broker", &format!("connected; the session {session}"));
        self.outbox.put(status(&self.base, "online"));
    }

    fn down(&mut self, why: &str) {
        self.metrics.connected.set(0);
        self.log.say(Level::Warning, "no_broker", why);
        // They will come again.
        self.waiting.tickets.clear();
    }

    fn broker_waits_after(&self, count: usize) {
        let text = format!(
            "the broker waits after {count} unacknowledged messages, so that each so many cost a checkpoint, at most one a \
             second: raise its limit"
        );
        self.log.say(Level::Warning, "in_flight", &text);
    }

    fn deliver(&mut self, delivery: &Delivery) {
        self.metrics.messages.inc();
        self.pace.delivered(Instant::now());
        self.waiting.tickets.extend(delivery.ticket);
        self.waiting.changed = true;
        let mut events = Vec::new();
        let found = self.samples.iter().find_map(|samples| {
            Some((topics::cylinder_of(&samples.topic, &delivery.topic)?, samples.format))
        });
        let dead = match (&delivery.payload, found) {
            (Ok(payload), Some((cylinder, format))) => {
                self.metrics.bytes.inc_by(payload.len() as u64);
                let batch = Batch { cylinder: &cylinder, format, payload, resent: delivery.resent };
                self.watch.take_batch(&batch, &mut events).map(|why| ("unreadable", why))
            }
            (Ok(_), None) => {
                self.watch.notice("unknown_topic", shown(&delivery.topic), &mut events);
                Some(("unknown_topic", "no [[samples]] takes it in".to_owned()))
            }
            (Err(size), _) => {
                let text = format!("{size} bytes from {}", shown(&delivery.topic));
                self.watch.notice("too_large", text, &mut events);
                Some(("too_large", format!("{size} bytes")))
            }
        };
        if let Some((kind, why)) = dead {
            let letter = self.waiting.dead_letters.letter(&self.base, delivery, kind, &why, Instant::now());
            letter.into_iter().for_each(|letter| self.outbox.put(letter));
        }
        let told = events.iter().any(|event| matches!(event, Event::Estimate(_)));
        self.tell(events);
        if told {
            self.metrics.latency.observe(delivery.received.elapsed().as_secs_f64());
        }
    }

    /// What is to be done once in a while.
    pub fn tick(&mut self, now: Instant) {
        self.metrics.turn();
        if self.waiting.counted.is_none_or(|counted| now.duration_since(counted) >= COUNT) {
            self.waiting.counted = Some(now);
            let count = |count: usize| i64::try_from(count).unwrap_or(i64::MAX);
            self.metrics.cylinders.set(count(self.watch.cylinders()));
            self.metrics.unacknowledged.set(count(self.waiting.tickets.len()));
            self.metrics.unsent_alarms.set(count(self.alarms.waiting()));
            self.metrics.left_out_in_all(self.watch.left_out());
        }
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

    /// Has a checkpoint written, of what changed.
    pub fn save(&mut self) {
        let raised = self.alarms.raised();
        let job = Job {
            alarms: self.alarms.unwritten(),
            snapshot: Some(Snapshot::of(&mut self.watch)),
            summaries: std::mem::take(&mut self.waiting.summaries),
            tickets: std::mem::take(&mut self.waiting.tickets),
            raised,
        };
        self.waiting.changed = false;
        self.hand_over(job);
    }

    /// Has what became of alarms written at once: after a kill they would be sent again.
    fn write_alarms(&mut self) {
        if self.waiting.saving {
            return;
        }
        if let Some(alarms) = self.alarms.unwritten() {
            self.hand_over(Job { alarms: Some(alarms), ..Job::default() });
        }
    }

    fn hand_over(&mut self, job: Job) {
        self.waiting.saving = true;
        // The saver is idle: it has room for one.
        let _ = self.jobs.send(job);
    }

    fn saved(&mut self, saved: Saved) {
        self.waiting.saving = false;
        let Saved { result, took, job } = saved;
        match result {
            Ok(None) => self.write_alarms(),
            Ok(Some(bytes)) => {
                self.metrics.saved(bytes, took);
                self.alarms.settle(&job.raised);
                self.outbox.acknowledge(job.tickets);
                self.pace.acknowledged(Instant::now());
                self.write_alarms();
            }
            Err(why) => {
                self.metrics.not_saved();
                self.pace.failed();
                self.log.say(Level::Warning, "checkpoint", &why);
                self.take_back(job);
            }
        }
        if let Some(config) = self.waiting.config.take() {
            self.reload(config);
        }
    }

    /// What could not be written goes into the next job, in the order in which it came.
    fn take_back(&mut self, job: Job) {
        if job.alarms.is_some() {
            self.alarms.not_written();
        }
        if let Some(snapshot) = job.snapshot {
            self.waiting.changed = true;
            snapshot.give_back(&mut self.watch);
        }
        let later = std::mem::replace(&mut self.waiting.tickets, job.tickets);
        self.waiting.tickets.extend(later);
        let later = std::mem::replace(&mut self.waiting.summaries, job.summaries);
        self.waiting.summaries.extend(later);
        self.waiting.summaries.truncate(MOST_UNWRITTEN);
    }

    fn tell(&mut self, events: Vec<Event>) {
        for event in events {
            let Ok(payload) = event.line(OutputFormat::Ndjson) else { continue };
            let topic = |cylinder: &str, kind: &str| topics::of_cylinder(&self.base, cylinder, kind);
            let (topic, keeping) = match event {
                Event::Alarm(alarm) => {
                    self.metrics.alarms.inc();
                    self.log.say(Level::Info, "alarm", &alarm.id);
                    let topic = topic(&alarm.cylinder, "alarm");
                    let (message, lost) = self.alarms.raise(&alarm.id, &alarm.cylinder, topic, payload);
                    if lost {
                        self.metrics.left_out("alarm", 1);
                    }
                    message.into_iter().for_each(|message| self.outbox.put(message));
                    continue;
                }
                Event::Estimate(estimate) => {
                    self.metrics.estimates.inc();
                    if !self.metrics.board.expects(&estimate.cylinder) {
                        self.expect();
                    }
                    self.metrics.board.show(&estimate);
                    (topic(&estimate.cylinder, "estimate"), Keeping::Latest)
                }
                Event::Notice(notice) => {
                    let cylinder = &notice.cylinder;
                    if notice.kind == "clock_set_back" {
                        self.alarms.forget_sent(cylinder);
                    }
                    let text = format!("{cylinder} {} times, the first: {}", notice.count, notice.text);
                    self.log.say(Level::Warning, &notice.kind, text.trim_start());
                    (topic(cylinder, &format!("notice/{}", notice.kind)), Keeping::Latest)
                }
                Event::Hold(hold) => {
                    self.log.say(Level::Info, "hold", &format!("{} {}", hold.cylinder, hold.text));
                    (topic(&hold.cylinder, "hold"), Keeping::Latest)
                }
                Event::Summary(summary) => {
                    let topic = topic(&summary.cylinder, summary.span.id());
                    if summary.span == Span::Day {
                        let days = self.watch.days(&summary.cylinder);
                        self.metrics.board.show_days(&summary.cylinder, days);
                    }
                    if self.waiting.summaries.len() < MOST_UNWRITTEN {
                        self.waiting.summaries.push(summary);
                    }
                    (topic, Keeping::Latest)
                }
            };
            self.outbox.put(Message { topic, payload, keeping });
        }
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
