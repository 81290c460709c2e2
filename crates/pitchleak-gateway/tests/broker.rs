//! The program with a real broker: TLS and password, killed at any moment, fed with what it cannot use.

#![allow(clippy::unwrap_used)]

mod harness;

use harness::{Dice, Gateway, Listener, Mosquitto, Sender, batches, data, wait_until};
use pitchleak::Rig;
use pitchleak::live::{Batch, BatchFormat, Checkpoint, Event, LiveConfig, Snapshot, Watch};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

const TRACE: &str = "traces/both.csv.gz";

/// The state file and the alarms' ids of a run that nothing disturbs.
fn undisturbed(cylinders: &[String], batches: &[String]) -> (Vec<u8>, BTreeSet<String>) {
    let rig = Rig::load(data().join("traces/rig.toml")).unwrap();
    let mut watch = Watch::new(LiveConfig::of(rig), None);
    let mut events = Vec::new();
    for payload in batches {
        for cylinder in cylinders {
            let payload = payload.as_bytes();
            let batch = Batch { cylinder, format: BatchFormat::Json, payload, resent: false };
            watch.take_batch(&batch, &mut events);
        }
    }
    let folder = tempfile::tempdir().unwrap();
    Checkpoint::new(folder.path()).unwrap().save(&Snapshot::of(&watch)).unwrap();
    let ids = events.into_iter().filter_map(|event| match event {
        Event::Alarm(alarm) => Some(alarm.id),
        _ => None,
    });
    let undisturbed = state(folder.path());
    assert!(!undisturbed.is_empty());
    (undisturbed, ids.collect())
}

/// Nothing in the moment in which the checkpoint before makes room for the next.
fn state(folder: &Path) -> Vec<u8> {
    std::fs::read(folder.join("watch.state")).unwrap_or_default()
}

fn ids(listener: &Listener) -> BTreeSet<String> {
    let alarms = listener.heard("/alarm").into_iter();
    alarms
        .map(|alarm| {
            serde_json::from_str::<serde_json::Value>(&alarm).unwrap()["id"].as_str().unwrap().to_owned()
        })
        .collect()
}

fn names(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("T{k}/B{}", k % 3)).collect()
}

#[test]
fn killed_at_random_moments_it_ends_as_an_undisturbed_run() {
    let Some(mut broker) = Mosquitto::start("max_inflight_messages 0") else { return };
    let kills: u64 = std::env::var("PITCHLEAK_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(6);
    let listener = Listener::new(broker.port, "pitchleak/#");
    let mut gateway = Gateway::new(&broker, |text| text.replace("port =", "in_flight = 300\nport ="));
    gateway.start();
    gateway.wait_for("connected");
    let (cylinders, batches) = (names(3), batches(TRACE, 25));
    let mut sender = Sender::new(broker.port);
    let mut dice = Dice(7);
    let mut killed = 0;
    for (at, batch) in batches.iter().enumerate() {
        for cylinder in &cylinders {
            sender.send(&format!("pitch/{cylinder}/samples"), batch.as_bytes());
        }
        std::thread::sleep(Duration::from_millis(5 + 4 * kills / 6));
        if at as u64 * (kills + 1) / batches.len() as u64 > killed {
            killed += 1;
            std::thread::sleep(Duration::from_millis(dice.throw(300)));
            gateway.kill();
            gateway.start();
            if killed % 3 == 0 {
                broker.restart();
            }
        }
    }
    sender.flush();
    gateway.wait_for("connected");
    let (expected, alarms) = undisturbed(&cylinders, &batches);
    wait_until("the state is that of the undisturbed run", || state(&gateway.state()) == expected);
    assert_eq!(gateway.end(), Some(0));
    assert_eq!(state(&gateway.state()), expected);
    assert_eq!(ids(&listener), alarms);
    assert!(killed >= kills && alarms.len() == 6, "{killed} kills, {alarms:?}");
    assert!(listener.heard("pitchleak/status").last().unwrap().contains("offline"));
}

#[test]
fn a_network_that_is_cut_and_mended_changes_nothing() {
    let Some(broker) = Mosquitto::start("max_inflight_messages 0") else { return };
    let mut gateway = Gateway::new(&broker, |text| text.replace("port =", "keep_alive_s = 5\nport ="));
    gateway.start();
    gateway.wait_for("connected");
    let (cylinders, batches) = (names(2), batches(TRACE, 100));
    let mut sender = Sender::new(broker.port);
    for (at, batch) in batches.iter().enumerate() {
        for cylinder in &cylinders {
            sender.send(&format!("pitch/{cylinder}/samples"), batch.as_bytes());
        }
        if at == batches.len() / 2 {
            sender.flush();
            broker.cut();
            gateway.wait_for("no_broker");
            wait_until("that is told", || gateway.get("/health").contains("no connection"));
            broker.mend();
        }
    }
    sender.flush();
    let (expected, _) = undisturbed(&cylinders, &batches);
    wait_until("the state is that of the undisturbed run", || state(&gateway.state()) == expected);
    assert_eq!(gateway.end(), Some(0));
}

#[test]
fn a_wrong_authority_and_a_wrong_password_are_refused() {
    let Some(broker) = Mosquitto::start("") else { return };
    let mut foreign = Gateway::new(&broker, |text| text.replace("authority.pem", "another-authority.pem"));
    let mut guesser = Gateway::new(&broker, |text| text);
    std::fs::write(guesser.path("password"), "guessed").unwrap();
    foreign.start();
    guesser.start();
    foreign.wait_for("UnknownIssuer");
    guesser.wait_for("NotAuthorized");
    for gateway in [&mut foreign, &mut guesser] {
        assert!(gateway.get("/health").contains("503"), "no connection is well");
        assert!(!gateway.said.lock().unwrap().contains("connected;"));
        assert_eq!(gateway.end(), Some(0));
    }
}

#[test]
fn what_it_cannot_use_is_counted_and_costs_no_memory() {
    let Some(broker) = Mosquitto::start("") else { return };
    let mut gateway = Gateway::new(&broker, |text| text);
    gateway.start();
    gateway.wait_for("connected");
    let mut sender = Sender::new(broker.port);
    let good = &batches(TRACE, 50)[..8];
    sender.send("pitch/T1/B1/samples", good[0].as_bytes());
    sender.send("pitch/T1/B1/samples", &vec![b'['; 100_000_000]);
    for k in 0..300 {
        sender.send(&format!("pitch/T{k}/invented/samples"), good[0].as_bytes());
    }
    for text in
        ["{", "[[[[", "[{\"t_s\": 1e999}]", "\u{0}", "", "[{\"t_s\": 9, \"pa_psi\": 4}]", "null", "[{}]"]
    {
        sender.send("pitch/T1/B1/samples", text.as_bytes());
    }
    sender.send("pitch/T1/B1/samples", &[0xff; 1000]);
    // A clock that leaps ahead for one message, and comes back.
    let leap = good[1].replace("\"t_s\":", "\"t_s\":9");
    for batch in [leap.as_str(), good[2].as_str(), good[2].as_str()] {
        sender.send("pitch/T1/B1/samples", batch.as_bytes());
    }
    sender.flush();
    wait_until("all came", || gateway.metric("pitchleak_messages_total") >= 314.0);
    assert!((gateway.metric("pitchleak_cylinders") - 50.0).abs() < 0.5);
    assert!(gateway.get("/health").contains("200 OK"));
    let metrics = gateway.get("/metrics");
    for kind in ["too_large", "too_many_cylinders", "unreadable", "late"] {
        assert!(metrics.contains(&format!("kind=\"{kind}\"")), "{kind} in {metrics}");
    }
    assert!(gateway.peak_memory() < 400_000_000, "{} bytes", gateway.peak_memory());
    assert!(gateway.said.lock().unwrap().lines().count() < 40);
    assert_eq!(gateway.end(), Some(0));
}

#[test]
fn a_full_disk_is_told_and_nothing_is_acknowledged_before_it_has_room() {
    let Some(broker) = Mosquitto::start("max_inflight_messages 0") else { return };
    let mut gateway = Gateway::new(&broker, |text| text);
    gateway.start();
    gateway.wait_for("connected");
    wait_until("a checkpoint", || gateway.state().join("watch.state").exists());
    // Stands for a full disk, also where the tests are root: nothing can be written in its place.
    let obstacle = gateway.state().join("watch.state.new");
    wait_until("the obstacle", || std::fs::create_dir(&obstacle).is_ok());
    let batches = batches(TRACE, 100);
    let mut sender = Sender::new(broker.port);
    for batch in &batches[..10] {
        sender.send("pitch/T0/B0/samples", batch.as_bytes());
    }
    sender.flush();
    wait_until("all came", || gateway.metric("pitchleak_messages_total") >= 10.0);
    gateway.wait_for("checkpoint: cannot write");
    wait_until("none is acknowledged", || gateway.metric("pitchleak_unacknowledged") >= 10.0);
    gateway.kill();
    std::fs::remove_dir(&obstacle).unwrap();
    gateway.start();
    let (expected, _) = undisturbed(&["T0/B0".to_owned()], &batches[..10]);
    wait_until("all came again", || state(&gateway.state()) == expected);
    assert_eq!(gateway.end(), Some(0));
}
