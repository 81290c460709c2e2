use super::{Listener, Sender, data, wait_until};
use pitchleak::Rig;
use pitchleak::live::{Batch, BatchFormat, Checkpoint, Event, LiveConfig, Watch};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Each cylinder's state.
pub type States = BTreeMap<String, Vec<u8>>;

/// The states and the alarms' ids of a run that nothing disturbs.
pub fn undisturbed(cylinders: &[String], batches: &[String]) -> (States, BTreeSet<String>) {
    let mut watch = Watch::new(LiveConfig::of(rig()), None);
    let mut events = Vec::new();
    for payload in batches {
        for cylinder in cylinders {
            let payload = payload.as_bytes();
            let batch = Batch { cylinder, format: BatchFormat::Json, payload, resent: false };
            watch.take_batch(&batch, &mut events);
        }
    }
    let ids = events.into_iter().filter_map(|event| match event {
        Event::Alarm(alarm) => Some(alarm.id),
        _ => None,
    });
    let undisturbed = states(&watch);
    assert!(!undisturbed.is_empty());
    (undisturbed, ids.collect())
}

/// As a gateway would go on now that had only what is on the disk.
pub fn state(folder: &Path) -> States {
    let Ok(entries) = std::fs::read_dir(folder.join("cylinders")) else { return States::new() };
    let copy = tempfile::tempdir().unwrap();
    let checkpoint = Checkpoint::new(copy.path()).unwrap();
    for file in entries.filter_map(Result::ok) {
        // One that is gone by now has another name.
        let _ = std::fs::copy(file.path(), copy.path().join("cylinders").join(file.file_name()));
    }
    let mut watch = Watch::new(LiveConfig::of(rig()), None);
    checkpoint.restore(&mut watch).unwrap();
    states(&watch)
}

fn states(watch: &Watch) -> States {
    watch.states().unwrap().into_iter().map(|(name, state)| (name.to_owned(), state)).collect()
}

fn rig() -> Rig {
    Rig::load(data().join("traces/rig.toml")).unwrap()
}

/// Of the alarms that were heard.
pub fn ids(listener: &Listener) -> BTreeSet<String> {
    heard(listener).into_iter().collect()
}

fn heard(listener: &Listener) -> Vec<String> {
    let id = |alarm: &String| {
        let alarm: serde_json::Value = serde_json::from_str(alarm).unwrap();
        alarm["id"].as_str().unwrap().to_owned()
    };
    listener.heard("/alarm").iter().map(id).collect()
}

/// How often each alarm was heard, once all has come that the broker had before.
pub fn copies(sender: &mut Sender, listener: &Listener) -> BTreeMap<String, u64> {
    let before = listener.heard("/marker").len();
    sender.send("pitchleak/marker", b"");
    wait_until("the marker comes", || listener.heard("/marker").len() > before);
    let mut copies = BTreeMap::new();
    heard(listener).into_iter().for_each(|id| *copies.entry(id).or_default() += 1);
    copies
}

/// Alarms that a gateway would know, if it started now, that the broker has.
pub fn sent_by_disk(folder: &Path) -> Vec<String> {
    let Ok(text) = std::fs::read_to_string(folder.join("alarms.json")) else { return Vec::new() };
    let alarms: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text).unwrap();
    alarms.into_iter().filter(|(_, alarm)| alarm["sent"] == true).map(|(id, _)| id).collect()
}

/// Of so many cylinders.
pub fn names(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("T{k}/B{}", k % 3)).collect()
}
