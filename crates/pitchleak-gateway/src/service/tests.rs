//! The service without a network and without a disk of its own thread.

use super::*;
use crate::board::Board;
use crate::broker::Next;
use pitchleak::live::{BatchFormat, LiveConfig};
use std::cell::RefCell;
use std::sync::mpsc::{Receiver, sync_channel};

/// The network's end of the service's outbox, and the folder of its state.
struct Network {
    outbox: Arc<Outbox>,
    published: RefCell<Vec<Message>>,
    acknowledged: RefCell<Vec<Ticket>>,
    _folder: tempfile::TempDir,
}

impl Network {
    /// Takes all that waits.
    fn send(&self) {
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        self.outbox.close();
        loop {
            match runtime.block_on(self.outbox.next()) {
                Next::Acknowledge(ticket) => self.acknowledged.borrow_mut().push(ticket),
                Next::Publish(message) => self.published.borrow_mut().push(message),
                Next::Close => return,
            }
        }
    }

    fn published(&self) -> Vec<Message> {
        self.send();
        self.published.borrow().clone()
    }

    fn acknowledged(&self) -> Vec<Ticket> {
        self.send();
        self.acknowledged.borrow().clone()
    }
}

fn service() -> (Service, Network, Receiver<Job>) {
    let folder = tempfile::tempdir().expect("a folder");
    let outbox = Arc::new(Outbox::default());
    let (jobs, queue) = sync_channel(1);
    let service = Service {
        watch: Watch::new(LiveConfig::of(Rig::paper()), None),
        outbox: Arc::clone(&outbox),
        jobs,
        checkpoint: Arc::new(Checkpoint::new(folder.path()).expect("a folder")),
        alarms: Alarms::default(),
        samples: vec![Samples { topic: "pitch/+/samples".to_owned(), format: BatchFormat::Json }],
        base: "pitchleak".to_owned(),
        pace: Pace::new(Duration::from_secs(10), Some(20), Instant::now()),
        metrics: Arc::new(Metrics::new(Arc::new(Board::new(Duration::from_secs(60))))),
        log: Arc::default(),
        waiting: Waiting::default(),
    };
    let (published, acknowledged) = (RefCell::default(), RefCell::default());
    (service, Network { outbox, published, acknowledged, _folder: folder }, queue)
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

/// As the saver does it, on a disk that takes it or not.
fn saved(mut job: Job, takes_it: bool) -> Input {
    let result = match (takes_it, job.snapshot.is_some()) {
        (false, _) => Err("no room".to_owned()),
        (true, is_checkpoint) => Ok(is_checkpoint.then_some(1000)),
    };
    if takes_it {
        (job.snapshot, job.alarms) = (None, None);
        job.summaries.clear();
    }
    Input::Saved(Box::new(Saved { result, took: Duration::ZERO, job }))
}

#[test]
fn a_message_is_acknowledged_once_a_checkpoint_holds_it_and_not_before() {
    let (mut service, broker, queue) = service();
    let acknowledged = || broker.acknowledged();
    service.take(delivery("pitch/B1/samples", Ok(&samples(0)), 1));
    service.save();
    let first = queue.recv().expect("a job");
    service.take(delivery("pitch/B1/samples", Ok(&samples(1)), 2));
    assert_eq!(acknowledged(), []);
    service.take(saved(first, false));
    assert_eq!(acknowledged(), []);
    service.save();
    service.take(delivery("pitch/B1/samples", Ok(&samples(2)), 3));
    service.take(saved(queue.recv().expect("a job"), true));
    assert_eq!(acknowledged(), [ticket(1), ticket(2)]);
}

#[test]
fn what_came_over_a_connection_that_is_gone_is_not_acknowledged_over_the_next() {
    let (mut service, broker, queue) = service();
    service.take(delivery("pitch/B1/samples", Ok(&samples(0)), 1));
    service.take(Input::Broker(Inbound::Down("gone".to_owned())));
    service.save();
    service.take(saved(queue.recv().expect("a job"), true));
    assert!(broker.acknowledged().is_empty());
}

fn alarms(broker: &Network) -> Vec<Message> {
    let published = broker.published();
    published.into_iter().filter(|message| message.topic == "pitchleak/B1/alarm").collect()
}

#[test]
fn an_alarm_is_on_the_disk_until_the_broker_has_it_and_then_that_it_has() {
    let (mut service, broker, queue) = service();
    (0..5).for_each(|s| _ = service.take(delivery("pitch/B1/samples", Ok(&samples(s)), 1)));
    let [alarm] = alarms(&broker).try_into().expect("one alarm");
    assert_eq!(service.alarms.waiting(), 1);
    service.save();
    let job = queue.recv().expect("a job");
    let file = job.alarms.clone().expect("alarms");
    service.take(saved(job, true));
    // The next run sends it again.
    let (mut next, its_broker, _) = self::service();
    next.alarms = Alarms::parse(&file).expect("alarms");
    next.begin().expect("a folder");
    assert_eq!(alarms(&its_broker)[0].payload, alarm.payload);
    // That a checkpoint holds its samples is written, too.
    service.take(saved(queue.recv().expect("a job"), true));
    // Once the broker has it, the disk knows at once.
    let Keeping::Each(number) = alarm.keeping else { panic!("{alarm:?}") };
    service.take(Input::Broker(Inbound::Confirmed(number)));
    let job = queue.try_recv().expect("a job");
    assert_eq!((job.alarms.as_deref(), job.snapshot.is_none()), (Some("{}"), true));
}

/// Samples that no checkpoint holds come again after a kill; the alarm that they raised is with the broker.
#[test]
fn samples_that_come_again_send_no_alarm_twice() {
    let (mut service, broker, queue) = service();
    (0..5).for_each(|s| _ = service.take(delivery("pitch/B1/samples", Ok(&samples(s)), 1)));
    let Keeping::Each(number) = alarms(&broker)[0].keeping else { panic!("an alarm") };
    service.take(Input::Broker(Inbound::Confirmed(number)));
    let file = queue.try_recv().expect("a job").alarms.expect("alarms");
    let (mut next, its_broker, _) = self::service();
    next.alarms = Alarms::parse(&file).expect("alarms");
    next.begin().expect("a folder");
    (0..5).for_each(|s| _ = next.take(delivery("pitch/B1/samples", Ok(&samples(s)), 1)));
    assert_eq!(alarms(&its_broker), []);
}

#[test]
fn late_samples_are_counted_one_by_one() {
    let (mut service, _broker, _queue) = service();
    (0..21).for_each(|_| _ = service.take(delivery("pitch/B1/samples", Ok(&samples(0)), 1)));
    service.tick(Instant::now());
    let text = service.metrics.text();
    assert!(text.contains("pitchleak_left_out_total{kind=\"late\"} 2000\n"), "{text}");
}

#[test]
fn a_reload_waits_for_the_checkpoint_that_is_being_written_and_keeps_what_is_the_same() {
    let (mut service, broker, queue) = service();
    service.take(delivery("pitch/B1/samples", Ok(&samples(0)), 1));
    service.save();
    let job = queue.recv().expect("a job");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("gateway.toml");
    std::fs::write(folder.path().join("rig.toml"), Rig::paper().to_toml()).expect("a rig");
    let text = "state = 'state'\n[broker]\nhost = 'x'\n[[samples]]\ntopic = 'pitch/+'\nformat = 'json'\n\
                [watch.cylinders.B2]\nrig = 'rig.toml'\n";
    std::fs::write(&path, text).expect("a file");
    service.reload(Box::new(Config::load(&path).expect("a configuration")));
    assert_eq!(service.watch.cylinders(), 1);
    service.take(saved(job, true));
    assert_eq!(service.watch.cylinders(), 0);
    let published = broker.published();
    assert!(published.iter().any(|message| message.topic == "pitchleak/B1/notice/reload"), "{published:?}");
    assert!(service.metrics.text().contains("silent_seconds{cylinder=\"B2\"}"));
}

#[test]
fn what_is_of_no_use_is_acknowledged_too_or_it_would_come_for_ever() {
    let (mut service, broker, queue) = service();
    service.take(delivery("pitch/B1/samples", Err(100_000_000), 1));
    service.take(delivery("elsewhere", Ok("[]"), 2));
    service.take(delivery("pitch/B1/samples", Ok("{{{"), 3));
    service.save();
    service.take(saved(queue.recv().expect("a job"), true));
    assert_eq!(broker.acknowledged().len(), 3);
    service.tick(Instant::now());
    let text = service.metrics.text();
    for kind in ["too_large", "unknown_topic", "unreadable"] {
        assert!(text.contains(&format!("kind=\"{kind}\"")), "{kind} in {text}");
        let letters = broker.published();
        let topic = format!("pitchleak/dead_letter/{kind}");
        assert!(letters.iter().any(|letter| letter.topic == topic), "{kind} in {letters:?}");
    }
}

/// A terminal that shows the log or a notice obeys nothing that stands in a topic.
#[test]
fn control_characters_of_a_topic_are_told_escaped() {
    let (mut service, broker, _queue) = service();
    service.take(delivery("else\nwhere\u{1b}[31m\u{2028}é", Ok("[]"), 1));
    service.take(delivery("pitch/a\rb/samples", Err(100_000_000), 2));
    let published = broker.published();
    let notices = published.iter().filter(|message| message.topic.contains("/notice/"));
    let texts = notices.map(|message| {
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
fn a_broker_that_waits_gets_its_checkpoint_within_a_second() {
    let (mut service, _broker, queue) = service();
    let begin = Instant::now();
    (0..20).for_each(|id| _ = service.take(delivery("pitch/B1/samples", Ok("[]"), id)));
    service.tick(begin);
    assert!(queue.try_recv().is_err());
    service.tick(begin + Duration::from_secs(1));
    assert_eq!(queue.try_recv().map(|job| job.tickets.len()).ok(), Some(20));
    // One at a time.
    (0..20).for_each(|id| _ = service.take(delivery("pitch/B1/samples", Ok("[]"), id)));
    service.tick(begin + Duration::from_secs(2));
    assert!(queue.try_recv().is_err());
}
