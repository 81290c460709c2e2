//! A configuration that changes while it runs, and states that are damaged or of another rig: the others know nothing of it.

use crate::harness::{
    Gateway, Mosquitto, Sender, States, TRACE, batches, data, names, state, undisturbed, wait_until,
};
use std::fs;

const CYLINDERS: usize = 50;

/// As for a rig that was measured again.
fn edited_rig() -> String {
    let rig = fs::read_to_string(data().join("traces/rig.toml")).unwrap();
    let edited = rig.replacen("stroke = \"0.2 m\"", "stroke = \"0.21 m\"", 1);
    assert_ne!(rig, edited, "{rig}");
    edited
}

#[test]
fn reloaded_under_load_and_started_with_one_state_damaged_and_one_rig_edited_all_others_are_as_they_were() {
    let Some(broker) = Mosquitto::start("") else { return };
    let mut gateway =
        Gateway::new(&broker, |text| text.replace("most_cylinders = 50", "most_cylinders = 60"));
    gateway.start();
    gateway.wait_for("connected");
    let (cylinders, batches) = (names(CYLINDERS), batches(TRACE, 100));
    let mut sender = Sender::new(broker.port);
    let mut send = |batches: &[String]| {
        for batch in batches {
            for cylinder in &cylinders {
                sender.send(&format!("pitch/{cylinder}/samples"), batch.as_bytes());
            }
        }
        sender.flush();
    };
    let config = fs::read_to_string(gateway.path("gateway.toml")).unwrap();
    send(&batches[..4]);
    // A cylinder of which nothing came yet has nothing to begin anew.
    wait_until("all are watched", || gateway.metric("pitchleak_cylinders") > 49.5);
    // One that cannot be used changes nothing.
    fs::write(gateway.path("gateway.toml"), &config[..config.len() / 2]).unwrap();
    gateway.signal("-HUP");
    gateway.wait_for("goes on as before");
    fs::write(gateway.path("edited.toml"), edited_rig()).unwrap();
    let edited = format!("{config}[watch.cylinders.\"{}\"]\nrig = \"edited.toml\"\n", cylinders[7]);
    fs::write(gateway.path("gateway.toml"), edited).unwrap();
    gateway.signal("-HUP");
    send(&batches[4..10]);
    gateway.wait_for("begins anew");
    let (mut expected, _) = undisturbed(&cylinders, &batches[..10]);
    let without = |states: &mut States, cylinder: &str| _ = states.remove(cylinder);
    without(&mut expected, &cylinders[7]);
    let others = |but: &[&str]| {
        let mut states = state(&gateway.state());
        but.iter().for_each(|cylinder| without(&mut states, cylinder));
        states
    };
    wait_until("all others are as they were", || others(&[&cylinders[7]]) == expected);
    assert!(gateway.get("/health").starts_with("HTTP/1.1 200"));

    // Damage of one, and of the one before.
    assert_eq!(gateway.end(), Some(0));
    let file = format!("cylinders/{}.state", cylinders[20].replace('/', "%2F"));
    for ending in ["", ".before"] {
        fs::write(gateway.state().join(format!("{file}{ending}")), "damaged").unwrap();
    }
    gateway.start();
    gateway.wait_for("damaged: the cylinder begins anew");
    send(&batches[10..14]);
    let (mut expected, _) = undisturbed(&cylinders, &batches[..14]);
    let changed = [cylinders[7].as_str(), cylinders[20].as_str()];
    changed.iter().for_each(|cylinder| without(&mut expected, cylinder));
    wait_until("all others are as they were", || {
        let mut states = state(&gateway.state());
        changed.iter().for_each(|cylinder| without(&mut states, cylinder));
        states == expected
    });
    assert!(gateway.state().join(format!("{file}.aside")).exists());
    assert_eq!(gateway.end(), Some(0));
}
