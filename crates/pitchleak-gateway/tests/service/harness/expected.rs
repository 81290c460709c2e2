use super::{Listener, data};
use pitchleak::Rig;
use pitchleak::live::{Batch, BatchFormat, Checkpoint, Event, LiveConfig, Snapshot, Watch};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Each cylinder's state by the name of its file.
pub type States = BTreeMap<String, Vec<u8>>;

/// The states and the alarms' ids of a run that nothing disturbs.
pub fn undisturbed(cylinders: &[String], batches: &[String]) -> (States, BTreeSet<String>) {
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
    Checkpoint::new(folder.path()).unwrap().save(&Snapshot::of(&mut watch)).unwrap();
    let ids = events.into_iter().filter_map(|event| match event {
        Event::Alarm(alarm) => Some(alarm.id),
        _ => None,
    });
    let undisturbed = state(folder.path());
    assert!(!undisturbed.is_empty());
    (undisturbed, ids.collect())
}

/// As they are now.
pub fn state(folder: &Path) -> States {
    let Ok(entries) = std::fs::read_dir(folder.join("cylinders")) else { return States::new() };
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let states = names.filter(|name| name.ends_with(".state"));
    states
        .filter_map(|name| Some((name.clone(), std::fs::read(folder.join("cylinders").join(name)).ok()?)))
        .collect()
}

/// Of the alarms that were heard.
pub fn ids(listener: &Listener) -> BTreeSet<String> {
    let alarms = listener.heard("/alarm").into_iter();
    alarms
        .map(|alarm| {
            serde_json::from_str::<serde_json::Value>(&alarm).unwrap()["id"].as_str().unwrap().to_owned()
        })
        .collect()
}

/// Of so many cylinders.
pub fn names(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("T{k}/B{}", k % 3)).collect()
}
