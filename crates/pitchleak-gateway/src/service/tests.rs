//! The service without a network and without a disk of its own thread.

use super::*;
use pitchleak::Rig;
use pitchleak::live::{BatchFormat, LiveConfig};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, sync_channel};

/// Remembers what it is told.
#[derive(Clone, Default)]
struct Fake {
    published: Arc<Mutex<Vec<Message>>>,
    acknowledged: Arc<Mutex<Vec<Ticket>>>,
}

impl Broker for Fake {
    fn publish(&self, message: Message) {
        self.published.lock().expect("no panic").push(message);
    }

    fn send(&self) {}

    fn acknowledge(&self, tickets: Vec<Ticket>) {
        self.acknowledged.lock().expect("no panic").extend(tickets);
    }

    fn close(self, _: Duration) {}
}

fn service() -> (Service<Fake>, Fake, Receiver<Job>) {
    let broker = Fake::default();
    let (jobs, queue) = sync_channel(1);
    let service = Service {
        watch: Watch::new(LiveConfig::of(Rig::paper()), None),
        broker: broker.clone(),
        jobs,
        samples: vec![Samples { topic: "pitch/+/samples".to_owned(), format: BatchFormat::Json }],
        base: "pitchleak".to_owned(),
        pace: Pace::new(Duration::from_secs(10), 20, Instant::now()),
        metrics: Arc::new(Metrics::new()),
        log: Arc::default(),
        waiting: Waiting::default(),
    };
    (service, broker, queue)
}

fn ticket(id: u16) -> Ticket {
    Ticket { connection: 0, id }
}

fn delivery(topic: &str, payload: Result<&str, usize>, id: u16) -> Input {
    Input::Broker(Inbound::Delivery(Delivery {
        topic: topic.to_owned(),
        payload: payload.map(|text| text.as_bytes().to_vec()),
        resent: false,
        ticket: Some(ticket(id)),
        received: Instant::now(),
    }))
}

/// A second of samples of a rig with a leak, from `from_s`.
fn samples(from_s: u32) -> String {
    let sample = |k: u32| {
        let t_s = f64::from(from_s) + f64::from(k) * 0.01;
        let x_mm = 100.0 + 30.0 * (6.0 * t_s).sin();
        let v_mps = 0.18 * (6.0 * t_s).cos();
        let (pa, pb) = (80.0 + 20.0 * (2.0 * t_s).sin(), 30.0 + 10.0 * (3.0 * t_s).cos());
        // Areas of the built-in rig; 0.06 L/min a bar past the piston.
        let leak = 0.06 * (pa - pb);
        let (qa, qb) = (v_mps * 12.6e-4 * 6e4 + leak, -v_mps * 9.4e-4 * 6e4 - leak);
        format!(
            "{{\"t_s\":{t_s},\"x_mm\":{x_mm},\"pa_bar\":{pa},\"pb_bar\":{pb},\"qa_lpm\":{qa},\"qb_lpm\":{qb}}}"
        )
    };
    format!("[{}]", (0..100).map(sample).collect::<Vec<_>>().join(","))
}

fn saved(job: Job, result: Result<usize, String>) -> Input {
    let Job { tickets, summaries, .. } = job;
    Input::Saved(Saved { result, took: Duration::ZERO, tickets, summaries })
}

#[test]
fn a_message_is_acknowledged_once_a_checkpoint_holds_it_and_not_before() {
    let (mut service, broker, queue) = service();
    let acknowledged = || broker.acknowledged.lock().expect("no panic").clone();
    service.take(delivery("pitch/B1/samples", Ok(&samples(0)), 1));
    service.save();
    let first = queue.recv().expect("a job");
    service.take(delivery("pitch/B1/samples", Ok(&samples(1)), 2));
    assert_eq!(acknowledged(), []);
    service.take(saved(first, Err("disk full".to_owned())));
    assert_eq!(acknowledged(), []);
    service.save();
    service.take(delivery("pitch/B1/samples", Ok(&samples(2)), 3));
    service.take(saved(queue.recv().expect("a job"), Ok(1000)));
    assert_eq!(acknowledged(), [ticket(1), ticket(2)]);
}

#[test]
fn what_came_over_a_connection_that_is_gone_is_not_acknowledged_over_the_next() {
    let (mut service, broker, queue) = service();
    service.take(delivery("pitch/B1/samples", Ok(&samples(0)), 1));
    service.take(Input::Broker(Inbound::Down("gone".to_owned())));
    service.save();
    service.take(saved(queue.recv().expect("a job"), Ok(1000)));
    assert!(broker.acknowledged.lock().expect("no panic").is_empty());
}

#[test]
fn an_alarm_stays_in_the_checkpoints_until_the_broker_has_it() {
    let (mut service, broker, _queue) = service();
    (0..5).for_each(|s| _ = service.take(delivery("pitch/B1/samples", Ok(&samples(s)), 1)));
    let published = broker.published.lock().expect("no panic").clone();
    let alarms: Vec<_> = published.iter().filter(|message| message.topic == "pitchleak/B1/alarm").collect();
    let [alarm, ..] = alarms.as_slice() else { panic!("{published:?}") };
    assert_eq!(service.waiting.alarms.len(), alarms.len());
    // The next run sends it again.
    let (mut next, its_broker, _) = self::service();
    next.resend(vec![format!("{}\n{}", alarm.topic, alarm.payload)]);
    let again = its_broker.published.lock().expect("no panic").clone();
    assert_eq!((&again[0].topic, &again[0].payload), (&alarm.topic, &alarm.payload));
    let Keeping::Each(number) = alarm.keeping else { panic!("{alarm:?}") };
    service.take(Input::Broker(Inbound::Confirmed(number)));
    assert_eq!(service.waiting.alarms.len(), alarms.len() - 1);
}

#[test]
fn what_is_of_no_use_is_acknowledged_too_or_it_would_come_for_ever() {
    let (mut service, broker, queue) = service();
    service.take(delivery("pitch/B1/samples", Err(100_000_000), 1));
    service.take(delivery("elsewhere", Ok("[]"), 2));
    service.take(delivery("pitch/B1/samples", Ok("{{{"), 3));
    service.save();
    service.take(saved(queue.recv().expect("a job"), Ok(1000)));
    assert_eq!(broker.acknowledged.lock().expect("no panic").len(), 3);
    let text = service.metrics.text();
    for kind in ["too_large", "unknown_topic", "unreadable"] {
        assert!(text.contains(&format!("kind=\"{kind}\"")), "{kind} in {text}");
    }
}

/// A terminal that shows the log or a notice obeys nothing that stands in a topic.
#[test]
fn control_characters_of_a_topic_are_told_escaped() {
    let (mut service, broker, _queue) = service();
    service.take(delivery("else\nwhere\u{1b}[31m\u{2028}é", Ok("[]"), 1));
    service.take(delivery("pitch/a\rb/samples", Err(100_000_000), 2));
    let published = broker.published.lock().expect("no panic");
    let texts = published.iter().map(|message| {
        let notice: serde_json::Value = serde_json::from_str(&message.payload).expect("JSON");
        notice["text"].as_str().expect("a text").to_owned()
    });
    let texts: Vec<_> = texts.collect();
    assert_eq!(
        texts,
        [r"line 0: else\nwhere\u{1b}[31m\u{2028}é", r"line 0: 100000000 bytes from pitch/a\rb/samples"]
    );
}

#[test]
fn what_the_broker_keeps_and_sends_is_told_and_kept_to() {
    let (mut service, _, queue) = service();
    service.take(Input::Broker(Inbound::Limits(Ok(Limits { given: 500, kept: 200, in_flight: 12 }))));
    assert!(service.metrics.text().contains("\npitchleak_broker_keeps 200\n"));
    (0..11).for_each(|id| _ = service.take(delivery("pitch/B1/samples", Ok("[]"), id)));
    service.tick(Instant::now());
    assert!(queue.try_recv().is_err());
    service.take(delivery("pitch/B1/samples", Ok("[]"), 11));
    service.tick(Instant::now());
    assert!(queue.try_recv().is_ok());
    // A broker that sends all that it keeps may send more.
    let (mut service, _, queue) = self::service();
    service.take(Input::Broker(Inbound::Limits(Ok(Limits { given: 5, kept: 5, in_flight: 5 }))));
    (0..5).for_each(|id| _ = service.take(delivery("pitch/B1/samples", Ok("[]"), id)));
    service.tick(Instant::now());
    assert!(queue.try_recv().is_err());
}

#[test]
fn a_broker_that_waits_gets_its_checkpoint_at_once() {
    let (mut service, _, queue) = service();
    service.tick(Instant::now());
    assert!(queue.try_recv().is_err());
    (0..20).for_each(|id| _ = service.take(delivery("pitch/B1/samples", Ok("[]"), id)));
    service.tick(Instant::now());
    assert_eq!(queue.try_recv().map(|job| job.tickets.len()), Ok(20));
    // One at a time.
    (0..20).for_each(|id| _ = service.take(delivery("pitch/B1/samples", Ok("[]"), id)));
    service.tick(Instant::now());
    assert!(queue.try_recv().is_err());
}
