//! The broker and the way to it fail, and the program is killed beside.

use crate::harness::{
    Dice, Gateway, Listener, Mosquitto, Sender, TRACE, batches, copies, ids, names, sent_by_disk, state,
    undisturbed, wait_until,
};
use std::collections::BTreeMap;
use std::time::Duration;

/// A number that whoever runs the tests asks for, as a longer one takes its time.
fn asked(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

#[test]
fn killed_at_random_moments_it_ends_as_an_undisturbed_run() {
    let Some(mut broker) = Mosquitto::start("max_inflight_messages 0") else { return };
    let kills: u64 = asked("PITCHLEAK_KILLS").unwrap_or(6);
    let listener = Listener::new(broker.port, "pitchleak/#");
    let mut gateway = Gateway::new(&broker, |text| text.replace("port =", "in_flight = 300\nport ="));
    gateway.start();
    gateway.wait_for("connected");
    let (cylinders, batches) = (names(3), batches(TRACE, 25));
    let mut sender = Sender::new(broker.port);
    let mut dice = Dice(7);
    let mut killed = 0;
    // Of alarms of which the disk knew at a kill that the broker had them: how often they were heard by then.
    let mut known = BTreeMap::new();
    for (at, batch) in batches.iter().enumerate() {
        for cylinder in &cylinders {
            sender.send(&format!("pitch/{cylinder}/samples"), batch.as_bytes());
        }
        std::thread::sleep(Duration::from_millis(5 + 4 * kills / 6));
        if at as u64 * (kills + 1) / batches.len() as u64 > killed {
            killed += 1;
            std::thread::sleep(Duration::from_millis(dice.throw(300)));
            gateway.kill();
            let heard = copies(&mut sender, &listener);
            for id in sent_by_disk(&gateway.state()) {
                let count = heard[&id];
                known.entry(id).or_insert(count);
            }
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
    wait_until("every alarm is out", || ids(&listener) == alarms);
    wait_until("the disk knows it", || gateway.metric("pitchleak_unsent_alarms") < 0.5);
    assert_eq!(gateway.end(), Some(0));
    assert_eq!(state(&gateway.state()), expected);
    let heard = copies(&mut sender, &listener);
    gateway.start();
    gateway.wait_for("connected");
    assert_eq!(gateway.end(), Some(0));
    assert_eq!(copies(&mut sender, &listener), heard, "a life without samples sends none");
    assert!(known.iter().all(|(id, count)| heard[id] == *count), "{known:?}, but {heard:?}");
    assert!(heard.values().all(|count| *count <= kills + 1), "{heard:?}");
    assert!(killed >= kills && alarms.len() == 6, "{killed} kills, {alarms:?}");
    wait_until("it says goodbye", || {
        listener.heard("pitchleak/status").last().is_some_and(|status| status.contains("offline"))
    });
}

#[test]
fn a_network_that_is_cut_and_mended_changes_nothing() {
    let Some(broker) = Mosquitto::start("max_inflight_messages 0") else { return };
    let mut gateway = Gateway::new(&broker, |text| text.replace("port =", "keep_alive_s = 1\nport ="));
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
            std::thread::sleep(Duration::from_secs(asked("PITCHLEAK_CUT_S").unwrap_or(0)));
            broker.mend();
        }
    }
    sender.flush();
    let (expected, _) = undisturbed(&cylinders, &batches);
    wait_until("the state is that of the undisturbed run", || state(&gateway.state()) == expected);
    assert_eq!(gateway.end(), Some(0));
}

/// Kills the broker while all flows and alarms are about to be raised, and again while it holds messages for a gateway that
/// is away. What it has then lost is a gap in the samples, and nothing else.
fn broker_killed(settings: &str, keeps: bool) {
    let Some(mut broker) = Mosquitto::start(&format!("max_inflight_messages 0\n{settings}")) else { return };
    let listener = Listener::new(broker.port, "pitchleak/#");
    let mut gateway = Gateway::new(&broker, |text| text);
    gateway.start();
    gateway.wait_for("connected");
    let (cylinders, mut batches) = (names(2), batches(TRACE, 25));
    let mut sender = Sender::new(broker.port);
    let mut send = |batches: &[String]| {
        for (batch, cylinder) in
            batches.iter().flat_map(|batch| cylinders.iter().map(move |name| (batch, name)))
        {
            sender.send(&format!("pitch/{cylinder}/samples"), batch.as_bytes());
        }
        sender.flush();
    };

    send(&batches[..4]);
    wait_until("all came", || gateway.metric("pitchleak_messages_total") >= 8.0);
    broker.kill();
    wait_until("that is known", || gateway.metric("pitchleak_connected") < 0.5);
    let statuses = listener.heard("pitchleak/status").len();
    broker.revive();
    wait_until("it is back", || gateway.metric("pitchleak_connected") > 0.5);
    wait_until("it is heard", || listener.heard("pitchleak/status").len() > statuses);
    send(&batches[4..80]);
    let (expected, _) = undisturbed(&cylinders, &batches[..80]);
    wait_until("nothing is missing", || state(&gateway.state()) == expected);

    assert_eq!(gateway.end(), Some(0));
    send(&batches[80..120]);
    std::thread::sleep(Duration::from_millis(300));
    broker.kill();
    broker.revive();
    gateway.start();
    gateway.wait_for(if keeps { "the session goes on" } else { "the session is new" });
    send(&batches[120..]);
    if !keeps {
        batches.drain(80..120);
    }
    let (expected, alarms) = undisturbed(&cylinders, &batches);
    wait_until("the state is that of the undisturbed run", || state(&gateway.state()) == expected);
    assert_eq!(gateway.end(), Some(0));
    assert_eq!((ids(&listener), alarms.len()), (alarms, 4));
}

#[test]
fn a_broker_that_is_killed_and_has_forgotten_everything() {
    broker_killed("persistence false", false);
}

#[test]
fn a_broker_that_is_killed_and_has_kept_what_it_had() {
    broker_killed("autosave_on_changes true\nautosave_interval 1", true);
}
